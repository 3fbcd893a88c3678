"""Tests properties of all effects: neutral values, bounds, symmetry, restart from a state."""

import math

import numpy as np
import pytest
from example_effects import in_fitting_container
from scipy.spatial.transform import Rotation

from slosh_model.effects.base import Stage
from slosh_model.effects.registry import EFFECTS
from slosh_model.errors import SloshModelError
from slosh_model.measure import predicted_heights
from slosh_model.model import EffectUse, Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.simulate import Inputs, Simulator, simulate

# Every effect with values that are not neutral.
VALUES = {
    "accel_gain": {"gain": 1.3},
    "amplitude_damping": {"gamma": 20.0},
    "amplitude_stiffening": {"kappa": 2.0},
    "anisotropic_stiffness": {"e": 0.1, "axis": 0.4},
    "bound_modes": {"kappa": 1.2, "damping_ratio": 0.05},
    "clock_drift": {"rate": 0.015, "offset": 0.02},
    "contact_line_friction": {"mu": 0.02},
    "crest_asymmetry": {"kappa": 0.6},
    "damping_mismatch": {"factor": 3.0},
    "draining_film": {"speed": 0.03},
    "fill_level": {"delta": -0.03},
    "fill_loss": {"rate": 0.01},
    "frame_saturation": {"cap": 0.008},
    "frequency_mismatch": {"factor": 0.95},
    "gravity_tilt": {},
    "height_offset": {"offset": 0.002},
    "height_scale": {"gain": 1.2},
    "lever_arm": {"x": 0.1, "y": 0.2, "z": -0.1},
    "pendulum_nonlinearity": {},
    "quadratic_damping": {"beta": 0.5},
    "quasi_static_modes": {"kappa": 2.0},
    "robot_dynamics": {"frequency": 30.0, "damping_ratio": 0.5},
    "second_mode": {"damping_ratio": 0.01},
    "sensor_lag": {"time": 0.03},
    "sensor_tilt": {"e_x": 0.03, "e_y": -0.05},
    "static_tilt": {"roll": 0.05, "pitch": -0.08},
    "surface_nonlinearity": {"alpha": 0.58},
    "surface_tension": {"tension": 4e-4},
    "swirl_stiffening": {"gamma": 2.0},
    "time_offset": {"tau": 0.05},
    "vertical_acceleration": {},
    "visible_arc": {"centre": 0.3, "width": 1.5},
    "yaw_coupling": {"kappa": 0.5},
}
# Where nothing is neutral: values near the limit that is, and how near the heights come [m].
LIMITS = {
    "robot_dynamics": ({"frequency": 500.0}, 1e-3),
    "draining_film": ({"speed": 10.0}, 1e-12),
}
# What does nothing only in a motion without it: checked with the effect's own tests.
NEEDS = {
    "gravity_tilt", "pendulum_nonlinearity", "second_mode", "surface_nonlinearity",
    "vertical_acceleration",
}  # fmt: skip
PLAIN = Model(Cylinder(0.05, 0.07), damping_ratio=0.02)
TIMES = np.arange(0.0, 2.0, 1.0 / 60.0)
AZIMUTHS = np.array([0.2, 2.0, -1.4])


def test_the_effects_are_those_of_the_list():
    assert set(EFFECTS) == set(VALUES)
    assert len(EFFECTS) == 33


def with_effect(name, **parameters):
    return plain(name).with_effect(name, **(parameters or VALUES[name]))


def plain(name):
    return in_fitting_container(PLAIN, name)


@pytest.fixture
def inputs(motion):
    """Returns a spatial motion with attitude and angular velocity at 500 samples a second."""
    full = motion().inputs()
    return Inputs(
        full.t[::10], full.acceleration[::10], full.attitude[::10], full.angular_velocity[::10]
    )


def both(model, inputs):
    """Returns maximum heights and heights by azimuth."""
    return np.hstack(
        [
            predicted_heights(model, inputs, TIMES),
            predicted_heights(model, inputs, TIMES, AZIMUTHS),
        ]
    )


@pytest.mark.parametrize("name", sorted(set(EFFECTS) - NEEDS))
def test_the_neutral_value_is_nothing(name, inputs):
    parameters, within = LIMITS.get(name, ({}, 1e-12))
    neutral = {p.name: p.neutral for p in EFFECTS[name].parameters if p.neutral is not None}
    assert neutral or parameters
    model = with_effect(name, **{**VALUES[name], **neutral, **parameters})
    assert both(model, inputs) == pytest.approx(both(plain(name), inputs), abs=within)


@pytest.mark.parametrize(
    "base", [PLAIN, PLAIN.spatial().nonlinear()], ids=lambda model: model.name
)
@pytest.mark.parametrize("name", EFFECTS)
def test_liquid_at_rest_stays_there(name, base):
    t = np.linspace(0.0, 1.0, 101)
    still = Inputs(t, np.zeros((101, 3)))
    base = in_fitting_container(base, name)
    found = predicted_heights(base.with_effect(name, **VALUES[name]), still, t)
    assert np.ptp(found) < 1e-12  # a tilted surface rests, too
    expected = {"height_offset": 0.002}.get(name, 0.0)
    if name != "static_tilt":
        assert np.max(np.abs(found - expected)) < 1e-12


@pytest.mark.parametrize("name", EFFECTS)
def test_in_a_mirror_everything_is_mirrored(name, inputs):
    """Tests that mirroring the motion at y = 0 mirrors the response."""
    mirrored = Inputs(
        inputs.t,
        inputs.acceleration * [1.0, -1.0, 1.0],
        inputs.attitude * [-1.0, 1.0, -1.0, 1.0],
        inputs.angular_velocity * [-1.0, 1.0, -1.0],
    )
    odd = {"axis", "y", "e_y", "roll", "centre"}
    values = {key: -value if key in odd else value for key, value in VALUES[name].items()}
    found = predicted_heights(with_effect(name, **values), mirrored, TIMES, -AZIMUTHS)
    expected = predicted_heights(with_effect(name), inputs, TIMES, AZIMUTHS)
    assert found == pytest.approx(expected, abs=1e-9)
    msh = predicted_heights(with_effect(name, **values), mirrored, TIMES)
    assert msh == pytest.approx(predicted_heights(with_effect(name), inputs, TIMES), abs=1e-9)


@pytest.mark.parametrize("name", EFFECTS)
def test_a_motion_in_two_parts_gives_the_same_bits(name, motion):
    """Tests that a motion simulated in two parts gives exactly the same result."""
    t = np.arange(0.0, 1.5, 0.002)
    spin = np.tile([0.3, -0.2, 2.0], (len(t), 1))
    attitude = Rotation.from_rotvec(spin * t[:, np.newaxis]).as_quat()
    push = motion().acceleration(t + 0.5)
    model = with_effect(name).spatial().nonlinear()
    whole = simulate(model, Inputs(t, push, attitude, spin))[0]
    first, state = simulate(model, Inputs(t[:333], push[:333], attitude[:333], spin[:333]))
    second, _ = simulate(model, Inputs(t[333:], push[333:], attitude[333:], spin[333:]), state)
    for part in ("modal", "sh_x", "sh_y"):
        joined = np.concatenate([getattr(first, part), getattr(second, part)])
        assert np.array_equal(joined, getattr(whole, part))


@pytest.mark.parametrize("name", EFFECTS)
def test_sample_by_sample_gives_the_same_bits(name, motion):
    step = 1.0 / 128.0
    t = step * np.arange(64)
    push = motion().acceleration(t + 1.0)
    model = with_effect(name)
    whole = simulate(model, Inputs(t, push))[0]
    simulator = Simulator(model)
    for _ in range(2):  # and again after a reset
        found = [simulator.step(step, *row) for row in push.tolist()]
        assert np.array_equal(found, np.stack([whole.sh_x, whole.sh_y], axis=1))
        simulator.reset()


@pytest.mark.parametrize("name", EFFECTS)
def test_parameters_are_bounded(name):
    for parameter in EFFECTS[name].parameters:
        owner = f"effect {name}"
        assert parameter.lower < parameter.upper
        for value in (parameter.lower, parameter.upper):
            assert parameter.check(owner, value) == value
        for value in (parameter.lower - 1e-3, parameter.upper + 1e-3, math.nan, math.inf):
            with pytest.raises(SloshModelError, match=rf"{owner}\.{parameter.name} = .*must lie"):
                parameter.check(owner, value)
        for value in (parameter.neutral, parameter.default, VALUES[name].get(parameter.name)):
            assert value is None or parameter.check(owner, value) == value


@pytest.mark.parametrize(
    ("name", "key"), [("static_tilt", "settled"), ("fill_loss", "fixed_zero")]
)
def test_a_choice_is_one_of_its_values(name, key):
    for value in (0.0, 1.0):
        assert EffectUse(name, {**VALUES[name], key: value}).parameters[key] == value
    with pytest.raises(SloshModelError) as caught:
        EffectUse(name, {**VALUES[name], key: 0.5})
    assert str(caught.value) == f"effect {name}.{key} = 0.5 must be 0 or 1"


@pytest.mark.parametrize("name", EFFECTS)
def test_every_effect_explains_itself(name):
    effect = EFFECTS[name]
    assert effect.name == name
    assert effect.title
    assert effect.meaning.endswith(".")
    assert not set(effect.meaning) & set("$\\_")
    assert effect.source
    assert effect.equation
    assert effect.equation.count("{") == effect.equation.count("}")
    assert effect.stages
    acts = {
        Stage.INPUT: effect.drive,
        Stage.DYNAMICS: effect.term or effect.modes or effect.modulation or effect.drive,
        Stage.HEIGHT: effect.height_gain
        or effect.modes
        or effect.modulation
        or effect.static_share,
        Stage.MEASUREMENT: effect.reading or effect.delay,
    }
    assert all(acts[stage] for stage in effect.stages)
    assert all(parameter.description and parameter.unit for parameter in effect.parameters)
