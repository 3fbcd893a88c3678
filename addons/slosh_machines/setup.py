"""Installs slosh_machines as an ament package."""

from xml.etree import ElementTree

from setuptools import find_packages, setup

PACKAGE = "slosh_machines"

setup(
    name=PACKAGE,
    version=ElementTree.parse("package.xml").findtext("version"),
    packages=find_packages(exclude=["test"]),
    package_data={PACKAGE: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    install_requires=["setuptools", "numpy>=1.26", "scipy"],
    zip_safe=False,
    maintainer="Slosh Monitor maintainers",
    maintainer_email="slosh-monitor@users.noreply.github.com",
    description="Finds a machine's strokes with the lowest waves, for its controller.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [],
        "slosh.addons": ["machines = slosh_machines.addon:ADDON"],
    },
)
