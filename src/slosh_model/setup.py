"""Installs slosh_model as an ament package."""

from package_setup import install

install(["numpy>=1.26", "scipy", "numba"], extras={"notebook": ["matplotlib", "pandas"]})
