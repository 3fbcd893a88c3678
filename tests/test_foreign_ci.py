"""Tests another repository's CI by typing the steps of its file in a new environment."""

import shutil
import subprocess
import sys
import sysconfig
import zipfile
from email.parser import HeaderParser
from pathlib import Path

import pytest
import yaml
from pages.commands import words_of
from wheels import main as build_wheels

from slosh_bringup.cli.main import build_parser

ROOT = Path(__file__).resolve().parent.parent
FILE = ROOT / "docs" / "examples" / "ci" / "slosh.yml"
STEPS = yaml.safe_load(FILE.read_text(encoding="utf-8"))["jobs"]["replay"]["steps"]
RUN = [step["run"] for step in STEPS if "run" in step]
OPTIONAL = {"plan", "plc", "fleet", "joints", "modes", "pdf"}
"""Optional requirements that users install as an extra."""
MODEL = "src/slosh_bringup/config/model.yaml"
"""A model that a manifest of recordings can name."""


def test_the_file_runs_what_the_pages_say():
    install, replay = RUN
    parsed = build_parser("replay").parse_args(words_of(replay)[1:])
    assert (parsed.check, str(parsed.junit)) == (True, "replay.xml")
    page = (ROOT / "docs" / "replay.md").read_text(encoding="utf-8")
    assert replay in page
    assert install.removeprefix("python -m ") in page


@pytest.fixture(scope="module")
def repository(tmp_path_factory):
    """Creates a repository with recordings, and an environment with the wheels but no ROS."""
    folder = tmp_path_factory.mktemp("foreign")
    shutil.copytree(ROOT / "bags", folder / "bags")
    (folder / MODEL).parent.mkdir(parents=True)
    shutil.copy(ROOT / MODEL, folder / MODEL)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["wheels", "-o", str(folder / "wheels")])
        assert build_wheels() == 0
    base = Path(getattr(sys, "_base_executable", sys.executable))
    subprocess.run([base, "-m", "venv", folder / "venv"], check=True)
    # Libraries of others come from here: fetching them is not what is tried.
    (own,) = (folder / "venv" / "lib").glob("python3*/site-packages")
    for path in Path(sysconfig.get_path("purelib")).iterdir():
        if not (own / path.name).exists() and not path.name.startswith(("rclpy", "slosh")):
            (own / path.name).symlink_to(path)
    return folder


def typed(repository, line):
    """Runs a line as CI types it, in an environment without this checkout."""
    path = f"{repository / 'venv' / 'bin'}:/usr/bin:/bin"
    environment = {"PATH": path, "HOME": str(Path.home())}
    return subprocess.run(
        ["bash", "-euc", line], cwd=repository, env=environment, capture_output=True, text=True
    )


@pytest.mark.long
def test_its_steps_replay_the_recordings(repository):
    install, replay = RUN
    # Resolved as from an index: every requirement of every wheel must be met.
    done = typed(repository, f"{install} 'slosh[plan,modes,tables]' --no-index --quiet")
    assert done.returncode == 0, done.stderr
    assert "slosh" not in typed(repository, "pip check").stdout
    where = "import slosh; print(slosh.__file__, slosh.__version__)"
    assert str(repository) in typed(repository, f"python -c '{where}'").stdout
    done = typed(repository, replay)
    assert done.returncode == 0, done.stderr
    assert "9 of 9 bags as expected" in done.stderr
    assert 'failures="0"' in (repository / "replay.xml").read_text()
    # A changed model is a failure, where the manifest names it.
    manifest, model = repository / "bags/manifest.yaml", repository / MODEL
    manifest.write_text(
        manifest.read_text().replace("  c:\n", f"  c:\n    model: ../{MODEL}\n", 1)
    )
    assert typed(repository, replay).returncode == 0
    model.write_text(model.read_text().replace("fill_height: 0.07", "fill_height: 0.071"))
    assert typed(repository, replay).returncode == 1


@pytest.mark.long
def test_one_wheel_requires_all_others_in_its_version(repository):
    """So `pip install --find-links` of the one brings a whole that fits together."""
    wheels = list((repository / "wheels").glob("*.whl"))
    one = next(wheel for wheel in wheels if wheel.name.startswith("slosh-"))
    with zipfile.ZipFile(one) as archive:
        (name,) = (name for name in archive.namelist() if name.endswith("/METADATA"))
        said = HeaderParser().parsestr(archive.read(name).decode())
    required = {line for line in said.get_all("Requires-Dist") if ";" not in line}
    version = said["Version"]
    direct = {wheel.name.split("-")[0] for wheel in wheels} - {"slosh"}
    assert {f"{name}=={version}" for name in direct} <= required
    optional = {path.stem for path in (ROOT / "requirements").glob("*.txt")} & OPTIONAL
    assert optional == OPTIONAL
    assert set(said.get_all("Provides-Extra")) >= OPTIONAL


@pytest.mark.long
def test_the_wheels_bring_one_program_and_work_without_ros(repository):
    names = [name for wheel in (repository / "wheels").glob("*.whl")
             for name in zipfile.ZipFile(wheel).namelist()]  # fmt: skip
    assert sum("entry_points" in name for name in names) == 1
    assert not [name for name in names if "/bin/" in name]
    for line in (
        "slosh new cup --diameter 0.08 --fill-height 0.06",
        "slosh motion quintic --speed 20 --stroke 0.3 -o move.csv",
        "slosh simulate cup/model.yaml move.csv -o heights.csv",
        "slosh import table move.csv -o bag",
        "slosh explain INPUT_DOUBTFUL",
    ):
        done = typed(repository, line)
        assert done.returncode == 0, (line, done.stderr)
    for line in ("slosh demo", "slosh play bags/c3"):
        done = typed(repository, line)
        (told,) = done.stderr.splitlines()
        assert done.returncode == 2
        assert "needs ROS 2 and the built workspace" in told
