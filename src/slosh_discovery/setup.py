"""Installs slosh_discovery as an ament package."""

from xml.etree import ElementTree

from setuptools import find_packages, setup

PACKAGE = "slosh_discovery"

setup(
    name=PACKAGE,
    version=ElementTree.parse("package.xml").findtext("version"),
    packages=find_packages(exclude=["test"]),
    package_data={PACKAGE: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    install_requires=["setuptools", "matplotlib", "numba", "numpy>=1.26", "scipy"],
    extras_require={"tables": ["pandas"]},
    zip_safe=False,
    maintainer="Slosh Monitor maintainers",
    maintainer_email="slosh-monitor@users.noreply.github.com",
    description="From recordings to findings: which effect a model of sloshing lacks.",
    license="Apache-2.0",
    entry_points={"console_scripts": []},
)
