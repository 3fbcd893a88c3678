"""Installs slosh as an ament package."""

from package_setup import install

install(["matplotlib", "numpy>=1.26"], extras={"tables": ["pandas", "xarray"]})
