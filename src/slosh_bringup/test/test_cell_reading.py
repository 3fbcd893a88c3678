"""Tests how cell files and launch arguments describe the robot."""

from datetime import datetime
from pathlib import Path

import pytest

from slosh_bringup.cli.main import main
from slosh_bringup.errors import SloshBringupError
from slosh_bringup.launched_cell import LaunchedCell
from slosh_bringup.live.cell_setup import read_setup
from slosh_motion.inputs.robot import available

URDF = Path(__file__).resolve().parents[3] / "examples" / "robot.urdf"
CUP = ["--diameter", "0.08", "--fill-height", "0.06", "--no-camera"]
needs_pinocchio = pytest.mark.skipif(
    not available(), reason="no Pinocchio (requirements/joints.txt)"
)


def estimator(setup):
    (found,) = (one for one in setup.processes(Path("bag")) if one.name == "estimator")
    return found.parameters


@needs_pinocchio
def test_new_writes_a_cell_that_reads_the_robots_joints(tmp_path, capsys):
    folder = tmp_path / "jug"
    robot = ["--urdf", str(URDF), "--tool-frame", "cup"]
    assert main(["new", str(folder), *CUP, *robot]) == 0
    found = estimator(read_setup(folder / "cell.yaml"))
    assert (found["input"], found["tool_frame"]) == ("joints", "cup")
    assert Path(found["urdf"]).samefile(URDF)
    assert main(["new", str(tmp_path / "other"), *CUP, *robot[:3], "spoon"]) == 2
    assert "no link 'spoon'" in capsys.readouterr().err


def test_new_needs_both_options(tmp_path, capsys):
    assert main(["new", str(tmp_path / "jug"), *CUP, "--tool-frame", "cup"]) == 2
    assert "--urdf and --tool-frame must be given together" in capsys.readouterr().err
    assert main(["new", str(tmp_path / "jug"), *CUP]) == 0
    assert "input" not in estimator(read_setup(tmp_path / "jug" / "cell.yaml"))


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("input: gyro", "cell.yaml:3: input = 'gyro' must be accel, imu, pose, joints"),
        ("urdf: nowhere.urdf", "cell.yaml:3: urdf: no such file"),
        ("tool_frame: 7", "cell.yaml:3: tool_frame = 7 must be a text"),
        ("remap: {joints: /arm/joint_states}", "no such topic: 'joints'"),
    ],
)
def test_what_does_not_fit_is_refused_with_its_line(tmp_path, line, told):
    path = tmp_path / "cell.yaml"
    (tmp_path / "model.yaml").write_text("")
    path.write_text(f"model: model.yaml\ncamera: none\n{line}\n")
    with pytest.raises(SloshBringupError) as caught:
        read_setup(path)
    assert told in str(caught.value)


@pytest.mark.parametrize("name", ["joint_states", "/joint_states"])
def test_topics_of_the_whole_graph_are_remapped_with_and_without_a_slash(tmp_path, name):
    (tmp_path / "model.yaml").write_text("")
    path = tmp_path / "cell.yaml"
    path.write_text(f"model: model.yaml\ncamera: none\nremap: {{{name}: /arm/states}}\n")
    assert read_setup(path).remap == {"/joint_states": "/arm/states"}


def test_a_launch_hands_the_robot_to_the_estimator(tmp_path):
    given = {
        "input": "joints", "urdf": str(URDF), "tool_frame": "cup", "camera": "false",
        "output": str(tmp_path),
    }  # fmt: skip
    cell = LaunchedCell(given, datetime(2026, 1, 1), print)
    (found,) = (one for one in cell.processes if one.name == "estimator")
    assert found.parameters["input"] == "joints"
    assert found.parameters["tool_frame"] == "cup"
    assert Path(found.parameters["urdf"]).samefile(URDF)


def test_a_cell_may_record_events_alone(tmp_path):
    assert main(["new", str(tmp_path / "jug"), *CUP]) == 0
    path = tmp_path / "jug" / "cell.yaml"
    text = path.read_text()
    path.write_text(text + "\nrecord: events\n")
    processes = {process.name: process for process in read_setup(path).processes(Path("bag"))}
    assert processes["recorder"].parameters["mode"] == "events"
    path.write_text(text + "\nrecord: event\n")
    with pytest.raises(SloshBringupError, match="record = 'event' must be complete or events"):
        read_setup(path)


def test_a_cell_names_the_store_of_its_motions(tmp_path):
    (tmp_path / "model.yaml").write_text("container: {shape: cylinder, radius: 1, fill_height: 1}")
    path = tmp_path / "cell.yaml"

    def parameters(line):
        path.write_text(f"model: model.yaml\ncamera: none\n{line}\n")
        return read_setup(path).processes(Path("bag"))[0].parameters

    assert parameters("store_motions: motions")["store_motions"] == str(tmp_path / "motions")
    assert parameters("store_motions: s3://a/b")["store_motions"] == "s3://a/b"
    assert "store_motions" not in parameters("")
    with pytest.raises(SloshBringupError, match=r"store_motions = 3 must be a folder or a URL"):
        parameters("store_motions: 3")
