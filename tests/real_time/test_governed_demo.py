"""Tests `slosh demo --governor`: commands, governor and simulated cell as processes over DDS."""

import json
import os
import subprocess
import sys

import pytest


@pytest.mark.long
@pytest.mark.timeout(300)
def test_it_moves_below_the_limit_and_is_replayed_bit_for_bit(tmp_path):
    environment = {name: value for name, value in os.environ.items() if name != "ROS_DOMAIN_ID"}
    words = ("demo", "--governor", "--motion", "c", "--json", "-o", str(tmp_path))
    done = subprocess.run(
        [sys.executable, "-m", "slosh_bringup.cli", *words],
        capture_output=True, text=True, timeout=250, check=False, env=environment,
    )  # fmt: skip
    figures = json.loads(done.stdout)
    governed, replay = figures["governed"], figures["replay"]
    assert governed["limit"] == 0.02
    assert governed["limit"] < governed["ungoverned"]
    assert governed["distance"] > 0.1
    # The governor cannot hold a limit by late steps; a slow machine is told.
    on_time = governed["late"] + governed["lost"] == 0
    assert governed["highest"] <= governed["limit"] or not on_time
    steps = replay["governed_motion"]
    assert steps["recorded"] > 300
    assert steps["identical"] == steps["recorded"]
    assert governed["distance"] > 0.8 * governed["commanded"] or not on_time


def test_a_force_sensor_and_a_governor_are_refused_together(tmp_path):
    words = ("demo", "--governor", "--force", "-o", str(tmp_path))
    done = subprocess.run(
        [sys.executable, "-m", "slosh_bringup.cli", *words],
        capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert "--governor and --force" in done.stderr
    assert not any(tmp_path.iterdir())
