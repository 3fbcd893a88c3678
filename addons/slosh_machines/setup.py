"""Installs slosh_machines as an ament package."""

from package_setup import install

install(["jinja2", "numpy>=1.26", "scipy"], add_on="machines = slosh_machines.addon:ADDON")
