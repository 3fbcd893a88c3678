"""Installs slosh_files as an ament package."""

from xml.etree import ElementTree

from setuptools import find_packages, setup

PACKAGE = "slosh_files"

setup(
    name=PACKAGE,
    version=ElementTree.parse("package.xml").findtext("version"),
    packages=find_packages(exclude=["test"]),
    package_data={PACKAGE: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    install_requires=["setuptools", "PyYAML"],
    zip_safe=False,
    maintainer="Slosh Monitor maintainers",
    maintainer_email="slosh-monitor@users.noreply.github.com",
    description="Writes files and folders so that nothing is destroyed; reads YAML strictly.",
    license="Apache-2.0",
    entry_points={"console_scripts": []},
)
