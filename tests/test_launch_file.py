"""Tests `ros2 launch` of cell.launch.py: the started nodes, and nodes that end."""

import os
import signal
from datetime import datetime

import pytest

from slosh_base.files.plain_text import plain_line
from slosh_bringup.launched_cell import LaunchedCell
from slosh_bringup.processes import LONGEST_PAUSE, known_nodes
from slosh_msgs_py.node.dead_ports import DeadPorts
from slosh_testing.launch_stand_in import Launch, Node, ParameterValue, read_launch_file

FORCE = __file__
"""A file that is there: the sensor node alone reads it."""
NOW = datetime(2026, 11, 25, 9, 30, 1)


@pytest.fixture
def launch(monkeypatch, tmp_path):
    """Returns a function that launches the cell in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONUNBUFFERED", "1")
    module = read_launch_file(monkeypatch)
    return lambda **arguments: Launch(module, tmp_path, **arguments)


@pytest.fixture
def described(monkeypatch, tmp_path):
    """Returns a function that lists the nodes of the launch file, with their parameters."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(Launch, "_start", lambda self, node: self.started.append(node))
    module = read_launch_file(monkeypatch)

    def describe(**arguments):
        started = Launch(module, tmp_path, **arguments).started
        return {node.name: (node, values(node)) for node in started}

    return describe


def values(node):
    """Returns the parameters that are set for a node itself."""
    own = node.parameters[-1].items()
    return {name: v.value if isinstance(v, ParameterValue) else v for name, v in own}


def test_the_default_cell(described, tmp_path):
    nodes = described()
    assert list(nodes) == ["recorder", "estimator", "camera", "monitor"]
    (run,) = (tmp_path / "out" / "cell").glob("2*")
    assert (tmp_path / "out" / "cell" / "latest").resolve() == run
    assert nodes["recorder"][1] == {"output": str(run / "bag")}
    assert nodes["estimator"][1]["model"].endswith("config/model.yaml")
    assert nodes["camera"][1]["calibration"].endswith("config/camera.yaml")
    assert nodes["monitor"][1] == {}
    for name, (node, _) in nodes.items():
        assert isinstance(node, Node)
        assert node.package == known_nodes()[name].partition(".")[0]
        assert node.namespace == "/slosh"
        assert node.parameters[0].endswith("config/cell.yaml")


def test_a_force_sensor_measures_beside_the_camera_or_in_its_place(described):
    nodes = described(force=FORCE)
    assert list(nodes) == ["recorder", "estimator", "camera", "sensor", "monitor"]
    assert nodes["sensor"][1] == {"payload": FORCE, "beside_camera": True}
    nodes = described(force=FORCE, camera="false")
    assert nodes["sensor"][1] == {"payload": FORCE, "beside_camera": False}
    assert nodes["monitor"][1] == {}
    assert described(camera="false")["monitor"][1] == {"camera": False}


def test_services_page_and_robot(described, tmp_path):
    nodes = described(
        record="false", predict="true", plan="1", watch="True", urdf="arm.urdf", tool_frame="cup",
        model="",
    )  # fmt: skip
    assert list(nodes)[3:] == ["predictor", "watch", "planner"]
    assert nodes["predictor"][1] == {
        "model": nodes["estimator"][1]["model"],
        "urdf": str(tmp_path / "arm.urdf"),
        "tool_frame": "cup",
    }


def test_a_node_of_an_add_on_that_is_switched_on(described):
    assert list(described(plc="true")) == [*described(), "plc"]
    with pytest.raises(ValueError, match="plc:=maybe: must be true or false"):
        LaunchedCell({"plc": "maybe"}, NOW, print)


def test_a_governor_of_commands_or_of_joints(described, tmp_path):
    nodes = described(govern="twist")
    assert list(nodes)[-1] == "governor"
    assert nodes["governor"][1] == {"model": nodes["estimator"][1]["model"], "command": "twist"}
    nodes = described(govern="joint_values", urdf="arm.urdf", tool_frame="cup")
    robot = {"urdf": str(tmp_path / "arm.urdf"), "tool_frame": "cup"}
    assert robot.items() <= nodes["governor"][1].items()
    with pytest.raises(ValueError, match=r"governor: command = 'spoon' must be one of twist"):
        LaunchedCell({"govern": "spoon"}, NOW, print)


@pytest.mark.parametrize(
    ("arguments", "waits", "readers"),
    [
        ({}, "recorder,estimator,camera,monitor", 2),
        ({"record": "false"}, "estimator,camera,monitor", 1),
        ({"record": "false", "camera": "0"}, "estimator,monitor", 0),
        ({"record": "false", "camera": "0", "force": FORCE}, "estimator,sensor,monitor", 0),
    ],
)
def test_the_simulated_cell_waits_for_those_that_are_started(described, arguments, waits, readers):
    cell = described(simulate="true", motion="e3", **arguments)["cell"][1]
    assert (cell["motion"], cell["wait_for"], cell["readers"]) == ("e3", waits, readers)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"force": "none.json"}, "force:=none.json: no such file"),
        ({"camera": "maybe"}, "camera:=maybe: must be true or false"),
        ({"input": "imuu"}, "estimator: input = 'imuu' must be one of accel, imu, pose"),
        ({"remap": "{imuu: /arm/imu}"}, "remap: no such topic: 'imuu' (known: accel, imu,"),
        ({"remap": "[imu"}, "remap:=[imu: launch arguments:"),
        ({"remap": "imu:=/arm/imu"}, "remap must map topic names to topic names"),
        ({"namespace": "slosh"}, "namespace = 'slosh' must start with a slash"),
        ({"urdf": "arm.urdf"}, "urdf:=, tool_frame:= and predict:=true must be given together"),
        ({"model": "none.yaml"}, "none.yaml: No such file or directory"),
        ({"calibration": "none.yaml"}, "none.yaml: cannot be read: No such file or directory"),
        ({"parameters": "none.yaml"}, "none.yaml: No such file or directory"),
    ],
)
def test_a_wrong_argument_is_one_line_and_starts_nothing(launch, tmp_path, arguments, said):
    with launch(**arguments) as cell:
        (line,) = cell.said
        assert said in line
        assert plain_line(line) == line
        assert (cell.exit_code, cell.started) == (1, [])
    assert not (tmp_path / "out").exists()


def ended(cell, name, code, times):
    return [cell.ended(name, code, at) for at in times]


def test_a_node_that_ends_again_and_again_is_started_later_each_time(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    closed = []
    monkeypatch.setattr(DeadPorts, "look", lambda self, **given: closed.append(given))
    cell = LaunchedCell({}, NOW, print)
    first, *others = ended(cell, "estimator", -9, [0.0, 2.0, 5.0, 12.0, 25.0, 45.0])
    assert [first.delay, *(one.delay for one in others)] == [1, 2, 4, 8, 16, LONGEST_PAUSE]
    assert first.process.parameters["starts_at_rest"] == "false"
    assert first.text == "node estimator ended with exit code -9; it is restarted in 1 s"
    assert cell.ended("estimator", -9, 1000.0).delay == 1.0
    killed = len(closed)
    assert closed == [{"close": True}] * 7
    assert cell.ended("monitor", 1, 1000.0).delay == 1.0
    assert len(closed) == killed  # it has closed them itself


def test_a_recorder_that_is_started_again_leaves_what_is_recorded(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    cell = LaunchedCell({}, NOW, print)
    bag = cell.processes[0].parameters["output"]
    again = ended(cell, "recorder", 1, [0.0, 100.0])
    assert [one.process.parameters["output"] for one in again] == [f"{bag}_2", f"{bag}_3"]
    assert again[0].text.endswith(f"in 1 s, recording to {bag}_2")


def bags(tmp_path):
    """Returns the bags that are being recorded, by run."""
    return sorted(path.parent for path in tmp_path.glob("out/cell/2*/bag*/*.mcap"))


def test_each_launch_records_and_a_killed_recorder_goes_on(launch, tmp_path):
    (tmp_path / "parameters.yaml").write_text(
        "/**: {monitor: {ros__parameters: {measured_limit: 1, hold: 2}}}"
    )
    given = {"parameters": "parameters.yaml", "camera": "false"}
    with launch(**given) as cell:
        cell.until(lambda: len(bags(tmp_path)) == 1)
        os.kill(cell.nodes["recorder"][1].pid, signal.SIGKILL)
        cell.until(lambda: len(bags(tmp_path)) == 2)
        assert [path.name for path in bags(tmp_path)] == ["bag", "bag_2"]
        assert any("node recorder ended with exit code -9" in line for line in cell.said)
        assert cell.shut_down() == {"recorder": 0, "estimator": 0, "monitor": 0}
        assert cell.exit_code == 0
    with launch(**given) as cell:
        cell.until(lambda: len(bags(tmp_path)) == 3)
    assert len(list(tmp_path.glob("out/cell/2*"))) == 2


@pytest.mark.long
def test_a_node_that_refuses_its_parameters_ends_the_launch(launch, tmp_path):
    (tmp_path / "parameters.yaml").write_text(
        "/**: {monitor: {ros__parameters: {measured_limit: much}}}"
    )
    with launch(parameters="parameters.yaml", camera="false", record="false") as cell:
        cell.until(lambda: not cell.nodes)
        assert "node monitor refuses its parameters or files (exit code 2)" in cell.said[-1]
        assert (cell.exit_code, len(cell.started)) == (1, 2)
    said = (tmp_path / "monitor.log").read_text()
    assert "measured_limit = 'much': type double is needed, not string" in said
