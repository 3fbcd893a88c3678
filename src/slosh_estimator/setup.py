"""Installs slosh_estimator as an ament package."""

from xml.etree import ElementTree

from setuptools import find_packages, setup

PACKAGE = "slosh_estimator"

setup(
    name=PACKAGE,
    version=ElementTree.parse("package.xml").findtext("version"),
    packages=find_packages(exclude=["test"]),
    package_data={PACKAGE: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=False,
    maintainer="Slosh Monitor maintainers",
    maintainer_email="slosh-monitor@users.noreply.github.com",
    description="Estimates sloshing height from acceleration and compares it with measurements.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "estimator = slosh_estimator.nodes.estimator_node:main",
            "monitor = slosh_estimator.nodes.monitor_node:main",
            "planner = slosh_estimator.nodes.planner_node:main",
            "predictor = slosh_estimator.nodes.predictor_node:main",
        ]
    },
)
