"""Installs slosh_discovery as an ament package."""

from package_setup import install

install(["matplotlib", "numba", "numpy>=1.26", "scipy"], extras={"tables": ["pandas"]})
