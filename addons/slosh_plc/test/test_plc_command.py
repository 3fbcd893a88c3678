"""Tests `slosh plc`, and the keys with which cell file and launch file start its node."""

import json
from datetime import datetime
from pathlib import Path

import pytest

from slosh_bringup.cli.main import main
from slosh_bringup.errors import SloshBringupError
from slosh_bringup.launched_cell import LaunchedCell
from slosh_bringup.live.cell_setup import read_setup
from slosh_plc.cell_state import REGISTERS, SIGNALS
from slosh_testing.live_processes import alive, free_port, live_process


def test_the_list_tells_each_value_with_its_address(capsys):
    assert main(["plc", "--list"]) == 0
    text = capsys.readouterr().out
    assert main(["plc", "--list", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert [row["name"] for row in rows] == [signal.name for signal in SIGNALS]
    assert all(row["name"] in text for row in rows)
    taken = [row["modbus"]["address"] + k for row in rows for k in range(row["modbus"]["count"])]
    assert taken == list(range(REGISTERS))
    assert {row["unit"] for row in rows} == {"m", "s", "1"}


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("/**: {plc: {ros__parameters: {opc_port: 1}}}", "opc_ua_port"),
        ("/**: {plk: {ros__parameters: {opc_ua_port: 1}}}", "no such node"),
    ],
)
def test_a_parameter_file_that_does_not_fit_is_refused(tmp_path, capsys, text, told):
    path = tmp_path / "plc.yaml"
    path.write_text(text)
    assert main(["plc", "--parameters", str(path)]) == 2
    said = capsys.readouterr().err
    assert told in said
    assert said.count("\n") == 1


def cell(tmp_path, line):
    (tmp_path / "model.yaml").write_text("")
    path = tmp_path / "cell.yaml"
    path.write_text(f"model: model.yaml\ncamera: none\n{line}\n")
    return read_setup(path)


@pytest.mark.parametrize(
    ("line", "there"), [("plc: true", True), ("plc: false", False), ("", False)]
)
def test_a_cell_file_starts_the_node(tmp_path, line, there):
    names = [one.name for one in cell(tmp_path, line).processes(Path("bag"))]
    assert ("plc" in names) == there


@pytest.mark.parametrize(("given", "there"), [({"plc": "true"}, True), ({}, False)])
def test_a_launch_starts_the_node(given, there):
    cell = LaunchedCell({"record": "false", **given}, datetime(2026, 11, 26), print)
    assert ("plc" in [process.name for process in cell.processes]) == there


def test_a_cell_file_says_yes_or_no(tmp_path):
    with pytest.raises(SloshBringupError, match=r"cell\.yaml:3: plc = 'opcua' must be true or"):
        cell(tmp_path, "plc: opcua")


def test_sigterm_ends_the_node_with_its_command(tmp_path):
    pytest.importorskip("pymodbus", reason="not installed (requirements/plc.txt)")
    file = tmp_path / "plc.yaml"
    values = f"{{opc_ua_port: 0, modbus_port: {free_port()}}}"
    file.write_text(f"/**: {{plc: {{ros__parameters: {values}}}}}\n")
    words = ("plc", "--parameters", str(file))
    with live_process(*words, output=tmp_path / "words") as plc:
        plc.wait_for(lambda: "Modbus TCP on" in plc.said, "the node")
        node = plc.nodes()["plc"]
        plc.process.terminate()
        assert plc.end() == 0
        assert not alive(node)
