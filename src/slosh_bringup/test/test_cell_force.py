"""Tests the simulated force sensor: weight, inertia, and a payload identified from it."""

import numpy as np
import pytest

from slosh_bringup.cell.force_sensor import ForceSensor, calibration_record, sensed_force
from slosh_bringup.cell.motions import CellMotion
from slosh_bringup.cell.truth import Push
from slosh_bringup.processes import config_folder
from slosh_discovery.force.workflow import identify_force
from slosh_model.model_text import read_model

PLAIN = ForceSensor(noise=0.0, drift=0.0, cable=0.0, zero=0.0, delay=0.0)
MODEL = read_model(config_folder() / "truth.yaml")
LIQUID = MODEL.container.volume * MODEL.liquid.density
MASS = PLAIN.container + LIQUID


def motion_of(acceleration):
    t = 0.001 * np.arange(len(acceleration))
    position = np.cumsum(np.cumsum(acceleration, axis=0), axis=0) * 1e-6
    return CellMotion("own", t, position, acceleration)


def test_at_rest_it_is_the_weight_and_all_that_spoils_it_is_added():
    still = motion_of(np.zeros((2000, 3)))
    force = sensed_force(MODEL, still, PLAIN, 1)
    assert force == pytest.approx(np.tile([0.0, 0.0, MASS * 9.81], (2000, 1)), abs=1e-9)
    spoilt = sensed_force(MODEL, still, PLAIN._replace(noise=0.1, zero=2.0), 1) - force
    assert spoilt.std() == pytest.approx(0.1, rel=0.1)
    assert spoilt.mean() == pytest.approx(2.0, abs=0.02)


def test_a_push_by_hand_is_felt_as_a_wave_and_not_as_a_thrust():
    still = motion_of(np.zeros((2000, 3)))
    force = sensed_force(MODEL, still, PLAIN._replace(turn=0.0), 1, Push(0.5, 0.1))
    sloshing = LIQUID * MODEL.container.mass_ratio(1)
    swing = 0.1 * MODEL.mode_frequency(1) * sloshing
    assert np.abs(force[:500, 0]).max() < 1e-9
    assert np.abs(force[700:, 0]).max() == pytest.approx(0.92 * swing, rel=0.1)  # it lasts


def test_thrust_and_delay():
    acceleration = np.zeros((2000, 3))
    acceleration[1000:1010, 0] = 5.0
    sensor = PLAIN._replace(turn=0.0, delay=0.1)
    force = sensed_force(MODEL, motion_of(acceleration), sensor, 1)[:, 0]
    assert np.abs(force[:1095]).max() < 1e-9
    frozen = MASS - LIQUID * MODEL.container.mass_ratio(1)
    assert force[1105] == pytest.approx(5.0 * frozen, rel=0.05)


@pytest.mark.long
def test_its_payload_is_identified():
    found = identify_force(calibration_record(MODEL, ForceSensor(), 2), MODEL)
    assert found.payload.value == pytest.approx(MASS, rel=0.03)
    assert found.delay.value == pytest.approx(0.02, abs=2e-3)
    assert found.natural_frequency.value == pytest.approx(MODEL.mode_frequency(1), rel=2e-3)
    assert len(found.directions) == 2
