"""What this add-on brings to the core: see slosh_base.addons."""

from __future__ import annotations

from slosh_base.addons import AddOn, CellNode, Command

ADDON = AddOn(
    commands={
        "plc": Command(
            "robot",
            "serve a running cell's state over OPC UA, MQTT or Modbus TCP",
            "slosh_plc.plc_command",
        ),
        "certificates": Command(
            "robot",
            "create and list the certificates of the OPC UA server and its clients",
            "slosh_plc.certificates_command",
        ),
    },
    nodes={"plc": "slosh_plc.nodes.plc_node"},
    cell_nodes={"plc": CellNode("plc", "serve the cell's state over OPC UA, MQTT or Modbus TCP")},
)
