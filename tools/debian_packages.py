"""Generates Debian packaging of all packages with bloom, and builds it in a clean chroot.

    tools/run python tools/debian_packages.py -o FOLDER [--build] [--suite bookworm]

Needs bloom (`pip install bloom`), and for --build mmdebstrap and the right to make a chroot. No
network but Debian's archive: names of Debian packages come from the manifests themselves, as
rosdep's list has them. What a package needs of ROS 2 is not in the chroot, so only packages that
need none of it are installed and tried there.
"""

from __future__ import annotations

import argparse
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path
from xml.etree import ElementTree

import yaml

ROOT = Path(__file__).resolve().parent.parent
DISTRIBUTION = "jazzy"
TARGET = ("ubuntu", "noble")
LEFT_OUT = ("slosh_testing", "slosh_msgs")
"""For tests of this repository alone; and what rosidl must build, which is not in a chroot."""
PIP = "-pip"
"""End of rosdep's keys for what only pip brings; no Debian package can depend on that."""
NEEDED = "debhelper,dh-python,python3-all,python3-setuptools"
SCRIPT = ROOT / "tools" / "debian_build.sh"
"""What is run in the chroot."""
INDEX = f"""%YAML 1.1
---
distributions:
  {DISTRIBUTION}:
    distribution: [distribution.yaml]
    distribution_status: active
    distribution_type: ros2
    python_version: 3
type: index
version: 4
"""
RELEASES = f"""%YAML 1.1
---
release_platforms:
  {TARGET[0]}: [{TARGET[1]}]
repositories: {{}}
type: distribution
version: 2
"""


def main() -> int:
    """Writes a source folder with `debian` for each package; builds them if asked to."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "out" / "debian")
    parser.add_argument(
        "--build", action="store_true", help="build the packages in a clean chroot"
    )
    parser.add_argument("--suite", default="bookworm", help="Debian release of the chroot")
    arguments = parser.parse_args()
    output: Path = arguments.output.absolute()
    shutil.rmtree(output, ignore_errors=True)
    output.mkdir(parents=True)
    packages = [
        path.parent
        for path in sorted(ROOT.glob("*/slosh*/package.xml"))
        if path.parent.name not in LEFT_OUT
    ]
    with tempfile.TemporaryDirectory() as name:
        environment = rosdep_environment(Path(name), packages)
        refused = [
            f"{one.name}: {why}" for one in packages if (why := generate(one, output, environment))
        ]
    print(f"{len(packages) - len(refused)} of {len(packages)} packages have packaging in {output}")
    print(*refused, sep="\n")
    if arguments.build:
        build(output, arguments.suite)
    return int(bool(refused))


def depends(package: Path) -> set[str]:
    """Returns the keys of all that a package's manifest names as needed."""
    root = ElementTree.parse(package / "package.xml").getroot()
    return {element.text or "" for element in root if element.tag.endswith("depend")}


def rosdep_environment(folder: Path, packages: Iterable[Path]) -> dict[str, str]:
    """Writes rosdep's lists for the packages' own keys; returns variables that select them."""
    keys = set().union(*map(depends, packages))
    names = {key: {TARGET[0]: debian_name(key)} for key in keys}
    (folder / "keys.yaml").write_text(yaml.safe_dump(names))
    (folder / "sources").mkdir()
    (folder / "sources" / "20-own.list").write_text(f"yaml {(folder / 'keys.yaml').as_uri()}\n")
    (folder / "index-v4.yaml").write_text(INDEX)
    (folder / "distribution.yaml").write_text(RELEASES)
    environment = {
        **os.environ,
        "HOME": str(folder),
        "ROSDEP_SOURCE_PATH": str(folder / "sources"),
        "ROSDISTRO_INDEX_URL": (folder / "index-v4.yaml").as_uri(),
        "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
    }
    subprocess.run(
        ["rosdep", "update", "--rosdistro", DISTRIBUTION],
        env=environment, check=True, capture_output=True,
    )  # fmt: skip
    return environment


def debian_name(key: str) -> list[str] | dict[str, object]:
    """Returns what rosdep's list has for a key: Debian packages, or what pip is to install."""
    if key.endswith(PIP):
        return {"pip": {"packages": [key.removesuffix(PIP).removeprefix("python3-")]}}
    ours = key if key.startswith("python3-") else f"ros-{DISTRIBUTION}-{key.replace('_', '-')}"
    return [ours]


def generate(package: Path, output: Path, environment: dict[str, str]) -> str:
    """Copies a package and lets bloom write its folder `debian`; returns why not, or nothing."""
    copy = output / package.name
    shutil.copytree(package, copy, ignore=shutil.ignore_patterns("test", "__pycache__", "build"))
    words = ["bloom-generate", "rosdebian", "--ros-distro", DISTRIBUTION]
    words += ["--os-name", TARGET[0], "--os-version", TARGET[1]]
    done = subprocess.run(
        words, cwd=copy, env=environment, capture_output=True, text=True, stdin=subprocess.DEVNULL
    )
    if done.returncode == 0 and (copy / "debian" / "control").is_file():
        return ""
    shutil.rmtree(copy)
    lines = [line for line in (done.stdout + done.stderr).splitlines() if line.strip()]
    return next((line for line in lines if "rror" in line or "nable" in line), lines[-1])


def build(output: Path, suite: str) -> None:
    """Builds all packages in a new chroot, and installs and imports two of them there.

    Args:
        output: folder with the packages' sources; the packages and logs come there, too.
        suite: Debian release of the chroot.
    """
    shutil.copy(SCRIPT, output)
    subprocess.run(
        ["mmdebstrap", "--variant=buildd", f"--include={NEEDED}",
         "--customize-hook=mkdir $1/build",
         f"--customize-hook=sync-in {shlex.quote(str(output))} /build",
         f"--customize-hook=chroot $1 sh /build/{SCRIPT.name}",
         f"--customize-hook=sync-out /build {shlex.quote(str(output))}", suite, "/dev/null"],
        check=True,
    )  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
