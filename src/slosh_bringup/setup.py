"""Installs slosh_bringup as an ament package."""

from glob import glob
from xml.etree import ElementTree

from setuptools import find_packages, setup

PACKAGE = "slosh_bringup"

setup(
    name=PACKAGE,
    version=ElementTree.parse("package.xml").findtext("version"),
    packages=find_packages(exclude=["test"]),
    package_data={PACKAGE: ["py.typed", "watch/page/*"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
        (f"share/{PACKAGE}/launch", sorted(glob("launch/*"))),
        (f"share/{PACKAGE}/config", sorted(glob("config/*"))),
        (f"share/{PACKAGE}/layouts", sorted(glob("layouts/*"))),
        ("bin", ["bin/slosh"]),
    ],
    install_requires=["setuptools"],
    zip_safe=False,
    maintainer="Slosh Monitor maintainers",
    maintainer_email="slosh-monitor@users.noreply.github.com",
    description="Launch files, parameters, the simulated cell and the slosh command.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "cell = slosh_bringup.nodes.cell_node:main",
            "watch = slosh_bringup.nodes.watch_node:main",
        ]
    },
)
