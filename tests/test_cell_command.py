"""Tests `slosh cell` on a robot's topics: inputs, missing inputs and exit codes."""

import json
import os
import signal
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import yaml

from slosh_bag.errors import SloshBagError
from slosh_bag.reader import BagReader
from slosh_bringup.processes import config_folder
from slosh_bringup.watch.recording import RecordedFrames
from slosh_motion.tables.motion_table import MotionTable, write_motion_table
from slosh_msgs.msg import SloshEstimate
from slosh_replay.in_force import in_force, last_starts
from slosh_replay.recorded_run import RecordedRun
from slosh_testing.journaled import replayed_by_journal
from slosh_testing.live_processes import live_process, recorded, robot

BAG = Path(__file__).resolve().parents[1] / "bags" / "l"
SETTLING = SloshEstimate.SETTLING
SETTLES = "estimator: validity flags 0x10"
SLOW = {"rate": "250.0", "fps": "20.0"}
"""Samples and images of the robot: nothing here is about pace."""
pytestmark = pytest.mark.timeout(200)


@pytest.fixture
def write_cell(tmp_path):
    """Returns a function that writes a cell file; given keys replace those of the shipped one."""

    def write(**keys):
        config = config_folder()
        document = {
            "model": str(config / "model.yaml"),
            "calibration": str(config / "camera.yaml"),
        }
        path = tmp_path / "robot.yaml"
        path.write_text(yaml.safe_dump({**document, **keys}))
        return path

    return write


@contextmanager
def cell(tmp_path, path):
    """Runs `slosh cell` with a cell file; the results are in tmp_path/out."""
    words = ("cell", "--config", str(path), "-o", str(tmp_path / "out"))
    with live_process(*words, output=tmp_path / "words") as running:
        running.wait_for_nodes(4)
        yield running


@contextmanager
def moving_cell(domain, tmp_path, path):
    """Runs `slosh cell` beside a moving robot; waits for estimates of a known state."""
    with cell(tmp_path, path) as running, robot(domain, **SLOW, motion="l", repeat="20"):
        bag = tmp_path / "out" / "latest" / "bag"
        running.wait_for(lambda: holds(bag, 0), "estimates that are settled")
        yield running


def push_beyond_the_limit(folder):
    """Writes a motion table of one second that raises the liquid by 30 mm."""
    t = np.arange(0.0, 1.0, 0.002)
    push = np.stack((1.0 * np.sin(17.0 * t), 0.0 * t, 0.0 * t), axis=1)
    write_motion_table(folder / "push.csv", MotionTable(t, push))
    return folder / "push.csv"


@pytest.mark.long
def test_a_file_with_two_parameters_keeps_the_limits_and_the_cell_says_so(
    domain, tmp_path, write_cell
):
    parameters = tmp_path / "two.yaml"
    parameters.write_text(
        "/**/estimator: {ros__parameters: {max_gap: 0.04}}\n"
        "/slosh/monitor: {ros__parameters: {warn_share: 0.7}}\n"
    )
    path = write_cell(parameters="two.yaml")
    folder = tmp_path / "out" / "latest"
    with (
        cell(tmp_path, path) as running,
        robot(domain, **SLOW, motion=str(push_beyond_the_limit(tmp_path))) as source,
    ):
        running.wait_for(lambda: source.poll() is not None, "the motion's end")
        running.process.send_signal(signal.SIGINT)
        assert running.end() == 0, running.said
    assert (
        "limits              measured 20 mm, estimated 20 mm, disagreement 10 mm" in running.said
    )
    result = json.loads((folder / "result.json").read_text())
    assert len(result["events"]) >= 1
    kept = yaml.safe_load((folder / "settings.yaml").read_text())
    assert kept["monitor"]["parameters"]["measured_limit"] == 0.02
    assert kept["monitor"]["parameters"]["warn_share"] == 0.7
    assert kept["estimator"]["parameters"]["max_gap"] == 0.04
    assert kept["estimator"]["topics"]["accel"] == "/slosh/accel"
    assert "radius" in kept["estimator"]["files"]["model"]
    recorded = in_force(last_starts(RecordedRun(folder / "bag")))
    assert recorded == result["in_force"]
    for label, text in recorded.items():
        assert f"{label:<20}{text}" in running.said
    assert str((config_folder() / "camera.yaml").resolve()) in recorded["calibration"]


@pytest.mark.long
def test_a_cell_without_input_says_so_and_ends_with_a_report(domain, tmp_path, write_cell):
    path = write_cell(remap={"accel": "/arm/acceleration"})
    folder = tmp_path / "out" / "latest"
    with cell(tmp_path, path) as running:
        for said in (
            "estimator: no usable input for ",
            "/arm/acceleration has no publisher",
            "camera: no image for ",
            "/slosh/camera/image_raw has no publisher",
            "monitor: STALE: no free_surface and no estimate",
        ):
            running.wait_for(lambda said=said: said in running.said, said)
        running.process.terminate()
        assert running.end() == 1
    reasons = [
        "no messages received on /arm/acceleration, the input of the models",
        "no images received on /slosh/camera/image_raw",
    ]
    assert f"slosh cell: nothing was measured, because {'; '.join(reasons)}" in running.said
    assert "Traceback" not in running.said
    assert json.loads((folder / "result.json").read_text())["nothing_because"] == reasons
    assert reasons[0] in (folder / "report.html").read_text()


@pytest.mark.long
def test_a_recording_that_is_played_without_its_clock_is_recognised(domain, tmp_path, write_cell):
    """Its stamps are those of the day when it was recorded."""
    path = write_cell()
    with cell(tmp_path, path) as running:
        running.wait_for(lambda: "/slosh/accel has no publisher" in running.said, "the estimator")
        play = [
            sys.executable,
            "-m",
            "slosh_bringup.cli",
            "play",
            str(BAG),
            "--inputs",
            "--rate",
            "10",
            "--loop",
        ]
        with subprocess.Popen(play, stderr=subprocess.DEVNULL) as player:
            try:
                stale = "are stale: their stamps are older than max_age"
                running.wait_for(lambda: stale in running.said, stale)
                running.process.terminate()
                assert running.end() == 1
            finally:
                player.terminate()
    assert "messages received on /slosh/accel, but none could be used: stale " in running.said
    assert "s behind this machine's clock" in running.said


@pytest.mark.long
def test_a_cell_goes_on_when_its_nodes_are_killed(domain, tmp_path, write_cell):
    """Each is started again; the recorder into a bag of its own, so that the first one stays."""
    folder = tmp_path / "out" / "latest"
    with moving_cell(domain, tmp_path, write_cell()) as running:
        before = dict(running.nodes())
        for name in ("recorder", "estimator"):
            os.kill(before[name], signal.SIGKILL)
        killed = {name: before[name] for name in ("recorder", "estimator")}
        running.wait_for(
            lambda: all(running.nodes()[name] != pid for name, pid in killed.items()),
            "others in their place",
        )
        running.wait_for(lambda: SETTLES in running.said, SETTLES)
        running.wait_for_recording(folder / "bag_2", recorded(folder / "bag_2") + 100_000)
        # On a busy machine the two new ones take longer to find each other.
        running.wait_for(lambda: holds(folder / "bag_2", SETTLING), "estimates that settle")
        running.process.terminate()
        assert running.end() == 1
    ends = [f"node {name} ended with exit code -9: " for name in ("estimator", "recorder")]
    for end in ends:
        assert end in running.said
        assert end in (folder / "report.html").read_text()
        assert end in json.loads((folder / "result.json").read_text())["problems"][0]
    assert f"it is restarted, recording to {folder.resolve() / 'bag_2'}" in running.said
    assert estimates_of(folder / "bag")[0].flags & SETTLING == 0
    assert holds(folder / "bag_2", SETTLING)
    verification = replayed_by_journal(folder / "bag").verification
    assert verification.exact, verification.lines()


@pytest.mark.long
def test_a_node_that_was_stopped_and_goes_on_is_told_and_settles(domain, tmp_path, write_cell):
    """The recording knows of the pause, and so do replay and report."""
    folder = tmp_path / "out" / "latest"
    with moving_cell(domain, tmp_path, write_cell()) as running:
        estimator = running.nodes()["estimator"]
        os.kill(estimator, signal.SIGSTOP)
        running.wait_for(lambda: "no estimate" in running.said, "the monitor's word")
        running.wait_for(lambda: "estimator: no diagnostics for" in running.said, "silence")
        os.kill(estimator, signal.SIGCONT)
        running.wait_for(lambda: SETTLES in running.said, SETTLES)
        running.process.terminate()
        running.end()
    result = json.loads((folder / "result.json").read_text())
    assert not result["nothing_because"], running.said
    estimates = estimates_of(folder / "bag")
    stamps = np.array(
        [one.header.stamp.sec + 1e-9 * one.header.stamp.nanosec for one in estimates]
    )
    pause = int(np.argmax(np.diff(stamps)))
    assert stamps[pause + 1] - stamps[pause] > 2.0
    assert estimates[pause].flags & SETTLING == 0
    assert estimates[pause + 1].flags & SETTLING
    verification = replayed_by_journal(folder / "bag").verification
    assert verification.exact, verification.lines()


def holds(bag, settling):
    """Returns whether a bag has an estimate with the given settling flag (0: not set)."""
    try:
        return any(message.flags & SETTLING == settling for message in estimates_of(bag))
    except SloshBagError:
        return False  # not a chunk is in it yet


def estimates_of(bag):
    """Returns the estimates in a bag."""
    reader = BagReader(bag)
    return [reader.decode(message) for message in reader.messages(["/slosh/estimate"])]


def test_a_node_that_refuses_its_parameters_ends_the_cell_with_its_words(
    domain, tmp_path, write_cell
):
    (tmp_path / "bad.yaml").write_text("/**/monitor: {ros__parameters: {measured_limit: high}}")
    folder = tmp_path / "out" / "latest"
    words = ("cell", "--config", str(write_cell(parameters="bad.yaml")), "-o", str(folder.parent))
    with live_process(*words, output=tmp_path / "words") as running:
        assert running.end() == 2
    assert "measured_limit = 'high': type double is needed, not string" in running.said
    assert "no message came" not in running.said
    assert "measured_limit" in (folder / "report.html").read_text()


@pytest.mark.long
@pytest.mark.parametrize("said", [pytest.param("nothing", marks=pytest.mark.long), "camera: none"])
def test_a_cell_without_a_camera_is_a_whole_cell(domain, tmp_path, said):
    """No camera node, no alarm, an event of the estimate, a report, a replay and a page."""
    text = f"model: {config_folder() / 'model.yaml'}\n"
    if said != "nothing":
        text += f"calibration: {config_folder() / 'camera.yaml'}\n{said}\n"
    (tmp_path / "robot.yaml").write_text(text)
    folder = tmp_path / "out" / "latest"
    words = ("cell", "--config", str(tmp_path / "robot.yaml"), "-o", str(tmp_path / "out"))
    simulated = {"rate": "250.0", "fps": "5.0", "readers": "0", "repeat": "20"}
    with live_process(*words, output=tmp_path / "words") as running:
        running.wait_for_nodes(3)
        with robot(domain, **simulated, motion=str(push_beyond_the_limit(tmp_path))):
            exceeded = "monitor: ERROR; no camera configured"
            running.wait_for(lambda: exceeded in running.said, exceeded)
        running.process.send_signal(signal.SIGINT)
        assert running.end() == 0, running.said
    assert running.nodes().keys() == {"recorder", "estimator", "monitor"}
    assert "camera              none configured: only the estimate is monitored" in running.said
    assert "nothing was measured" not in running.said
    assert "no image" not in running.said
    result = json.loads((folder / "result.json").read_text())
    assert result["nothing_because"] == []
    assert result["events"]
    page = (folder / "report.html").read_text()
    assert "there is nothing to compare the models with" not in page
    assert "highest estimated" in page
    replayed = replayed_by_journal(folder / "bag")
    assert replayed.verification.exact, replayed.verification.lines()
    assert {event.source.name for event in replayed.events} == {"ESTIMATED"}
    assert len(replayed.stamps) > 50  # what the page draws
    assert np.isfinite(replayed.heights["3D-NL"]).all()
    frames = [json.loads(frame) for frame in RecordedFrames(folder / "bag").frames]
    assert "limit exceeded" in {frame["verdict"] for frame in frames}
    # Blind is the page without estimates alone, never for want of images.
    blind = {frame["reason"] for frame in frames if frame["verdict"] == "blind"}
    # Before the monitor's first message, too, on a busy machine.
    monitor = "no comparison received yet: is the monitor running?"
    assert blind <= {"no messages from the estimator", monitor}
    safe = {frame["reason"] for frame in frames if frame["verdict"] == "safe"}
    assert safe <= {"estimated below its limit; no camera configured"}
