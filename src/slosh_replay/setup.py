"""Installs slosh_replay as an ament package."""

from package_setup import install

install(["numpy>=1.26", "scipy"], extras={"notebook": ["matplotlib", "pandas"]})
