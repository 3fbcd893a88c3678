"""Tests that the designed motion separates two models and that a robot can perform it."""

import re

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson

from slosh_discovery.discover.separate import separating_motion, variants_of
from slosh_discovery.discover.separating_families import (
    FAMILIES,
    CandidateMotion,
    inputs_of,
    text_of,
)
from slosh_discovery.discover.tuning import TUNING
from slosh_discovery.errors import SloshDiscoveryError
from slosh_model import Cylinder, Model, simulate
from slosh_model.measure import predicted_heights

MODEL = Model(Cylinder(0.05, 0.07))
PRESENT = [inputs_of(CandidateMotion(FAMILIES[0], 2.0, 2.0))]
LIMIT = 4.0


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def difference(first, second, inputs):
    one, two = (predicted_heights(model, inputs, inputs.t) for model in (first, second))
    return rms(one - two)


@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.title)
@pytest.mark.parametrize("frequency", [0.5, 3.0])
def test_every_family_starts_and_ends_at_rest_within_its_bounds(family, frequency):
    motion = CandidateMotion(family, frequency, LIMIT)
    inputs = inputs_of(motion)
    a = inputs.acceleration
    assert np.linalg.norm(a, axis=1).max() <= LIMIT + 1e-9
    velocity = cumulative_simpson(a, x=inputs.t, axis=0, initial=0.0)
    position = cumulative_simpson(velocity, x=inputs.t, axis=0, initial=0.0)
    assert velocity[-1] == pytest.approx(0.0, abs=1e-3)
    assert position[-1] == pytest.approx(0.0, abs=2e-3)
    assert np.linalg.norm(np.ptp(position, axis=0)) <= TUNING.most_travel + 1e-3
    still, dwell = inputs.t <= TUNING.family_still, inputs.t >= inputs.t[-1] - motion.dwell
    assert not a[still].any()
    assert np.abs(a[dwell]).max() < 1e-9
    if inputs.attitude is not None:
        rate = inputs.angular_velocity
        assert np.abs(inputs.attitude[dwell] - inputs.attitude[0]).max() < 1e-9
        assert np.linalg.norm(rate, axis=1).max() < 10.0
        angle = cumulative_simpson(rate, x=inputs.t, axis=0, initial=0.0)
        turned = 2.0 * np.arcsin(inputs.attitude[:, :3])
        assert angle == pytest.approx(turned, abs=1e-3)
    assert f"{frequency:.2f} Hz" in text_of(motion) or family.sweep != 1.0


@pytest.mark.long
def test_a_gain_on_the_input_against_one_on_the_height():
    first = MODEL.with_effect("accel_gain", gain=1.15)
    second = MODEL.with_effect("height_scale", gain=1.15)
    found = separating_motion(first, second, PRESENT, LIMIT)
    assert found.names == ("accel_gain", "height_scale")
    assert "nonlinear variants" in found.description
    assert found.present_difference < 1e-6
    assert difference(first, second, found.inputs) < 1e-6  # the linear ones are the same
    twins = [model.spatial().nonlinear() for model in (first, second)]
    assert found.difference == pytest.approx(difference(*twins, found.inputs), rel=0.1)
    assert found.difference > 1e-3
    assert found.inputs.attitude is None


def test_a_tilt_against_an_offset():
    first = MODEL.with_effect("static_tilt", roll=0.0, pitch=0.02)
    second = MODEL.with_effect("height_offset", offset=0.001)
    found = separating_motion(first, second, PRESENT, LIMIT)
    assert found.difference > max(1e-3, 1.5 * found.present_difference)
    assert "variants" not in found.description


@pytest.mark.long
def test_it_turns_where_an_effect_needs_it_and_the_liquid_stays_in():
    first = MODEL.with_effect("gravity_tilt")
    second = MODEL.with_effect("lever_arm", x=0.0, y=0.0, z=0.1)
    found = separating_motion(first, second, PRESENT, LIMIT, names=("one", "other"))
    assert found.names == ("one", "other")
    assert found.inputs.attitude is not None
    assert found.present_difference == 0.0
    assert found.difference > 1e-3
    for model in (first, second):
        assert simulate(model, found.inputs)[0].msh.max() < 0.7 * 0.05
    assert np.linalg.norm(found.inputs.acceleration, axis=1).max() <= LIMIT


def test_the_rim_is_kept():
    brim = Model(Cylinder(0.05, 0.07, rim_height=0.08))
    first, second = brim.with_effect("damping_mismatch", factor=2.0), brim
    found = separating_motion(first, second, [], LIMIT)
    assert simulate(second, found.inputs)[0].msh.max() < 0.008
    assert found.names == ("damping_mismatch", "as it is")
    assert found.present_difference == 0.0


@pytest.mark.parametrize("limit", [0.0, -1.0, float("nan"), float("inf")])
def test_an_impossible_limit(limit):
    with pytest.raises(SloshDiscoveryError, match="must be positive"):
        separating_motion(MODEL, MODEL, PRESENT, limit)


@pytest.mark.long
def test_a_liquid_that_always_spills():
    full = Model(Cylinder(0.05, 0.07, rim_height=0.0700001))
    with pytest.raises(SloshDiscoveryError, match="keeps the liquid in"):
        separating_motion(full, full.nonlinear(), PRESENT, 50.0)


def remaining(description):
    """Returns the difference that remains after a refit [m], as the description states it."""
    return 1e-3 * float(re.search(r"([\d.e-]+) mm of the difference are left", description)[1])


@pytest.mark.long
def test_a_mere_difference_of_parameters_is_not_left_after_a_refit():
    first = MODEL.with_effect("damping_mismatch", factor=1.2)
    second = MODEL.with_effect("damping_mismatch", factor=1.25)
    found = separating_motion(first, second, PRESENT, LIMIT)
    assert remaining(found.description) < 0.05 * found.difference


@pytest.mark.long
def test_another_law_is_left_after_a_refit():
    first = MODEL.with_effect("damping_mismatch", factor=2.0)
    second = MODEL.with_effect("quadratic_damping", beta=0.15)
    found = separating_motion(first, second, PRESENT, LIMIT)
    assert remaining(found.description) > 0.15 * found.difference


def test_variants_change_one_thing_and_keep_to_the_bounds():
    model = MODEL.with_effect("fill_loss", rate=0.05).with_effect("height_scale", gain=1.0)
    variants = list(variants_of(model))
    assert len(variants) == 4  # radius, damping, rate and gain; fixed_zero is a choice
    assert variants[0].container.size > model.container.size
    assert variants[1].mode_constants()[0].damping_ratio > model.mode_constants()[0].damping_ratio
    assert variants[2].effects[0].parameters["rate"] < 0.05
    assert variants[3].effects[1].parameters["gain"] != 1.0
