"""Installs slosh_machines as an ament package."""

from package_setup import install

install(["numpy>=1.26", "scipy"], add_on="machines = slosh_machines.addon:ADDON")
