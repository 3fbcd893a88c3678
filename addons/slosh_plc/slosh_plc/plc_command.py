"""`slosh plc`: serves a running cell's state to controllers over OPC UA, MQTT or Modbus TCP."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from slosh_bringup.cli.node_process import run_until_stopped
from slosh_bringup.live.cell_setup import NAMESPACE
from slosh_bringup.parameter_file import check_parameter_file
from slosh_bringup.processes import NodeProcess
from slosh_plc.cell_state import ADDRESSES, SIGNALS, Kind
from slosh_report.text_table import aligned

EPILOG = """OPC UA listens on this machine, port 4840, unless the file says otherwise:
  /**:
    plc:
      ros__parameters: {modbus_port: 1502, mqtt_broker: "broker:1883"}
Needs: pip install -r requirements/plc.txt. A cell that is silent has bad quality within 1 s."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `slosh plc` to the argument parser."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
    parser.add_argument(
        "--parameters", type=Path, metavar="FILE", help="ROS parameter file of the node plc"
    )
    parser.add_argument(
        "--namespace", default=NAMESPACE, help="namespace of the cell (default %(default)s)"
    )
    parser.add_argument(
        "--list",
        action="store_true",
        help="list the served values with units and Modbus addresses, and exit",
    )
    parser.add_argument("--json", action="store_true", help="print the --list output as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Serves the state until Ctrl-C is pressed, or prints which values are served."""
    if arguments.list:
        print(as_json() if arguments.json else as_text())
        return 0
    files = [arguments.parameters] if arguments.parameters is not None else []
    for path in files:
        check_parameter_file(path, arguments.namespace)
    return run_until_stopped(NodeProcess("plc", files), arguments.namespace)


def as_text() -> str:
    """Returns the table of the served values."""
    rows = [("value", "type", "unit", "Modbus", "quality", "meaning")]
    for signal in SIGNALS:
        unit = "" if signal.unit == "1" else signal.unit
        choices = ", ".join(f"{number} {name}" for number, name in enumerate(signal.choices))
        meaning = signal.meaning + (f": {choices}" if choices else "")
        addresses = str(signal.address), str(signal.address + 2)
        rows.append((signal.name, signal.kind.value, unit, *addresses, meaning))
    lines = aligned(rows, "<<<>><")
    lines.append(
        "Modbus registers (functions 3 and 4, from 0): float32 or uint32, high word first; "
        "quality: 0 good, 1 uncertain, 2 bad"
    )
    return "\n".join(lines)


def as_json() -> str:
    """Returns the served values as JSON."""
    rows = [
        {
            "name": signal.name, "type": signal.kind.value, "unit": signal.unit,
            "meaning": signal.meaning, "choices": signal.choices,
            "modbus": {
                "address": signal.address, "quality": signal.address + 2, "count": ADDRESSES,
                "type": "float32" if signal.kind is Kind.NUMBER else "uint32",
            },
        }
        for signal in SIGNALS
    ]  # fmt: skip
    return json.dumps(rows, indent=1)
