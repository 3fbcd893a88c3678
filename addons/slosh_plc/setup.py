"""Installs slosh_plc as an ament package."""

from package_setup import install

install(
    [],
    extras={
        "plc": ["aiomqtt>=2.4", "asyncua>=2.0", "cryptography", "protobuf>=5", "pymodbus>=3.13"]
    },
    programs=["plc = slosh_plc.nodes.plc_node:main"],
    add_on="plc = slosh_plc.addon:ADDON",
)
