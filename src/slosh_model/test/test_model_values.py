"""Tests that models, motions and states are immutable, picklable and comparable."""

import copy
import math
import pickle

import numpy as np
import pytest

from slosh_model.errors import SloshModelError
from slosh_model.model import EffectUse, Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.simulate import Inputs, Simulator, State, simulate

CUP = Cylinder(0.05, 0.07)
MODEL = Model(CUP, modes=2).with_effect("surface_nonlinearity", alpha=0.5).spatial()


def motion(count=101, **more):
    t = np.linspace(0.0, 1.0, count)
    push = np.stack([2.0 * np.sin(15.0 * t), np.cos(9.0 * t), np.sin(t)], axis=1)
    return Inputs(t, push, **more)


def test_models_are_copied_pickled_hashed():
    for twin in (pickle.loads(pickle.dumps(MODEL)), copy.deepcopy(MODEL)):
        assert twin == MODEL
        assert hash(twin) == hash(MODEL)
        assert len({twin, MODEL, MODEL.linear()}) == 2


def test_inputs_state_and_response_cannot_change():
    given = np.zeros((3, 3))
    inputs = Inputs(np.arange(3.0), given)
    given[1] = 9.0
    assert not inputs.acceleration.any()
    response, state = simulate(Model(CUP), inputs)
    for array in (inputs.t, inputs.acceleration, state.modal, state.held, response.modal):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


@pytest.mark.parametrize(
    ("t", "modal", "held", "match"),
    [
        (math.nan, np.zeros((1, 4)), np.zeros(4), "t = nan"),
        (0.0, np.full((1, 4), math.inf), np.zeros(4), r"modal\[0\]\[0\] = inf"),
        (0.0, np.zeros((1, 3)), np.zeros(4), r"modal has the shape \(1, 3\), expected \(1, 4\)"),
        (0.0, np.zeros((1, 4)), np.array([0.0, math.nan, 0.0, 0.0]), r"held\[1\] = nan"),
    ],
)
def test_impossible_states_are_refused(t, modal, held, match):
    with pytest.raises(SloshModelError, match=match):
        State(t, modal, held)


def test_a_state_must_fit_the_model_and_the_motion():
    _, state = simulate(MODEL, motion())
    with pytest.raises(SloshModelError, match="the state has 2 modes, the model 1"):
        simulate(Model(CUP), Inputs(np.array([2.0]), np.zeros((1, 3))), state)
    with pytest.raises(SloshModelError, match=r"starts at 0.5 s, before the state's 1 s"):
        simulate(MODEL, Inputs(np.array([0.5]), np.zeros((1, 3))), state)
    with pytest.raises(SloshModelError, match="more than 3600 s after"):
        simulate(MODEL, Inputs(np.array([1.7e9]), np.zeros((1, 3))), state)


@pytest.mark.parametrize("max_step", [0.0, -1.0, math.nan, math.inf])
def test_impossible_steps_are_refused(max_step):
    with pytest.raises(SloshModelError, match="max_step"):
        Simulator(MODEL, max_step=max_step)


def turned_by(yaw, tilt=0.0):
    """Returns quaternions x, y, z, w of a tilt followed by a yaw."""
    half, lean = yaw / 2.0, tilt / 2.0
    c, s = np.cos(half), np.sin(half)
    return np.stack([c * np.sin(lean), s * np.sin(lean), s * np.cos(lean), c * np.cos(lean)], 1)


@pytest.mark.parametrize("tilt", [0.0, 0.2])
def test_heights_are_told_in_the_turned_containers_axes(tilt):
    yaw = np.linspace(0.0, 7.0, 101)
    attitude = 3.0 * turned_by(yaw, tilt)
    plain, _ = simulate(MODEL, motion())
    turned, _ = simulate(MODEL, motion(attitude=attitude))
    assert np.array_equal(turned.modal, plain.modal)
    assert turned.msh == pytest.approx(plain.msh)
    gap = np.exp(1j * (plain.azimuth - yaw)) - np.exp(1j * turned.azimuth)
    assert np.max(np.abs(gap[1:])) < 1e-12


def test_a_quaternion_without_length_is_refused():
    attitude = turned_by(np.zeros(101))
    attitude[7] = 0.0
    with pytest.raises(SloshModelError, match=r"attitude\[7\] is zero"):
        motion(attitude=attitude)


def test_effects_added_together_are_those_added_one_by_one():
    base = Model(Cylinder(0.05, 0.07)).with_effect("surface_nonlinearity", alpha=0.4)
    together = base.with_effects(
        EffectUse("height_scale", {"gain": 1.1}), EffectUse("surface_nonlinearity", {"alpha": 0.7})
    )
    one_by_one = base.with_effect("height_scale", gain=1.1)
    assert together == one_by_one.with_effect("surface_nonlinearity", alpha=0.7)
    assert [use.name for use in together.effects] == ["surface_nonlinearity", "height_scale"]
    assert base.with_effects() is base
