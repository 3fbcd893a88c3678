"""Tests the identification from force: recovered parameters, and errors for bad records."""

import math
from dataclasses import replace

import numpy as np
import pytest

from slosh_discovery.errors import SloshDiscoveryError
from slosh_discovery.force.result import likely_unit
from slosh_discovery.force.workflow import identify_force
from slosh_estimator.sensed.payload import UNITS
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.shapes.rectangle import Rectangle
from slosh_model.simulate import Inputs
from slosh_testing.force_sensor import SimulatedSensor, drawn_sensor

CUP = Model(Cylinder(0.05, 0.07))
FLIPPED = ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
TRUTH = SimulatedSensor(
    CUP, 1.02 * CUP.mode_frequency(1), 0.007, payload=1.7, delay=0.03, axes=FLIPPED, cable=0.1,
    drift=0.03, ringing=0.05,
)  # fmt: skip


@pytest.fixture(scope="module")
def record():
    return TRUTH.record()


def check(found, truth):
    assert found.natural_frequency.value == pytest.approx(truth.frequency, rel=0.002)
    assert found.damping_ratio.value == pytest.approx(truth.damping, rel=0.08)
    assert found.sloshing_mass.value == pytest.approx(truth.mass, rel=0.03)
    assert found.payload.value == pytest.approx(truth.payload, rel=0.03)
    assert found.delay.value == pytest.approx(truth.delay, abs=0.002)


def test_finds_mode_mass_delay_and_the_sensors_axes(record):
    found = identify_force(record, CUP)
    check(found, TRUTH)
    ((along, sensor),) = found.directions
    assert along == pytest.approx([1.0, 0.0, 0.0], abs=0.01)
    assert sensor == pytest.approx([0.0, 1.0, 0.0], abs=0.03)  # +x of the container is fy
    assert abs(found.natural_frequency.value - TRUTH.frequency) < 3 * found.natural_frequency.error
    assert "across it" in found.unobserved
    assert found.unit == "N"


@pytest.mark.long
@pytest.mark.parametrize("seed", [101, 103, 105])
def test_finds_drawn_cups_and_sensors(seed):
    truth = drawn_sensor(seed)
    found = identify_force(truth.record(), truth.model)
    assert found.natural_frequency.value == pytest.approx(truth.frequency, rel=0.01)
    assert found.damping_ratio.value == pytest.approx(truth.damping, rel=0.15)
    assert found.sloshing_mass.value == pytest.approx(truth.mass, rel=0.05)


@pytest.mark.long
def test_a_rectangles_mode_is_that_of_its_moved_side():
    tank = Model(Rectangle(0.12, 0.08, 0.06))
    turned = replace(TRUTH, model=tank, frequency=tank.mode_frequency(1), distance=0.05, cable=0.0)
    check(identify_force(turned.record(), tank), turned)


def test_a_wrong_unit_is_read_rightly_and_named(record):
    found = identify_force(replace(record, force=record.force / 9.80665), CUP)
    check(found, TRUTH)
    assert found.unit == "kgf"
    assert "kgf" in found.notes[-1]


@pytest.mark.parametrize("unit", UNITS)
def test_units_are_told_by_the_sloshing_mass(unit):
    assert likely_unit(0.97 * 0.17 / UNITS[unit], 0.17) == unit


def test_an_odd_mass_is_left_as_it_is():
    assert likely_unit(0.4, 0.17) == "N"


def refused(record, model=CUP):
    with pytest.raises(SloshDiscoveryError) as caught:
        identify_force(record, model)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_records_that_tell_nothing_are_refused_in_a_line(record):
    t = record.inputs.t
    still = replace(record, inputs=Inputs(t, np.zeros((len(t), 3))))
    assert "does not move" in refused(still)
    assert "never changes" in refused(replace(record, force=0.0 * record.force + 1.0))
    assert "no numbers" in refused(replace(record, force=np.nan * record.force))
    assert "overlap" in refused(replace(record, t=record.t + 1000.0))
    noise = np.random.default_rng(1).normal(size=record.force.shape)
    assert "does not follow" in refused(replace(record, force=noise))
    tilt = np.column_stack([np.sin(0.4 * np.sin(t)), 0 * t, 0 * t, np.cos(0.4 * np.sin(t))])
    tilted = Inputs(t, record.inputs.acceleration, tilt)
    assert "tilts" in refused(replace(record, inputs=tilted))


def test_a_payload_without_liquid_is_refused(record):
    force = np.column_stack([
        np.interp(record.t, record.inputs.t, 1.5 * a) for a in record.inputs.acceleration.T
    ])  # fmt: skip
    noise = 0.02 * np.random.default_rng(1).normal(size=force.shape)
    assert "no sloshing force" in refused(replace(record, force=force + noise))


def test_gaps_numbers_that_are_none_and_saturation_are_left_out_and_told(record):
    force, keep = record.force.copy(), np.ones(len(record.t), dtype=bool)
    force[:, 1] = np.minimum(force[:, 1], 0.8 * force[:, 1].max())
    force[1000:1010] = math.nan
    keep[2500:2650] = False
    found = identify_force(replace(record, t=record.t[keep], force=force[keep]), CUP)
    check(found, replace(TRUTH, payload=found.payload.value))
    told = " ".join(found.notes)
    assert "10 forces" in told
    assert "gaps in the force" in told
    assert "saturated" in told


def test_times_that_go_back_are_sorted_and_told(record):
    order = np.arange(len(record.t))
    order[[500, 501]] = order[[501, 500]]
    found = identify_force(replace(record, t=record.t[order], force=record.force[order]), CUP)
    check(found, TRUTH)
    assert "go back" in found.notes[0]


def every(record, step):
    return replace(record, t=record.t[::step], force=record.force[::step])


def test_what_sparse_samples_hide_is_counted_and_named(record):
    found = identify_force(every(record, 50), CUP)  # 10 Hz
    off = abs(found.sloshing_mass.value - TRUTH.mass)
    assert 0.05 * TRUTH.mass < off < 1.1 * found.sloshing_mass.error
    assert abs(found.payload.value - TRUTH.payload) < 2.0 * found.payload.error
    told = " ".join(found.notes)
    assert "the force has 10 Hz and the wave has" in told
    assert "fill height" not in told
    assert "record the force at" in refused(every(record, 100))


def test_a_force_in_stairs_is_read_at_its_own_rate(record):
    rows = np.arange(len(record.t)) // 10 * 10
    found = identify_force(replace(record, force=record.force[rows]), CUP)
    check(found, TRUTH)
    assert "measured at 50 Hz and sent at 50" in found.notes[0]


def test_a_clipped_force_is_named(record):
    force = record.force - np.median(record.force, axis=0)
    most = 0.2 * np.abs(force).max()
    assert "clipped during" in refused(replace(record, force=np.clip(force, -most, most)))


def test_a_force_in_axes_that_do_not_turn_with_the_container_is_refused():
    turning = replace(TRUTH, plane=True, turn=math.radians(90.0))
    check(identify_force(turning.record(), CUP), turning)
    told = refused(replace(turning, in_base=True).record())
    assert "axes that do not turn with the container" in told
    assert "record it in the sensor's own axes" in told
