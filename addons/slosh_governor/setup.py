"""Installs slosh_governor as an ament package."""

from package_setup import install

install(
    ["numba", "numpy>=1.26", "scipy"],
    programs=[
        "governor = slosh_governor.nodes.governor_node:main",
        "relay = slosh_governor.nodes.relay_node:main",
    ],
    add_on="governor = slosh_governor.addon:ADDON",
)
