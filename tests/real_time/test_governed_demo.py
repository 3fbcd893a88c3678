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
    # A slow machine stops more often, but never spills.
    assert 0.0 < governed["highest"] <= governed["limit"] < governed["ungoverned"]
    assert 0.1 < governed["distance"] < governed["commanded"]
    steps = replay["verified"]["governed_motion"]
    assert steps["recorded"] > 300
    assert steps["identical"] == steps["recorded"]
    told = any("samples were late or lost" in line for line in figures["problems"])
    assert told or governed["distance"] > 0.8 * governed["commanded"]


def test_a_force_sensor_and_a_governor_are_refused_together(tmp_path):
    words = ("demo", "--governor", "--force", "-o", str(tmp_path))
    done = subprocess.run(
        [sys.executable, "-m", "slosh_bringup.cli", *words],
        capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert "--governor and --force" in done.stderr
    assert not any(tmp_path.iterdir())
