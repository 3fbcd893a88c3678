"""Installs a Python package of this workspace as an ament package: what all setup.py files call.

A link to this file lies beside each of them, so that a copy of the one folder can be built, too:
by pip, for a wheel or a Debian package. Name, version and description come from package.xml.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from glob import glob
from pathlib import Path
from types import MappingProxyType
from typing import Any
from xml.etree import ElementTree

import setuptools
from setuptools.command.develop import develop

SHARED = ("launch", "config", "layouts")
"""Folders beside the package whose files go to its `share`."""


class Develop(develop):
    """Makes linked programs take Python from PATH, as setup.cfg does for installed ones."""

    def install_wrapper_scripts(self, dist: Any) -> None:
        """Writes the scripts that start the package's programs."""
        from setuptools.command.develop import VersionlessRequirement
        from setuptools.command.easy_install import ScriptWriter

        header = ScriptWriter.get_header("", "/usr/bin/env python3")
        for arguments in ScriptWriter.get_args(VersionlessRequirement(dist), header):
            self.write_script(*arguments)


def install(
    requires: Sequence[str] = (),
    *,
    extras: Mapping[str, Sequence[str]] = MappingProxyType({}),
    programs: Sequence[str] = (),
    add_on: str = "",
) -> None:
    """Installs the package in the present folder, with all files that its folder holds.

    Args:
        requires: what it needs of other projects.
        extras: what it needs for more, by the name of that.
        programs: as "name = module:main".
        add_on: where it names what it brings to the core, as "name = module:ADDON"; empty: it is
            no add-on.
    """
    manifest = ElementTree.parse("package.xml").getroot()
    told = {key: manifest.findtext(key) for key in ("name", "version", "description", "license")}
    maintainer, package = next(manifest.iter("maintainer")), str(told["name"])
    data = [
        str(path.relative_to(package))
        for path in sorted(Path(package).rglob("*"))
        if path.is_file() and path.suffix != ".py" and "__pycache__" not in path.parts
    ]
    shared = {folder: sorted(glob(f"{folder}/*.*")) for folder in SHARED}
    places = [(f"share/{package}/{folder}", files) for folder, files in shared.items() if files]
    if commands := sorted(name for name in glob("bin/*") if Path(name).is_file()):
        places.append(("bin", commands))
    setuptools.setup(
        **told,
        maintainer=maintainer.text,
        maintainer_email=maintainer.get("email"),
        cmdclass={"develop": Develop},
        packages=setuptools.find_packages(exclude=["test"]),
        package_data={package: data},
        data_files=[
            ("share/ament_index/resource_index/packages", [f"resource/{package}"]),
            (f"share/{package}", ["package.xml"]),
            *places,
        ],
        install_requires=["setuptools", *requires],
        extras_require={name: list(needed) for name, needed in extras.items()},
        zip_safe=False,
        entry_points={
            "console_scripts": list(programs),
            **({"slosh.addons": [add_on]} if add_on else {}),
        },
    )
