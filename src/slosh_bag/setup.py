"""Installs slosh_bag as an ament package."""

from xml.etree import ElementTree

from setuptools import find_packages, setup
from setuptools.command.develop import develop

PACKAGE = "slosh_bag"


class Develop(develop):
    """Setuptools command that makes linked programs use Python from PATH, as setup.cfg does."""

    def install_wrapper_scripts(self, dist):
        """Writes the program scripts."""
        from setuptools.command.develop import VersionlessRequirement
        from setuptools.command.easy_install import ScriptWriter

        header = ScriptWriter.get_header("", "/usr/bin/env python3")
        for arguments in ScriptWriter.get_args(VersionlessRequirement(dist), header):
            self.write_script(*arguments)


setup(
    name=PACKAGE,
    cmdclass={"develop": Develop},
    version=ElementTree.parse("package.xml").findtext("version"),
    packages=find_packages(exclude=["test"]),
    package_data={PACKAGE: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    install_requires=[
        "setuptools",
        "lz4",
        "matplotlib",
        "mcap>=1.5",
        "numba",
        "numpy>=1.26",
        "rosbags",
        "scipy",
        "zstandard",
    ],
    extras_require={"tables": ["pandas"]},
    zip_safe=False,
    maintainer="Slosh Monitor maintainers",
    maintainer_email="slosh-monitor@users.noreply.github.com",
    description="Records, reads, imports and replays MCAP bags of a slosh cell.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "player = slosh_bag.nodes.player_node:main",
            "recorder = slosh_bag.nodes.recorder_node:main",
        ]
    },
)
