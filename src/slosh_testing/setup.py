"""Installs slosh_testing as an ament package."""

from xml.etree import ElementTree

from setuptools import find_packages, setup

PACKAGE = "slosh_testing"

setup(
    name=PACKAGE,
    version=ElementTree.parse("package.xml").findtext("version"),
    packages=find_packages(exclude=["test"]),
    package_data={PACKAGE: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    install_requires=[
        "setuptools",
        "numpy>=1.26",
        "PyYAML",
        "mcap",
        "opencv-python-headless>=4.6",
        "pytest",
        "rosbags",
        "scipy",
    ],
    zip_safe=False,
    maintainer="Slosh Monitor maintainers",
    maintainer_email="slosh-monitor@users.noreply.github.com",
    description="Builders that tests share: recordings, cells, processes, ROS graphs, commands.",
    license="Apache-2.0",
    entry_points={"console_scripts": []},
)
