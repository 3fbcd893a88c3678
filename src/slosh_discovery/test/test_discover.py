"""Tests discoveries with known truth: one effect, none, ambiguous, unknown clocks."""

import numpy as np
import pytest
from example_motions import BASE, DURATION, NOISE, inputs_of, measured

from slosh_discovery.discover import MeasuredMotion, Verdict, discover
from slosh_discovery.discover.finding import Role
from slosh_discovery.errors import SloshDiscoveryError
from slosh_model import Model, Rectangle, predicted_heights


def names(finding) -> set[str]:
    return {effect.name for effect in finding.effects}


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("effect", "parameters"),
    [
        ("vertical_acceleration", {}),
        ("quadratic_damping", {"beta": 0.1}),
        pytest.param("static_tilt", {"roll": 0.03, "pitch": -0.02}, marks=pytest.mark.long),
        pytest.param("draining_film", {"speed": 0.05}, marks=pytest.mark.long),
    ],
)
def test_a_missing_effect_is_named_with_its_parameters(effect, parameters):
    truth = BASE.with_effect(effect, **parameters)
    motions = [measured(truth, seed, vertical=3.0) for seed in range(3)]
    finding = discover(motions, BASE, [measured(truth, 9, vertical=3.0)])
    assert finding.verdict is Verdict.NAMED
    assert names(finding) == {effect}
    (found,) = finding.effects
    for name, value in parameters.items():
        error = found.standard_errors[name]
        assert abs(found.parameters[name] - value) < 5.0 * error
        assert error < 0.1 * abs(value)
    assert found.confidence > 0.9
    assert finding.gap.closed > 0.95
    assert finding.gap.holdout_after == pytest.approx(NOISE, rel=0.2)
    assert finding.model.has(effect)
    assert [case.role for case in finding.motions] == [Role.FIT] * 3 + [Role.HOLDOUT]


@pytest.mark.long
def test_in_a_rectangle_what_its_shape_can_have_is_tried():
    base = Model(Rectangle(0.1, 0.09, 0.07), damping_ratio=0.006)
    truth = base.with_effect("quadratic_damping", beta=0.1)
    finding = discover([measured(truth, seed) for seed in range(3)], base)
    assert names(finding) == {"quadratic_damping"}
    assert finding.effects[0].parameters["beta"] == pytest.approx(0.1, rel=0.1)
    tried = {name for case in finding.candidates for name in case.effects}
    assert "pendulum_nonlinearity" in tried
    assert not tried & {"surface_nonlinearity", "anisotropic_stiffness", "visible_arc"}


@pytest.mark.long
def test_what_makes_the_motions_held_out_worse_is_not_added():
    """Tests that an effect is not added if it makes held-out motions worse."""
    truth = BASE.with_effect("quadratic_damping", beta=0.1)
    motions = [measured(truth, seed) for seed in range(2)]
    finding = discover(motions, BASE, [measured(BASE, 9)])
    assert finding.verdict is Verdict.UNEXPLAINED
    assert (finding.effects, finding.model, finding.changed) == ((), BASE, False)
    assert finding.gap.holdout_after == finding.gap.holdout_before
    (remark,) = [remark for remark in finding.remarks if "held out" in remark]
    assert remark.startswith("quadratic_damping explains the fitted motions best, but takes")
    assert finding.candidates[0].effects == ("quadratic_damping",)
    assert finding.proposal is not None
    # The same cause in all of them is named.
    assert names(discover(motions, BASE, [measured(truth, 9)])) == {"quadratic_damping"}


@pytest.mark.long
def test_two_effects_are_named_together():
    truth = BASE.with_effect("height_offset", offset=0.002).with_effect("time_offset", tau=0.03)
    finding = discover([measured(truth, seed) for seed in range(3)], BASE)
    assert finding.verdict is Verdict.NAMED
    assert names(finding) == {"height_offset", "time_offset"}


@pytest.mark.long
def test_a_wrong_parameter_is_fitted_anew_and_no_term_is_invented():
    base = BASE.with_effect("surface_nonlinearity", alpha=0.58)
    truth = BASE.with_effect("surface_nonlinearity", alpha=1.4)
    finding = discover([measured(truth, seed, vertical=0.0) for seed in range(3)], base)
    assert names(finding) == {"surface_nonlinearity"}
    assert finding.effects[0].refitted
    assert finding.effects[0].parameters["alpha"] == pytest.approx(1.4, rel=0.05)


@pytest.mark.first(1)
@pytest.mark.parametrize("seed", [0, 20, 40])
def test_nothing_is_named_where_nothing_is_missing(seed):
    finding = discover([measured(BASE, seed + k) for k in range(3)], BASE)
    assert finding.verdict is Verdict.NONE
    assert finding.effects == ()
    assert finding.model == BASE


@pytest.mark.long
def test_what_the_motions_cannot_tell_apart_is_ambiguous_with_a_motion_that_can():
    truth = BASE.with_effect("height_scale", gain=1.15)
    finding = discover([measured(truth, seed) for seed in range(2)], BASE)
    assert finding.verdict is Verdict.AMBIGUOUS
    (found,) = finding.effects
    assert {found.name, *found.alternatives} == {"height_scale", "accel_gain"}
    assert found.confidence == pytest.approx(0.5, abs=0.05)
    (motion,) = finding.separating
    assert motion.difference > 5.0 * NOISE
    assert np.linalg.norm(motion.inputs.acceleration, axis=1).max() <= BASE.limits.acceleration


def at_azimuths(truth: Model, seed: int, vertical: float) -> MeasuredMotion:
    """Returns a motion with simulated heights at several azimuths and camera noise."""
    inputs = inputs_of(seed, vertical)
    azimuths = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    t = np.arange(0.01, DURATION, 1.0 / 60.0)
    heights = predicted_heights(truth, inputs, t, azimuths)
    noise = 0.2 * NOISE * np.random.default_rng(1000 + seed).normal(size=heights.shape)
    return MeasuredMotion(f"motion {seed}", inputs, t, eta=heights + noise, eta_azimuth=azimuths)


@pytest.mark.long
def test_a_difference_that_no_model_has_right_decides_nothing():
    """Tests a tilted cup and a tilted sensor, which differ only by the square of the tilt.

    Where the cup is lifted they differ by its lift over g, and that tells.
    """
    truth = BASE.with_effect("static_tilt", roll=0.04, pitch=-0.07)
    leans = BASE.with_effect("sensor_tilt", e_x=-0.07, e_y=-0.04)
    apart = at_azimuths(truth, 0, 0.0).eta - at_azimuths(leans, 0, 0.0).eta
    assert 3e-5 < np.sqrt(np.mean(apart**2)) < 5e-5  # as much as the noise, 1.5 % of the gap
    finding = discover([at_azimuths(truth, seed, 0.0) for seed in range(3)], BASE)
    assert finding.verdict is Verdict.AMBIGUOUS
    (found,) = finding.effects
    assert {found.name, *found.alternatives} == {"static_tilt", "sensor_tilt"}
    finding = discover([at_azimuths(truth, seed, 3.0) for seed in range(3)], BASE)
    assert finding.verdict is Verdict.NAMED
    assert names(finding) == {"static_tilt"}


@pytest.mark.long
def test_a_frequency_that_no_plausible_fill_has_is_named_as_one():
    truth = BASE.with_effect("frequency_mismatch", factor=0.96)
    finding = discover([measured(truth, seed) for seed in range(3)], BASE)
    assert finding.verdict is Verdict.NAMED
    assert names(finding) == {"frequency_mismatch"}
    assert finding.effects[0].parameters["factor"] == pytest.approx(0.96, abs=1e-3)


@pytest.mark.long
def test_clock_offset_and_still_level_are_no_effects_where_they_are_unknown():
    truth = BASE.with_effect("vertical_acceleration")
    motions = [
        measured(truth, seed, offset=0.3 * (seed + 1), level=0.004, vertical=3.0)
        for seed in range(3)
    ]
    finding = discover(motions, BASE)
    assert names(finding) == {"vertical_acceleration"}
    for seed, case in enumerate(finding.motions):
        assert case.clock_offset == pytest.approx(0.3 * (seed + 1), abs=1e-3)
        assert case.level == pytest.approx(0.004, abs=1e-4)


def test_effects_that_change_nothing_in_these_motions_say_so():
    finding = discover([measured(BASE, 0)], BASE)
    reasons = {case.effects: case.reason for case in finding.candidates if case.reason}
    assert {("gravity_tilt",), ("lever_arm",), ("yaw_coupling",)} <= set(reasons)


@pytest.mark.long
def test_the_number_of_threads_changes_nothing():
    truth = BASE.with_effect("time_offset", tau=0.02)
    motions = [measured(truth, seed) for seed in range(2)]
    one, two = (discover(motions, BASE, threads=count) for count in (1, 2))
    assert one.effects == two.effects
    assert one.gap == two.gap


@pytest.mark.long
def test_heights_that_do_not_follow_the_motion_are_no_effect():
    """Tests that heights that stay constant are blamed on the camera, not on an effect."""
    t = np.arange(0.01, DURATION, 1.0 / 60.0)
    flat = NOISE * np.random.default_rng(5).normal(size=len(t))
    finding = discover([MeasuredMotion("blind camera", inputs_of(1), t, msh=flat)], BASE)
    assert finding.verdict is Verdict.UNEXPLAINED


def test_heights_in_millimetres_are_one_clear_error():
    t = np.arange(0.0, 1.0, 1.0 / 60.0)
    with pytest.raises(SloshDiscoveryError, match=r"motion 1: heights reach .* metres"):
        MeasuredMotion("motion 1", inputs_of(1), t, msh=20.0 * np.sin(t))


def test_no_motion_is_one_clear_error():
    with pytest.raises(SloshDiscoveryError, match="no motion with measured heights"):
        discover([], BASE)
