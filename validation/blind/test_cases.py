"""Tests of the properties that synthetic test cases of the discovery promise."""

import numpy as np
import pytest

from validation.blind.cases import VISIBLE, hidden_names, make_case
from validation.blind.dirt import DIRT
from validation.blind.hidden import LISTED, OUTSIDE
from validation.blind.laws import LAWS, stroke, window
from validation.blind.motions import Need, robot_motion
from validation.blind.truth import heights, simulate
from validation.blind.truth_model import Truth


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.__name__)
def test_a_law_goes_from_rest_to_rest(law):
    t = np.linspace(0.0, 2.0, 4001)
    place, speed, acceleration = stroke(t, 0.5, 1.0, law)
    assert place[0] == pytest.approx(0.0, abs=1e-12)
    assert place[-1] == pytest.approx(1.0)
    assert np.all(speed[[0, -1]] == 0.0)
    assert np.allclose(np.gradient(place, t), speed, atol=3e-3)
    assert np.abs(np.diff(acceleration)).max() < 0.1


def test_a_window_opens_and_closes():
    stage = np.linspace(0.0, 1.0, 2001)
    value, slope, bend = window(stage, 0.3)
    assert value[0] == value[-1] == 0.0
    assert value[1000] == 1.0
    assert np.allclose(np.gradient(value, stage), slope, atol=1e-3)
    assert np.allclose(
        np.gradient(slope, stage)[1:-1], bend[1:-1], atol=0.5
    )  # of 64; its slope jumps


def test_motions_are_a_robots():
    random = np.random.default_rng(5)
    cup = Truth(0.05, 0.07, effects={"gravity_tilt": {}})
    for _ in range(3):
        inputs = robot_motion(random, cup, Need(vertical=True, yaw=True, tilt=True))
        planar = np.linalg.norm(inputs.acceleration[:, :2], axis=1)
        assert 1.5 <= planar.max() <= 7.0
        assert 1.0 <= np.abs(inputs.acceleration[:, 2]).max() <= 5.0
        assert 0.005 <= simulate(cup, inputs).msh.max() <= 0.030
        speed = np.trapezoid(inputs.acceleration, inputs.t, axis=0)
        assert np.abs(speed).max() < 0.02
        assert not inputs.acceleration[[0, -1]].any()
        assert inputs.attitude is not None


def test_the_same_name_is_the_same_case():
    one, two = (make_case("none", 1, seed=1) for _ in range(2))
    assert one.base == two.base
    assert np.array_equal(one.motions[0].heights, two.motions[0].heights, equal_nan=True)
    other = make_case("none", 1, seed=2)
    assert one.base != other.base


def test_a_dirty_case_is_the_clean_one_with_a_real_sensors_errors():
    clean, dirty = (make_case("none", 3, 1, dirt=dirt) for dirt in (None, DIRT))
    assert dirty.base == clean.base
    assert dirty.noise == clean.noise
    errors, off, lost = [], [], []
    for motion, other in zip(dirty.motions, clean.motions, strict=True):
        assert len(motion.t) == len(other.t)
        assert np.median(np.diff(motion.inputs.t)) == pytest.approx(1.0 / DIRT.input_rate)
        stamps = motion.t - other.t
        off.append(stamps)
        assert np.abs(stamps).max() <= DIRT.jitter
        errors.append(motion.heights - heights(clean.truth, other.inputs, other.t))
        lost.append(np.isnan(motion.heights[:, 0]))
    assert np.std(np.concatenate(off)) == pytest.approx(DIRT.jitter / np.sqrt(3.0), rel=0.1)
    assert 0.04 < np.mean(np.concatenate(lost)) < 0.2
    pairs = [(e[1:] * e[:-1], e[1:]) for e in (np.clip(e, -2e-3, 2e-3) for e in errors)]
    together = np.nanmean(np.concatenate([p for p, _ in pairs]))
    alone = np.nanmean(np.concatenate([e**2 for _, e in pairs]))
    assert together / alone == pytest.approx(DIRT.correlation, abs=0.15)
    assert 0.003 < np.nanmean(np.abs(np.concatenate(errors)) > 2.0e-3 + clean.noise) < 0.03


def test_a_case_hides_the_effect_and_nothing_else():
    case = make_case("single", 0, seed=2, effect="second_mode")
    assert case.hidden == ("second_mode",)
    assert case.strength["second_mode"] > VISIBLE
    assert not case.base.has("second_mode")
    assert 3 <= len(case.motions) <= 6
    assert 1 <= len(case.holdout) <= 2
    motion = case.motions[0]
    at = motion.t if motion.same_clock else motion.t[:0]
    clean = heights(case.truth, motion.inputs, at, motion.eta_azimuth)
    if motion.same_clock and motion.level_known:
        noise = np.nanstd(motion.heights - clean)
        assert noise == pytest.approx(case.noise, rel=0.15)


def test_strength_is_the_change_of_the_heights_in_noises():
    case = make_case("single", 1, seed=1, effect="height_scale")
    gain = case.parameters["height_scale"]["gain"]
    motions = [(m.inputs, m.t if m.same_clock else m.t[:0], m.eta_azimuth) for m in case.motions]
    assert all(len(at) for _, at, _ in motions)
    plain = case.truth.without("height_scale")
    change = [(gain - 1.0) * heights(plain, *motion) for motion in motions]
    rms = np.sqrt(np.mean(np.concatenate(change) ** 2))
    assert case.strength["height_scale"] == pytest.approx(rms / case.noise, rel=1e-9)


def test_a_wrong_parameter_is_in_the_base_alone():
    case = make_case("wrong_parameter", 0, seed=1)
    which, given, true = case.wrong
    assert which == "alpha"
    assert given != true
    used = {use.name: use.parameters for use in case.base.effects}
    assert used["surface_nonlinearity"]["alpha"] == given
    assert case.truth.effects["surface_nonlinearity"]["alpha"] == true
    assert case.strength["alpha"] > 0.0


def test_two_alike_are_said_to_be_alike():
    nonlinear, linear = (make_case("single", i, 1, "accel_gain") for i in (1, 2))
    assert nonlinear.base_name == "3D-NL"
    assert nonlinear.equivalent == ()
    # Spatial, but the cup is not lifted: a larger acceleration is a higher wave.
    assert linear.base_name == "3D-L"
    assert not any(motion.inputs.acceleration[:, 2].any() for motion in linear.motions)
    assert linear.equivalent == (frozenset({"accel_gain", "height_scale"}),)


def test_every_effect_has_its_turn():
    random = np.random.default_rng(1)
    outside = [hidden_names(random, "outside", i, None) for i in range(len(OUTSIDE))]
    assert {name for (name,) in outside} == set(OUTSIDE)
    listed = [hidden_names(random, "single", i, None) for i in range(len(LISTED))]
    assert {name for (name,) in listed} == set(LISTED)
    for i in range(100):
        first, second = hidden_names(random, "pairs", i, None)
        assert first != second
        assert {first, second} != {"accel_gain", "height_scale"}
    assert hidden_names(random, "none", 0, None) == ()


def test_an_unknown_kind_or_effect_is_refused():
    with pytest.raises(ValueError, match="no kind of case"):
        make_case("triple", 0)
    with pytest.raises(ValueError, match="no effect that a case can hide"):
        make_case("single", 0, effect="ghosts")
