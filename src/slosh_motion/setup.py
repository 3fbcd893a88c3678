"""Installs slosh_motion as an ament package."""

from package_setup import install

install(["numba", "numpy>=1.26"], extras={"joints": ["pin"], "notebook": ["pandas"]})
