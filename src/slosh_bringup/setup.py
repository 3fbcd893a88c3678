"""Installs slosh_bringup as an ament package."""

from glob import glob
from xml.etree import ElementTree

from setuptools import find_packages, setup
from setuptools.command.develop import develop

PACKAGE = "slosh_bringup"


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
    package_data={PACKAGE: ["py.typed", "watch/page/*", "scale_page/clicks.*"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
        (f"share/{PACKAGE}/launch", sorted(glob("launch/*.*"))),
        (f"share/{PACKAGE}/config", sorted(glob("config/*.*"))),
        (f"share/{PACKAGE}/layouts", sorted(glob("layouts/*.*"))),
        ("bin", ["bin/slosh"]),
    ],
    install_requires=[
        "setuptools",
        "PyYAML",
        "distributed>=2025.1",
        "jinja2",
        "matplotlib",
        "numpy>=1.26",
        "opencv-python-headless>=4.6",
        "scipy",
        "starlette>=0.40",
        "tqdm",
        "uvicorn>=0.35",
        "websockets>=14",
    ],
    extras_require={"completion": ["argcomplete"]},
    zip_safe=False,
    maintainer="Slosh Monitor maintainers",
    maintainer_email="slosh-monitor@users.noreply.github.com",
    description="Launch files, parameters, the simulated cell and the slosh command.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "cell = slosh_bringup.nodes.cell_node:main",
            "markers = slosh_bringup.nodes.markers_node:main",
            "watch = slosh_bringup.nodes.watch_node:main",
        ]
    },
)
