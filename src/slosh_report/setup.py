"""Installs slosh_report as an ament package."""

from package_setup import install

install(["jinja2", "matplotlib", "numpy>=1.26"])
