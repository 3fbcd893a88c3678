"""Installs slosh_msgs_py as an ament package."""

from package_setup import install

install(["numpy>=1.26"])
