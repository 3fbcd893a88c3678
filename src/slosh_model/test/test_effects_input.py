"""Tests effects on the input against closed forms and other integrators."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from slosh_model.constants import GRAVITY
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.simulate import Inputs, simulate

CUP = Cylinder(0.05, 0.07)
OMEGA = CUP.natural_frequency(1)
ZETA = 0.02
PLAIN = Model(CUP, damping_ratio=ZETA)
GAIN = PLAIN.height_gains()[0]
UP = np.array([0.0, 0.0, GRAVITY])


def heights(model, inputs):
    response = simulate(model, inputs)[0]
    return np.stack([response.sh_x, response.sh_y], axis=1)


def linear(felt, spatial=True):
    """Returns the equations of the linear model, driven by an acceleration."""

    def derivative(t, s):
        a = felt(t)
        stiffness = OMEGA**2 * (1.0 + spatial * a[2] / GRAVITY)
        x, y, vx, vy = s
        drag = 2.0 * ZETA * OMEGA
        return [vx, vy, -drag * vx - stiffness * x - a[0], -drag * vy - stiffness * y - a[1]]

    return derivative


def in_container(modal, turn):
    """Returns wall heights at the container's +x and +y from modal displacements."""
    c, s = np.cos(turn), np.sin(turn)
    x, y = GAIN * modal[:, 0], GAIN * modal[:, 1]
    return np.stack([c * x + s * y, c * y - s * x], axis=1)


def rested(felt):
    """Returns the rest state of the linear model under an acceleration."""
    stiffness = OMEGA**2 * (1.0 + felt[2] / GRAVITY)
    return (-felt[0] / stiffness, -felt[1] / stiffness, 0.0, 0.0)


# accel_gain


@settings(max_examples=15, deadline=None)
@given(st.floats(0.2, 5.0))
def test_accel_gain_is_a_larger_acceleration(gain):
    t = np.arange(0.0, 1.0, 0.002)
    push = np.stack([np.sin(20.0 * t), np.cos(9.0 * t), 2.0 * np.sin(7.0 * t)], axis=1)
    model = PLAIN.spatial().nonlinear()
    found = simulate(model.with_effect("accel_gain", gain=gain), Inputs(t, push))[0]
    assert np.array_equal(found.modal, simulate(model, Inputs(t, gain * push))[0].modal)


# robot_dynamics


@pytest.mark.parametrize("ratio", [0.3, 1.7])
def test_robot_dynamics_answers_a_step_as_the_closed_form(ratio, integrated, same):
    frequency, size = 30.0, np.array([2.0, -1.0, 1.5])
    # Both roots of s² + 2ζωs + ω², real or complex.
    root = frequency * np.sqrt(complex(ratio**2 - 1.0))
    first, second = -ratio * frequency + root, -ratio * frequency - root

    def arm(t):
        rest = (second * np.exp(first * t) - first * np.exp(second * t)) / (second - first)
        return size * (1.0 - rest.real)

    t = np.arange(0.0, 1.5, 5e-4)
    effect = PLAIN.spatial().with_effect(
        "robot_dynamics", frequency=frequency, damping_ratio=ratio
    )
    found = simulate(effect, Inputs(t, np.tile(size, (len(t), 1))))[0].modal[:, 0]
    expected = integrated(linear(arm), t)
    same(found[:, :2], expected[:, :2], 3e-5)
    same(found[:, 2:], expected[:, 2:], 3e-5)


# gravity_tilt


def test_gravity_tilt_is_what_a_tilted_yawing_container_feels(motion, integrated, same):
    """Tests the effect gravity_tilt against Rᵀ(a + gẑ) − gẑ from SciPy's rotations."""
    turning = motion()

    def felt(t):
        t = np.asarray(t)
        own = turning.attitude(t).inv().apply(turning.acceleration(t) + UP)
        return Rotation.from_rotvec([0.0, 0.0, turning.turn(t)]).apply(own) - UP

    at = slice(None, None, 50)
    modal = integrated(linear(felt), turning.t[at], rested(resting(turning, felt)))
    expected = in_container(modal, turning.turn(turning.t[at]))
    model = PLAIN.spatial().with_effect("gravity_tilt")
    same(heights(model, turning.inputs())[at], expected, 1e-5)
    # Rates play no part in it.
    same(heights(model, turning.inputs(angular_velocity=None))[at], expected, 1e-5)


def resting(turning, felt):
    """Returns the acceleration that acts on the liquid at the start, at rest."""
    assert not turning.acceleration(np.asarray(0.0)).any()
    return felt(0.0)


@pytest.mark.parametrize("pitch", [0.2, -0.3])
def test_liquid_in_a_tilted_cup_stands_level_from_the_start(pitch):
    """Tests that the liquid in a tilted cup is level from the start."""
    t = np.linspace(0.0, 1.0, 101)
    attitude = np.tile(Rotation.from_rotvec([0.0, pitch, 0.0]).as_quat(), (len(t), 1))
    still = Inputs(t, np.zeros((len(t), 3)), attitude)
    found = heights(PLAIN.with_effect("gravity_tilt"), still)
    assert found[:, 0] == pytest.approx(GAIN * GRAVITY * math.sin(pitch) / OMEGA**2, rel=1e-9)
    assert np.max(np.abs(found[:, 1])) < 1e-15
    # With the weaker gravity along its axis the spring is softer: the surface is a plane again.
    spatial = heights(PLAIN.spatial().with_effect("gravity_tilt"), still)[:, 0]
    assert spatial == pytest.approx(GAIN * GRAVITY * math.tan(pitch) / OMEGA**2, rel=1e-9)
    bent = heights(PLAIN.nonlinear().with_effect("gravity_tilt"), still)[:, 0]
    assert np.ptp(bent) < 1e-12
    assert bent[0] * pitch > 0.0


# static_tilt


def test_static_tilt_is_an_attitude_that_nobody_measured(motion):
    """Tests that static_tilt acts as an attitude that nobody measured."""
    turning = motion(tilt=0.0)
    roll, pitch = 0.12, -0.2
    tilt = Rotation.from_euler("YX", [pitch, roll])  # Ry(pitch) Rx(roll)
    inputs = turning.inputs()
    attitude = (turning.attitude(turning.t) * tilt).as_quat()
    known = heights(
        PLAIN.spatial().with_effect("gravity_tilt"),
        turning.inputs(attitude=attitude, angular_velocity=None),
    )
    found = heights(PLAIN.spatial().with_effect("static_tilt", roll=roll, pitch=pitch), inputs)
    assert np.max(np.abs(known)) > 0.01
    assert found == pytest.approx(known, abs=1e-8)


def test_settled_linear_liquid_stands_at_the_closed_form():
    t = np.linspace(0.0, 1.0, 11)
    still = Inputs(t, np.zeros((11, 3)))
    pitched = heights(PLAIN.with_effect("static_tilt", roll=0.0, pitch=0.1), still)
    assert pitched[-1, 0] == pytest.approx(GAIN * GRAVITY * math.sin(0.1) / OMEGA**2, rel=1e-9)
    # Gravity along the cup's axis is weaker: the spring, too.
    steep = heights(PLAIN.spatial().with_effect("static_tilt", roll=0.0, pitch=0.1), still)
    assert steep[-1, 0] == pytest.approx(GAIN * GRAVITY * math.tan(0.1) / OMEGA**2, rel=1e-9)
    rolled = heights(PLAIN.with_effect("static_tilt", roll=0.1, pitch=0.0), still)
    assert rolled[-1, 1] == pytest.approx(-GAIN * GRAVITY * math.sin(0.1) / OMEGA**2, rel=1e-9)


# lever_arm


@pytest.mark.parametrize(("rates", "within"), [("given", 1e-4), ("from the attitude", 5e-4)])
def test_lever_arm_is_the_acceleration_of_another_point_of_the_body(motion, same, rates, within):
    """Tests lever_arm against the numerical second derivative of the point's position."""
    turning, arm, h = motion(tilt=0.4), np.array([0.2, -0.1, 0.3]), 1e-3
    t = turning.t

    def place(moment):
        return turning.attitude(moment).apply(arm)

    near = place(t + h) + place(t - h)
    far = place(t + 2.0 * h) + place(t - 2.0 * h)
    second = (16.0 * near - far - 30.0 * place(t)) / (12.0 * h * h)
    point = turning.inputs(acceleration=turning.acceleration(t) + second)
    given = {} if rates == "given" else {"angular_velocity": None}
    model = PLAIN.spatial().with_effect("gravity_tilt")
    arms = dict(zip("xyz", arm.tolist(), strict=True))
    expected = heights(model, point)
    assert np.max(np.abs(expected - heights(model, turning.inputs()))) > 2e-3
    found = heights(model.with_effect("lever_arm", **arms), turning.inputs(**given))
    same(found, expected, within)


def test_on_a_turning_arm_the_liquid_climbs_the_outer_wall(same):
    """Tests that steady rotation on an arm raises the liquid at the outer wall."""
    rate, arm, zeta = 6.0, 0.3, 0.3
    t = np.arange(0.0, 4.0, 1e-3)
    spin = np.column_stack([np.zeros((len(t), 2)), np.full(len(t), rate)])
    inputs = Inputs(t, np.zeros((len(t), 3)), angular_velocity=spin)
    model = Model(CUP, damping_ratio=zeta).with_effect("lever_arm", x=arm, y=0.0, z=0.0)
    found = heights(model, inputs)[t > 3.5]
    answer = GAIN * rate**2 * arm / (OMEGA**2 - rate**2 + 2.0j * zeta * OMEGA * rate)
    assert answer.real > 0.01
    same(found[:, 0], np.full(len(found), answer.real), 1e-4)
    same(found[:, 1], np.full(len(found), answer.imag), 1e-4)
