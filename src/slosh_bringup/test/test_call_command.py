"""Tests `slosh call` and `slosh node`: services and nodes on machines without `ros2`."""

import json
import subprocess
import sys

import pytest
import rclpy
from std_srvs.srv import Trigger

from slosh_bringup.cli.main import main
from slosh_bringup.processes import NodeProcess
from slosh_msgs.srv import ChangeContainer
from slosh_testing.hearing_robot import Graph

CELL = "/here"
ASKED = []


@pytest.fixture(scope="module")
def graph():
    rclpy.init()
    made = Graph(namespace=CELL)
    ASKED.clear()

    def change(request, response):
        ASKED.append(request)
        response.success, response.message = request.name == "mug", "changed: ä"
        return response

    def reset(_, response):
        response.success = True
        return response

    made.node.create_service(ChangeContainer, "change", change)
    made.node.create_service(Trigger, "reset", reset)
    yield made
    made.close()
    rclpy.try_shutdown()


def called(graph, *words):
    """Runs `slosh call` beside the graph; returns exit code, output and errors."""
    command = [sys.executable, "-m", "slosh_bringup.cli", "call", "--namespace", CELL, *words]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    graph.until(lambda: process.poll() is not None, "the end of slosh call")
    said, errors = process.communicate()
    return process.returncode, said, errors


def test_a_service_is_called_with_its_fields(graph):
    code, said, errors = called(graph, "change", "name: mug", "limit: 1", "standing: [1, 2, 3, 4]")
    assert (code, said, errors) == (0, "success: true\nmessage: 'changed: ä'\n", "")
    request = ASKED[-1]
    assert (request.name, request.limit, list(request.standing)) == ("mug", 1.0, [1, 2, 3, 4])
    code, said, _ = called(graph, f"{CELL}/change", "{name: cup, limit: 0.01}", "--json")
    assert code == 1
    assert json.loads(said) == {"success": False, "message": "changed: ä"}
    assert called(graph, "reset")[:2] == (0, "success: true\nmessage: ''\n")
    set_one = "parameters: [{name: x, value: {type: 3, double_value: 0.5}}]"
    name = f"{graph.node.get_name()}/set_parameters"
    assert called(graph, name, set_one)[0] == 1  # the node has no such parameter


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["rset", "--wait", "2"], "no such service within 2 s"),
        (["change", "nme: mug"], "nme: there is no such field; did you mean name?"),
        (["change", "limit: high"], "limit: 'high' is not a number"),
        (["/nowhere/at_all", "--wait", "0.1"], "is its node running"),
    ],
)
def test_what_cannot_be_called_is_one_line(graph, words, told):
    before = len(ASKED)
    code, said, errors = called(graph, *words)
    assert (code, said, len(errors.splitlines()), len(ASKED)) == (2, "", 1, before)
    assert told in errors


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["call", "reset", "now"], "'now': is no field; write 'name: value', in quotes"),
        (["call", "reset", "a: 1", "a: 2"], "a: is given twice"),
        (["call", "reset", "{a: 1"], "FIELD"),
        (["node", "estimater"], "did you mean estimator?"),
        (["node", "estimator", "-p", "model"], "-p 'model': must be NAME:=VALUE"),
        (["node", "estimator", "-r", ":=/imu"], "-r ':=/imu': must be NAME:=VALUE"),
        (["node", "estimator", "--params-file", "none.yaml"], "none.yaml: there is no such"),
    ],
)
def test_a_wrong_command_line_is_one_line(words, told, capsys):
    try:
        code = main(words)
    except SystemExit as error:
        code = error.code
    errors = capsys.readouterr().err
    assert (code, len(errors.splitlines())) == (2, 1)
    assert told in errors


def test_a_node_gets_what_is_given(monkeypatch, tmp_path):
    started = []
    monkeypatch.setattr(
        "slosh_bringup.cli.node.run_until_stopped", lambda *given: started.append(given) or 3
    )
    file = tmp_path / "parameters.yaml"
    file.touch()
    words = ["-p", "model:=a:=b.yaml", "-p", "limit:=0.01", "-r", "imu:=/arm/imu"]
    assert main(["node", "predictor", *words, "--params-file", str(file)]) == 3
    parameters = {"model": "a:=b.yaml", "limit": "0.01"}
    process = NodeProcess("predictor", [file], parameters, {"imu": "/arm/imu"})
    assert started == [(process, "/slosh")]


def test_a_node_that_refuses_its_parameters_ends_with_2():
    command = [sys.executable, "-m", "slosh_bringup.cli", "node", "monitor"]
    done = subprocess.run(
        [*command, "-p", "timeout:=-1.0"], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 2
    assert "timeout" in done.stderr
