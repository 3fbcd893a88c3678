"""Tests effects on the liquid's motion against closed forms and other integrators."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import jnp_zeros

from slosh_model.constants import GRAVITY
from slosh_model.errors import SloshModelError
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.simulate import Inputs, State, simulate

RADIUS, FILL = 0.05, 0.07
CUP = Cylinder(RADIUS, FILL)
XI = jnp_zeros(1, 2)
ZETA = 0.02
PLAIN = Model(CUP, damping_ratio=ZETA)
UNDAMPED = Model(CUP, damping_ratio=0.0)


def omega(fill=FILL, n=1):
    return math.sqrt(GRAVITY * XI[n - 1] / RADIUS * math.tanh(XI[n - 1] * fill / RADIUS))


def gain(fill=FILL, n=1):
    """Returns the height gain 4 h mₙ/(m_F R) of a plane surface."""
    xi = XI[n - 1]
    return 8.0 * math.tanh(xi * fill / RADIUS) / (xi * (xi**2 - 1.0))


OMEGA = omega()


def free(seconds, step=1e-3, acceleration=(0.0, 0.0, 0.0)):
    t = np.arange(0.0, seconds, step)
    return Inputs(t, np.tile(acceleration, (len(t), 1)))


def aside(x=0.0, y=0.0, vx=0.0, vy=0.0, az=0.0):
    return State(0.0, np.array([[x, y, vx, vy]]), np.array([0.0, 0.0, az, 0.0]))


def modal(model, inputs, state=None, mode=0):
    return simulate(model, inputs, state)[0].modal[:, mode]


def pushed(motion):
    """Returns a motion without rotation, its inputs, and a slice of every 50th time."""
    only = motion(tilt=0.0, yaw=0.0)
    return only, only.inputs(attitude=None, angular_velocity=None), slice(None, None, 50)


def planar(extra, of, frequency=OMEGA, zeta=ZETA):
    """Returns the equations q̈ + 2ζωq̇ + ω²q + a + extra = 0 as a function of time."""

    def derivative(t, s):
        x, y, vx, vy = s
        a = of.acceleration(np.asarray(t))
        ex, ey = extra(t, x, y, vx, vy)
        fx = -2.0 * zeta * frequency * vx - frequency**2 * x - a[0] - ex
        fy = -2.0 * zeta * frequency * vy - frequency**2 * y - a[1] - ey
        return [vx, vy, fx, fy]

    return derivative


# vertical_acceleration


@pytest.mark.parametrize("az", [-0.5 * GRAVITY, 0.0, 0.8 * GRAVITY])
def test_vertical_acceleration_is_another_gravity(az):
    model = UNDAMPED.with_effect("vertical_acceleration")
    inputs = free(2.0, acceleration=(0.0, 0.0, az))
    found = modal(model, inputs, aside(x=0.01, y=-0.004, az=az))
    expected = np.cos(OMEGA * math.sqrt(1.0 + az / GRAVITY) * inputs.t)
    assert found[:, 0] == pytest.approx(0.01 * expected, abs=1e-7)
    assert found[:, 1] == pytest.approx(-0.004 * expected, abs=1e-7)


# surface_nonlinearity


@pytest.mark.parametrize("alpha", [0.0, 0.58, 2.5])
def test_surface_nonlinearity_is_the_mass_on_a_paraboloid(alpha, motion, integrated, same):
    """Tests the nonlinear model against DL22, eqs. (11), (14), as a 2×2 system."""
    only, inputs, at = pushed(motion)
    curvature = OMEGA**2 * RADIUS / GRAVITY

    def derivative(t, s):
        q, v = s[:2] / RADIUS, s[2:] / RADIUS
        a = only.acceleration(np.asarray(t))
        mass = np.eye(2) + curvature**2 * np.outer(q, q)
        stiffness = OMEGA**2 * (1.0 + a[2] / GRAVITY + alpha * q @ q)
        force = mass @ (2.0 * ZETA * OMEGA * v) + curvature**2 * q * (v @ v) + stiffness * q
        return [*s[2:], *(-RADIUS * np.linalg.solve(mass, force + a[:2] / RADIUS))]

    model = PLAIN.spatial().with_effect("surface_nonlinearity", alpha=alpha)
    response = simulate(model, inputs)[0]
    expected = integrated(derivative, inputs.t[at])
    same(response.modal[at, 0], expected, 1e-5)
    # The Bessel surface's height: ξ²hm/(m_F R).
    same(response.sh_x[at], gain() * XI[0] ** 2 / 4.0 * expected[:, 0], 1e-5)


# second_mode


def test_second_mode_is_an_oscillator_of_its_own(motion, integrated, same):
    only, inputs, at = pushed(motion)
    model = PLAIN.with_effect("second_mode", damping_ratio=0.05)
    response = simulate(model, inputs)[0]
    nothing = planar(lambda *_: (0.0, 0.0), only)
    first = integrated(nothing, inputs.t[at])
    own = planar(lambda *_: (0.0, 0.0), only, omega(n=2), 0.05)
    second = integrated(own, inputs.t[at])
    same(response.modal[at, 0], first, 1e-5)
    same(response.modal[at, 1], second, 1e-5)
    same(response.sh_x[at], gain() * first[:, 0] + gain(n=2) * second[:, 0], 1e-5)
    same(response.sh_y[at], gain() * first[:, 1] + gain(n=2) * second[:, 1], 1e-5)


# damping_mismatch


@pytest.mark.parametrize("factor", [0.9, 1.2])
def test_a_frequency_mismatch_is_another_frequency_that_was_measured(factor):
    effect = PLAIN.with_effect("frequency_mismatch", factor=factor)
    told = replace(PLAIN, natural_frequency=factor * PLAIN.mode_frequency(1))
    (found,), (expected,) = effect.mode_constants(), told.mode_constants()
    assert found.natural_frequency == pytest.approx(expected.natural_frequency, rel=1e-12)
    assert effect.height_gains() == pytest.approx(told.height_gains(), rel=1e-12)
    # A constant acceleration tilts the surface as before.
    assert effect.height_gains()[0] / found.natural_frequency**2 == pytest.approx(
        PLAIN.height_gains()[0] / PLAIN.mode_frequency(1) ** 2, rel=1e-12
    )


@pytest.mark.parametrize("factor", [0.0, 0.3, 4.0])
def test_damping_mismatch_is_a_faster_decay(factor):
    inputs = free(2.0)
    found = modal(PLAIN.with_effect("damping_mismatch", factor=factor), inputs, aside(x=0.01))
    zeta = factor * ZETA
    damped = OMEGA * math.sqrt(1.0 - zeta**2)
    expected = np.exp(-zeta * OMEGA * inputs.t) * (
        np.cos(damped * inputs.t) + zeta * OMEGA / damped * np.sin(damped * inputs.t)
    )
    assert found[:, 0] == pytest.approx(0.01 * expected, abs=1e-8)


# quadratic_damping


def amplitude(x, y, vx, vy):
    """Returns the additional damping of a high wave, for γ = 25."""
    return 2.0 * ZETA * OMEGA * 25.0 * (x * x + y * y) / RADIUS**2


def test_quadratic_damping_decays_as_one_over_time():
    """Tests the decay with quadratic damping: 1/A grows by 4βω/(3πR) per second."""
    beta, start = 0.2, 0.01
    inputs = free(8.0, 5e-4)
    x, _, vx, _ = modal(
        UNDAMPED.with_effect("quadratic_damping", beta=beta), inputs, aside(start)
    ).T
    amplitude = np.hypot(x, vx / OMEGA)
    expected = start / (1.0 + start * 4.0 * beta * OMEGA / (3.0 * math.pi * RADIUS) * inputs.t)
    assert expected[-1] < 0.5 * start
    assert amplitude == pytest.approx(expected, rel=0.02)


# amplitude_damping


@pytest.mark.parametrize(("round_", "share"), [(False, 0.25), (True, 1.0)])
def test_amplitude_damping_decays_as_its_envelope(round_, share):
    """Tests the decay with amplitude damping against its averaged envelope."""
    gamma, start = 40.0, 0.01
    model = Model(CUP, damping_ratio=0.004).with_effect("amplitude_damping", gamma=gamma)
    inputs = free(6.0, 5e-4)
    beginning = aside(start, vy=OMEGA * start) if round_ else aside(start)
    x, y, vx, vy = modal(model, inputs, beginning).T
    amplitude = np.sqrt((x**2 + y**2 + (vx**2 + vy**2) / OMEGA**2) / (2.0 if round_ else 1.0))
    rate, height = 0.004 * OMEGA, share * gamma * (start / RADIUS) ** 2
    faded = np.exp(-2.0 * rate * inputs.t)
    expected = start * np.sqrt(faded / (1.0 + height * (1.0 - faded)))
    assert amplitude == pytest.approx(expected, rel=0.01)
    # Not what the same damping does to low waves.
    assert expected[-1] < 0.9 * start * math.sqrt(faded[-1])


# contact_line_friction


def test_dry_friction_takes_the_same_off_each_swing():
    """Tests that dry friction reduces each half swing by 2μg/ω²."""
    mu, start = 0.002, 0.01
    inputs = free(2.0, 2e-4)
    x = modal(UNDAMPED.with_effect("contact_line_friction", mu=mu), inputs, aside(start))[:, 0]
    half = math.pi / OMEGA
    turns = np.arange(int(2.0 / half))
    swings = np.interp(turns * half, inputs.t, np.abs(x))
    loss = 2.0 * mu * GRAVITY / OMEGA**2
    assert loss * len(turns) > 0.1 * start
    assert np.diff(swings) == pytest.approx(-loss, rel=0.02)


# fill_level


@pytest.mark.parametrize("delta", [-0.045, 0.02])
def test_fill_level_is_another_container(delta, motion):
    _, inputs, _ = pushed(motion)
    base = PLAIN.nonlinear().spatial()
    found = simulate(base.with_effect("fill_level", delta=delta), inputs)[0]
    other = Model(Cylinder(RADIUS, FILL + delta), damping_ratio=ZETA).nonlinear().spatial()
    expected = simulate(other, inputs)[0]
    assert found.modal == pytest.approx(expected.modal, abs=1e-12)
    assert found.sh_x == pytest.approx(expected.sh_x, abs=1e-12)
    assert found.modal[-1, 0, 0] != simulate(base, inputs)[0].modal[-1, 0, 0]


def test_an_empty_cup_is_refused_in_one_line():
    with pytest.raises(SloshModelError, match="with its effects the model has") as caught:
        PLAIN.with_effect("fill_level", delta=-FILL)
    assert "\n" not in str(caught.value)


# fill_loss


def test_slow_loss_follows_the_adiabatic_invariant():
    """Tests a slow loss of liquid against the adiabatic invariant, energy over frequency."""
    rate = 5e-4
    cup = Model(Cylinder(RADIUS, 0.03), damping_ratio=0.0).with_effect("fill_loss", rate=rate)
    inputs = free(30.0, 2e-3)
    x = modal(cup, inputs, aside(0.01))[:, 0]
    frequency = np.array([omega(0.03 - rate * t) for t in inputs.t])
    phase = np.concatenate([[0.0], np.cumsum(0.5 * (frequency[1:] + frequency[:-1]) * 2e-3)])
    expected = 0.01 * np.sqrt(frequency[0] / frequency) * np.cos(phase)
    assert frequency[-1] < 0.85 * frequency[0]
    assert x == pytest.approx(expected, abs=2e-5)


def test_a_cup_that_has_run_empty_stays_finite():
    inputs = free(4.0)
    model = PLAIN.nonlinear().with_effect("fill_loss", rate=0.05)
    assert np.max(np.abs(modal(model, inputs, aside(0.005)))) < 0.2


# anisotropic_stiffness


@pytest.mark.parametrize("axis", [0.0, 0.7, 0.7 - math.pi, -1.9])
def test_anisotropic_stiffness_has_two_frequencies(axis):
    e = 0.2
    inputs = free(2.0)
    u, v = (math.cos(axis), math.sin(axis)), (-math.sin(axis), math.cos(axis))
    start = aside(0.01 * u[0] + 0.004 * v[0], 0.01 * u[1] + 0.004 * v[1])
    found = modal(UNDAMPED.with_effect("anisotropic_stiffness", e=e, axis=axis), inputs, start)
    stiff = 0.01 * np.cos(OMEGA * math.sqrt(1.0 + e) * inputs.t)
    soft = 0.004 * np.cos(OMEGA * math.sqrt(1.0 - e) * inputs.t)
    assert found[:, 0] * u[0] + found[:, 1] * u[1] == pytest.approx(stiff, abs=1e-7)
    assert found[:, 0] * v[0] + found[:, 1] * v[1] == pytest.approx(soft, abs=1e-7)


# yaw_coupling


def in_container(places, turn, size):
    c, s = np.cos(turn), np.sin(turn)
    x, y = size * places[:, 0], size * places[:, 1]
    return np.stack([c * x + s * y, c * y - s * x], axis=1)


@pytest.mark.parametrize("kappa", [-0.4, 0.3, 1.0])
def test_yaw_coupling_turns_place_and_velocity(kappa, motion, integrated, same):
    """Tests that yaw coupling rotates position and velocity of the liquid."""
    only = motion(tilt=0.0)
    plain = planar(lambda *_: (0.0, 0.0), only)

    def derivative(t, s):
        rate = kappa * only.yaw * (2.5 * math.cos(2.5 * t) + 0.8)
        dx, dy, dvx, dvy = plain(t, s)
        return [dx - rate * s[1], dy + rate * s[0], dvx - rate * s[3], dvy + rate * s[2]]

    inputs, at = only.inputs(), slice(None, None, 50)
    response = simulate(PLAIN.with_effect("yaw_coupling", kappa=kappa), inputs)[0]
    found = np.stack([response.sh_x, response.sh_y], axis=1)[at]
    expected = integrated(derivative, inputs.t[at])
    same(found, in_container(expected, only.turn(inputs.t[at]), gain()), 1e-5)


def test_liquid_that_is_dragged_wholly_lives_in_the_containers_axes(motion):
    """Tests that fully dragged liquid (κ = 1) moves as in a container without yaw."""
    only = motion(tilt=0.0, yaw=4.0)  # more than one turn
    inputs = only.inputs()
    own = only.attitude(inputs.t).inv().apply(only.acceleration(inputs.t))
    base = PLAIN.nonlinear().spatial()
    found = simulate(base.with_effect("yaw_coupling", kappa=1.0), inputs)[0]
    expected = simulate(base, Inputs(inputs.t, own))[0]
    assert np.max(np.abs(expected.sh_x)) > 0.005
    assert found.modal == pytest.approx(expected.modal, abs=1e-9)
    assert found.sh_y == pytest.approx(expected.sh_y, abs=1e-9)
