"""Installs slosh_tables as an ament package."""

from package_setup import install

install(["numpy>=1.26"], extras={"notebook": ["pandas"]})
