"""Builds wheels of all Python packages, for machines and CI without this checkout.

    tools/run python tools/wheels.py [-o FOLDER]

`slosh` requires all others in its own version, and has the extras of each of them.

They are for replay, planning and analysis, where ROS is not installed: nodes come with the
workspace.
Of the programs a wheel brings `slosh` alone; names such as `watch` would hide the system's own.
"""

from __future__ import annotations

import argparse
import configparser
import os
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterable
from email.parser import HeaderParser
from email.policy import compat32
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

ROOT = Path(__file__).resolve().parent.parent
PROGRAM = "[console_scripts]\nslosh = slosh_bringup.cli.main:command\n"
ADDONS = "slosh.addons"
"""Entry points by which the command finds add-ons: all that is kept of those of a package."""
OWNER = "slosh"
"""The package that brings the program, and what is written into bags of the messages."""
MESSAGES = ROOT / "src" / "slosh_msgs" / "msg"
FIRST_DAY = (1980, 1, 1, 0, 0, 0)
"""Of files in an archive: the same bytes whenever they are built."""


def main() -> int:
    """Builds all wheels and prints the command that installs them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "out" / "wheels")
    output: Path = parser.parse_args().output
    output.mkdir(parents=True, exist_ok=True)
    for old in output.glob("slosh*.whl"):
        old.unlink()
    packages = sorted(path.parent for path in ROOT.glob("*/slosh*/setup.py"))
    packages.remove(ROOT / "src" / "slosh_testing")  # this repository's tests alone need it
    with tempfile.TemporaryDirectory() as name:
        wheels = [BuiltWheel(package, built(package, Path(name))) for package in packages]
        for wheel in wheels:
            write_installable(wheel, output, required_by(wheel, wheels))
    print(f"{len(packages)} wheels in {output}; to install them: pip install {output}/*.whl")
    return 0


class BuiltWheel(NamedTuple):
    """A package's source folder and the wheel that setuptools made of it."""

    package: Path
    path: Path

    @property
    def name(self) -> str:
        """Import name of the package."""
        return self.package.name

    @property
    def version(self) -> str:
        """Version of the package, from the wheel's file name."""
        return self.path.name.split("-")[1]

    def extras(self) -> list[str]:
        """Names of the package's optional requirements, such as `plan`."""
        with zipfile.ZipFile(self.path) as archive:
            (name,) = (name for name in archive.namelist() if name.endswith("/METADATA"))
            text = archive.read(name).decode()
        return HeaderParser(policy=compat32).parsestr(text).get_all("Provides-Extra", [])


def required_by(wheel: BuiltWheel, wheels: Iterable[BuiltWheel]) -> str:
    """Returns the lines of a wheel's METADATA that require other wheels of this workspace.

    Args:
        wheel: the one that needs others, as its package.xml says; `slosh` needs all of them.
        wheels: all that are built.
    """
    manifest = ElementTree.parse(wheel.package / "package.xml")
    needed = {element.text for element in manifest.iter("exec_depend")}
    others = [one for one in wheels if one != wheel]
    if wheel.name != OWNER:
        others = [one for one in others if one.name in needed]
    lines = [f"Requires-Dist: {one.name}=={one.version}" for one in others]
    if wheel.name != OWNER:
        return "".join(f"{line}\n" for line in lines)
    offered = [(extra, one) for one in others for extra in one.extras()]
    new = {extra for extra, _ in offered}.difference(wheel.extras())
    lines += [f"Provides-Extra: {extra}" for extra in sorted(new)]
    lines += [
        f'Requires-Dist: {one.name}[{extra}]=={one.version} ; extra == "{extra}"'
        for extra, one in offered
    ]
    return "".join(f"{line}\n" for line in lines)


def built(package: Path, room: Path) -> Path:
    """Builds a package's wheel from a copy, since setuptools writes into its source folder."""
    copy = room / package.name
    shutil.copytree(package, copy, ignore=shutil.ignore_patterns("test", "__pycache__", "build"))
    command = [
        sys.executable,
        "-m",
        "pip",
        "wheel",
        "--quiet",
        "--no-deps",
        "--no-build-isolation",
    ]
    command += ["--disable-pip-version-check", "--wheel-dir", str(room / "built"), str(copy)]
    subprocess.run(command, check=True, env={**os.environ, "PIP_NO_INDEX": "1"})
    (wheel,) = (room / "built").glob(f"{package.name}-*.whl")
    return wheel


def write_installable(wheel: BuiltWheel, output: Path, required: str) -> None:
    """Copies a wheel without the programs of ROS nodes, which the workspace installs.

    Args:
        wheel: what setuptools made.
        output: folder of the copy.
        required: lines for its METADATA.
    """
    with zipfile.ZipFile(wheel.path) as source:
        names = [name for name in source.namelist() if not is_program(name)]
        record = next(name for name in names if name.endswith(".dist-info/RECORD"))
        lines = source.read(record).decode().splitlines(keepends=True)
        entry = record.replace("RECORD", "entry_points.txt")
        kept = [line for line in lines if not is_program(line.split(",")[0])]
        files = {name: source.read(name) for name in names}
        points = configparser.ConfigParser(delimiters=("=",))
        points.read_string(source.read(entry).decode() if entry in source.namelist() else "")
    metadata = record.replace("RECORD", "METADATA")
    # The description comes after an empty line. The old hash of the file is not kept.
    head, *rest = files[metadata].decode().partition("\n\n")
    files[metadata] = f"{head.rstrip()}\n{required.rstrip()}{''.join(rest)}".encode()
    kept = [f"{metadata},,\n" if line.startswith(f"{metadata},") else line for line in kept]
    if points.has_section(ADDONS):
        lines = [f"{name} = {value}\n" for name, value in points.items(ADDONS)]
        files[entry] = "".join([f"[{ADDONS}]\n", *lines]).encode()
        kept[-1:-1] = [f"{entry},,\n"]
    if wheel.name == OWNER:
        data = record.replace(".dist-info/RECORD", ".data/data/share/slosh_msgs/msg")
        added = {entry: PROGRAM.encode()}
        added |= {f"{data}/{path.name}": path.read_bytes() for path in MESSAGES.glob("*.msg")}
        files |= added
        kept[-1:-1] = [f"{name},,\n" for name in sorted(added)]
    files[record] = "".join(kept).encode()
    with zipfile.ZipFile(output / wheel.path.name, "w", zipfile.ZIP_DEFLATED) as target:
        for name, content in files.items():
            target.writestr(zipfile.ZipInfo(name, FIRST_DAY), content, zipfile.ZIP_DEFLATED)


def is_program(name: str) -> bool:
    """Whether a file in a wheel is a program or registers one."""
    return re.search(r"\.dist-info/entry_points\.txt$|\.data/data/bin/", name) is not None


if __name__ == "__main__":
    sys.exit(main())
