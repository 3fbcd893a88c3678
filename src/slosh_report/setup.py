"""Installs slosh_report as an ament package."""

from xml.etree import ElementTree

from setuptools import find_packages, setup

PACKAGE = "slosh_report"

setup(
    name=PACKAGE,
    version=ElementTree.parse("package.xml").findtext("version"),
    packages=find_packages(exclude=["test"]),
    package_data={
        PACKAGE: [
            "py.typed",
            "page/*.j2",
            "page/*.css",
            "page/*.js",
            "uplot/*",
        ]
    },
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    install_requires=["setuptools", "jinja2", "matplotlib", "numpy>=1.26"],
    zip_safe=False,
    maintainer="Slosh Monitor maintainers",
    maintainer_email="slosh-monitor@users.noreply.github.com",
    description="Accuracy metrics, clock alignment and the report of a run.",
    license="Apache-2.0",
    entry_points={"console_scripts": []},
)
