"""Installs slosh_fleet as an ament package."""

from xml.etree import ElementTree

from setuptools import find_packages, setup

PACKAGE = "slosh_fleet"

setup(
    name=PACKAGE,
    version=ElementTree.parse("package.xml").findtext("version"),
    packages=find_packages(exclude=["test"]),
    package_data={PACKAGE: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    install_requires=["setuptools", "matplotlib", "numpy>=1.26"],
    extras_require={
        "fleet": ["duckdb>=1.2", "fsspec", "pyarrow"],
        "storage": ["s3fs"],
        "pdf": ["fpdf2>=2.8"],
    },
    zip_safe=False,
    maintainer="Slosh Monitor maintainers",
    maintainer_email="slosh-monitor@users.noreply.github.com",
    description="Stores the motions of many recordings and writes signed validation reports.",
    license="Apache-2.0",
    entry_points={"console_scripts": [], "slosh.addons": ["fleet = slosh_fleet.addon:ADDON"]},
)
