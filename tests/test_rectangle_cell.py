"""Tests a rectangular tank with a camera over DDS: measured, estimated and replayed."""

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from slosh_bringup.processes import node_environment
from slosh_model import Model, format_model
from slosh_testing.journaled import assert_same_by_journal, replayed_by_journal
from slosh_testing.live_processes import live_process
from tests.rectangle_robot import TANK, write_camera

ROBOT = (sys.executable, Path(__file__).with_name("rectangle_robot.py"))
pytestmark = pytest.mark.timeout(200)


@pytest.fixture(scope="module")
def run(domain, tmp_path_factory):
    """Runs the cell; returns the folder of the run and the printed output."""
    folder = tmp_path_factory.mktemp("tank")
    (folder / "model.yaml").write_text(format_model(Model(TANK, damping_ratio=0.03)))
    write_camera(folder / "camera.yaml")
    path = folder / "cell.yaml"
    path.write_text(yaml.safe_dump({"model": "model.yaml", "calibration": "camera.yaml"}))
    words = ("cell", "--config", str(path), "-o", str(folder / "out"))
    with live_process(*words, output=folder / "words") as running:
        running.wait_for_nodes(4)
        robot = subprocess.Popen(ROBOT, env=node_environment(domain))
        try:
            running.wait_for(lambda: robot.poll() is not None, "the motion's end")
        finally:
            robot.kill()
            robot.wait()
        running.process.send_signal(signal.SIGINT)
        running.end()
        said = running.said
    return folder / "out" / "latest", said


@pytest.mark.long
def test_the_pendulum_and_the_camera_agree(run):
    folder, said = run
    result = json.loads((folder / "result.json").read_text())
    assert "width 80 mm, depth 40 mm, filled to 60 mm; no effects" in said
    rows = {row["name"]: row for row in result["agreements"]}
    assert rows["2D-NL / camera"]["sigma"] < 0.2e-3, rows
    assert rows["2D-L / camera"]["sigma"] > rows["2D-NL / camera"]["sigma"]


@pytest.mark.long
def test_its_bag_replays_bit_for_bit(run):
    folder, _ = run
    assert_same_by_journal(folder / "bag")
    result = replayed_by_journal(folder / "bag")
    assert result.model.container == TANK
    assert result.verification.exact, result.verification.lines()
    assert result.comparisons.exact, result.comparisons.lines()
