"""Installs slosh_base as an ament package."""

from package_setup import install

install(["numba", "numpy>=1.26", "PyYAML"])
