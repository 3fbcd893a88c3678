"""Debian packaging by bloom's templates: what the manifests make of it."""

import shutil
import sys
from pathlib import Path

import pytest
from debian_packages import ROOT, debian_name, depends, generate, rosdep_environment

PACKAGES = sorted(path.parent for path in ROOT.glob("*/slosh*/setup.py"))


def test_every_key_of_the_manifests_has_a_name():
    for key in set().union(*map(depends, PACKAGES)):
        name = debian_name(key)
        assert isinstance(name, dict) or name[0].startswith(("python3-", "ros-jazzy-"))
    assert debian_name("slosh_msgs_py") == ["ros-jazzy-slosh-msgs-py"]
    assert debian_name("python3-rosbags-pip") == {"pip": {"packages": ["rosbags"]}}


@pytest.mark.long
def test_bloom_writes_packaging_with_all_that_a_package_needs(tmp_path):
    if shutil.which("bloom-generate", path=Path(sys.executable).parent) is None:
        pytest.skip("bloom is not installed (requirements/deployment.txt)")
    (tmp_path / "rosdep").mkdir()
    environment = rosdep_environment(tmp_path / "rosdep", PACKAGES)
    assert generate(ROOT / "src" / "slosh_model", tmp_path, environment) == ""
    control = (tmp_path / "slosh_model" / "debian" / "control").read_text()
    needed = {name.strip() for line in control.splitlines() if line.startswith("Depends:")
              for name in line.removeprefix("Depends:").split(",")}  # fmt: skip
    assert {"ros-jazzy-slosh-base", "python3-numpy", "python3-scipy"} <= needed
    broken = tmp_path / "broken"
    broken.mkdir()
    (broken / "package.xml").write_text("<package>")
    assert generate(broken, tmp_path / "out", environment)
