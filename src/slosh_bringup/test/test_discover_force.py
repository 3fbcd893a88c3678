"""Tests `slosh discover` on heights that a sensor node made of a force."""

import json
from pathlib import Path

import numpy as np
import pytest

from slosh_bringup.cli.main import main
from slosh_discovery.discovering import read_all
from slosh_discovery.force.document import force_data
from slosh_discovery.force.workflow import identify_force
from slosh_estimator.sensed.force_surface import ForceSurface, Motion
from slosh_estimator.sensed.payload import parse_payload
from slosh_estimator.sensed.surface import wave_fields
from slosh_model.model import Model
from slosh_model.model_text import format_model
from slosh_model.shapes.cylinder import Cylinder
from slosh_report.text import json_text
from slosh_testing.cell_bag import CellBag
from slosh_testing.force_sensor import SimulatedSensor

CUP = Model(Cylinder(0.05, 0.07)).spatial().nonlinear()
DAMPING = 3.0
START = 10**9
STROKES = ((0.25, 0.8), (0.35, 0.95), (0.2, 0.6))
"""Length [m] and duration [s] of each motion."""


def write_bags(folder, strokes, rest):
    """Writes a bag of each stroke, as a cell with a force sensor records it."""
    damping = DAMPING * CUP.mode_constants()[0].damping_ratio
    payload, bags = None, []
    for number, (distance, duration) in enumerate(strokes):
        sensor = SimulatedSensor(
            CUP, CUP.mode_frequency(1), damping, distance=distance, duration=duration, rest=rest,
            seed=number,
        )  # fmt: skip
        record, bag = sensor.record(), CellBag()
        payload = payload or parse_payload(
            json_text(force_data(identify_force(record, CUP))), "payload"
        )
        surface, waves = ForceSurface(CUP, payload), []
        motion = (record.inputs.t.tolist(), record.inputs.acceleration.tolist())
        for t, (ax, ay, az) in zip(*motion, strict=True):
            stamp_ns = START + round(1e9 * t)
            bag.accel(stamp_ns, (ax, ay, az))
            waves += surface.take_motion(Motion(stamp_ns, ax, ay, 0.0))
        for t, force in zip(record.t.tolist(), record.force.tolist(), strict=True):
            waves += surface.take_force(START + round(1e9 * t), *force)
        for wave in waves:
            fields = wave_fields(wave, CUP.container.reaches[0])
            bag.surface(wave.stamp_ns, fields.pop("msh"), **fields)
        bags.append(str(bag.write(folder / f"bag{number}")))
    return bags


def test_heights_of_a_force_are_read_as_measured(tmp_path):
    bags = write_bags(tmp_path, STROKES[2:], 5.0)
    ((motion,),) = [read_all([Path(bag)], CUP, print, from_bag=False) for bag in bags]
    heights = motion.msh if motion.msh is not None else motion.eta
    assert np.isfinite(heights).sum() > 80
    assert 0.002 < np.nanmax(heights) < 0.03


@pytest.mark.long
def test_a_damping_that_the_model_lacks_is_found_by_the_force(tmp_path, capsys):
    bags = write_bags(tmp_path, STROKES, 8.0)
    model = tmp_path / "model.yaml"
    model.write_text(format_model(CUP))
    words = ["discover", *bags, "--model", str(model), "-o", str(tmp_path / "found"), "--json"]
    assert main([*words, "--jobs", "1"]) == 0
    document = json.loads(capsys.readouterr().out)
    (found,) = document["effects"]
    assert found["name"] == "damping_mismatch"
    assert found["parameters"]["factor"] == pytest.approx(DAMPING, rel=0.1)
