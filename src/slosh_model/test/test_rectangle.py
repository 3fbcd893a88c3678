"""Tests rectangles: constants, limits and TM20's models solved independently."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slosh_model.constants import GRAVITY
from slosh_model.containers import X_AXIS, Y_AXIS
from slosh_model.effects.registry import EFFECTS
from slosh_model.errors import SloshModelError
from slosh_model.model import Model
from slosh_model.self_test import example_parameters
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.shapes.rectangle import Rectangle
from slosh_model.simulate import Inputs, State, simulate
from slosh_testing.multimodal import Tanks, simulate_tanks
from slosh_testing.surface import rectangle_surface, sloshing_height

TM20_GEOMETRIES = {  # width [m]: ω₀ that TM20 identified [rad/s] (Tables 2 and 4)
    0.060: 22.498, 0.040: 27.347, 0.070: 21.001, 0.047: 25.351, 0.079: 19.622, 0.054: 23.729,
}  # fmt: skip
FILL, ZETA = 0.067, 0.04
TANK = Rectangle(0.06, 0.045, FILL)
M1 = Model(TANK, damping_ratio=ZETA)
OMEGA_X = math.sqrt(math.pi * GRAVITY / 0.06 * math.tanh(math.pi * FILL / 0.06))
OMEGA_Y = math.sqrt(math.pi * GRAVITY / 0.045 * math.tanh(math.pi * FILL / 0.045))
T = np.arange(0.0, 2.0, 1e-4)  # the straight lines between samples are the model's input
dimensions = st.floats(0.02, 1.0)


def push(t):
    """Returns a smooth spatial acceleration (..., 3) [m/s²]."""
    envelope = np.sin(np.pi * np.clip(t / 2.0, 0.0, 1.0)) ** 2
    columns = (2.0 * np.sin(17.0 * t), 1.5 * np.cos(23.0 * t + 0.4), 4.0 * np.sin(9.0 * t + 1.0))
    return np.stack(columns, axis=-1) * np.asarray(envelope)[..., np.newaxis]


def along_x(t):
    return push(t) * [1.0, 0.0, 0.0]


def run(model, acceleration=push, t=T):
    return simulate(model, Inputs(t, acceleration(t)))[0]


def constant(ax, ay=0.0, az=0.0):
    return lambda t: np.tile([ax, ay, az], (len(t), 1))


# ---- constants


@pytest.mark.parametrize(("width", "identified"), TM20_GEOMETRIES.items())
def test_natural_frequencies_are_those_of_tm20(width, identified):
    omega = Rectangle(width, 0.05, FILL).natural_frequency(1)
    equation_20 = math.sqrt(math.pi * GRAVITY / width * math.tanh(math.pi * FILL / width))
    assert omega == pytest.approx(equation_20, rel=1e-14)
    assert omega == pytest.approx(identified, rel=0.02)


@given(dimensions, dimensions, dimensions)
def test_sloshing_masses_and_the_one_that_stays_are_all_the_liquid(width, depth, fill):
    """Tests that sloshing masses and fixed mass add up to the mass of the liquid."""
    tank = Rectangle(width, depth, fill)
    odd = 2.0 * np.arange(1, 20001) - 1.0
    for axis, length in ((X_AXIS, width), (Y_AXIS, depth)):
        reach = odd * np.pi / (2.0 * fill) * length / 2.0
        fixed = np.sum(8.0 / (odd * np.pi) ** 2 * np.tanh(reach) / reach)
        moving = sum(tank.mass_ratio(n, axis) for n in range(1, 200))
        assert moving + fixed == pytest.approx(1.0, abs=1e-4)


def test_damping_is_that_of_the_boundary_layers():
    """Tests the damping against the energy lost in boundary layers in one period."""
    nu, tank = 1e-6, Rectangle(0.12, 0.05, 0.04)
    omega, k = tank.natural_frequency(1), math.pi / 0.12
    x, z = np.linspace(0.0, 0.12, 2001), np.linspace(-0.04, 0.0, 2001)
    u, w = np.cosh(k * (z + 0.04)), np.sinh(k * (z + 0.04))
    floor = 0.05 * np.trapezoid(np.sin(k * x) ** 2, x)
    ends = 2.0 * 0.05 * np.trapezoid(w**2, z)
    sides = 2.0 * 0.06 * np.trapezoid(u**2 + w**2, z)
    energy = 0.5 * 0.05 * 0.06 * np.cosh(k * 0.04) * np.sinh(k * 0.04) / k
    lost = 0.5 * math.sqrt(nu * omega / 2.0) * (floor + ends + sides)
    assert tank.damping_ratio(nu) == pytest.approx(lost / (2.0 * omega * energy), rel=1e-5)
    assert tank.damping_ratio(nu) == Rectangle(0.05, 0.12, 0.04).damping_ratio(nu)


@pytest.mark.parametrize(
    ("values", "named"),
    [
        ((6e-5, 0.05, 0.05), r"container.width = 6e-05 m must lie in \[0.0001, 10\] m"),
        ((0.05, 60.0, 0.05), "container.depth = 60.0 m must lie in"),
        ((0.05, 0.05, math.nan), "container.fill_height = nan m must lie in"),
        ((0.05, 0.05, 0.06, 0.05), "rim_height = 0.05 m must lie above fill_height = 0.06 m"),
    ],
)
def test_impossible_dimensions_are_named(values, named):
    with pytest.raises(SloshModelError, match=named):
        Rectangle(*values)


# ---- models against equations that are written here


def m1(model, a, p, omega):
    """Returns TM20's equation of θ, eqs. (9) and (10), along one axis."""
    spatial = model.has("vertical_acceleration")

    def derivative(t, s):
        stiffness = omega**2 * (1.0 + (push(t)[2] / GRAVITY if spatial else 0.0))
        return [s[1], -2.0 * ZETA * omega * s[1] - stiffness * s[0] + p * a(t)]

    return derivative


def pendulum(model, a, p, omega):
    """Returns TM20's pendulum equation of θ, eq. (6), along one axis."""
    spatial = model.has("vertical_acceleration")
    length = GRAVITY / omega**2

    def derivative(t, s):
        pull = GRAVITY + (push(t)[2] if spatial else 0.0)
        drag = 2.0 * ZETA * omega * math.cos(s[0]) ** 2 * s[1]
        return [s[1], -drag - pull / length * math.sin(s[0]) + p * a(t) * math.cos(s[0])]

    return derivative


MODELS = {
    "M1": (M1, m1, 1.0),
    "M1, vertical": (M1.spatial(), m1, 1.0),
    "M2": (M1.with_effect("accel_gain", gain=1.07), m1, 1.07),
    "pendulum": (M1.nonlinear(), pendulum, 1.0),
    "pendulum, vertical": (M1.nonlinear().spatial(), pendulum, 1.0),
}


@pytest.mark.parametrize("name", MODELS)
def test_agrees_with_tm20s_equations_integrated_elsewhere(name, integrated, same):
    model, equations, gain = MODELS[name]
    response = run(model)
    for axis, omega, heights in (
        (0, OMEGA_X, response.sh_x),
        (1, OMEGA_Y, response.sh_y),
    ):
        acceleration = lambda t, axis=axis: float(push(t)[axis])  # noqa: E731
        derivative = equations(model, acceleration, gain * omega**2 / GRAVITY, omega)
        theta = integrated(derivative, T, (0.0, 0.0))[:, 0]
        assert np.max(np.abs(theta)) > 0.1
        # θ > 0 where the liquid is high at the wall that the container leaves.
        same(-heights, theta * (TANK.width, TANK.depth)[axis] / 2.0, 1e-6)


def test_the_modes_are_those_of_the_flow_to_first_order(same):
    """Tests that the modes agree with potential flow to first order."""
    model = Model(TANK, damping_ratio=0.0, modes=3).spatial()
    t, x = np.arange(0.0, 1.0, 0.001), np.linspace(-0.5, 0.5, 21)
    moves = push(t)
    flow = simulate_tanks(
        Tanks.of(TANK.width, FILL), moves[:, :1], 0.001, vertical=moves[:, 2:], order=1, modes=5
    )
    response = run(model, lambda t: push(t) * [1.0, 0.0, 1.0], t)
    found = rectangle_surface(model, response.modal, x * TANK.width)
    same(found, flow.profile(x)[:, 0], 1e-5)


def test_a_yawing_tank_takes_its_waves_along(integrated, motion, same):
    moving = motion(tilt=0.0)
    inputs = moving.inputs()
    response, _ = simulate(M1, inputs)

    def derivative(t, s):
        turn = moving.turn(t)
        ax, ay, _ = moving.acceleration(np.asarray(t))
        c, sn = math.cos(turn), math.sin(turn)
        felt = (c * ax + sn * ay, c * ay - sn * ax)
        omega = (OMEGA_X, OMEGA_Y)
        pulled = [
            -felt[i] - 2.0 * ZETA * omega[i] * s[2 + i] - omega[i] ** 2 * s[i] for i in (0, 1)
        ]
        return [s[2], s[3], *pulled]

    expected = integrated(derivative, inputs.t)
    same(response.modal[:, 0, :2], expected[:, :2], 1e-6)
    same(response.sh_x, 0.03 * OMEGA_X**2 / GRAVITY * expected[:, 0], 1e-6)


# ---- limits and symmetries


@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
@settings(max_examples=20, deadline=None)
def test_a_static_tilt_stands_at_half_the_width_times_a_over_g(ax, ay):
    damped = dataclasses.replace(M1, damping_ratio=0.5)
    t = np.arange(0.0, 3.0, 0.002)
    response = run(damped, constant(ax, ay), t)
    assert response.sh_x[-1] == pytest.approx(-0.03 * ax / GRAVITY, abs=1e-9)
    assert response.sh_y[-1] == pytest.approx(-0.0225 * ay / GRAVITY, abs=1e-9)
    pendulous = run(damped.nonlinear(), constant(ax, ay), t)
    assert pendulous.sh_x[-1] == pytest.approx(-0.03 * math.atan(ax / GRAVITY), abs=1e-9)
    many = run(dataclasses.replace(damped, modes=60), constant(ax, ay), t)
    x, y = np.array([-0.02, 0.0, 0.01])[:, np.newaxis], np.array([-0.01, 0.015])
    expected = -(ax * x + ay * y) / GRAVITY
    found = rectangle_surface(dataclasses.replace(damped, modes=60), many.modal[-1], x, y)
    assert found == pytest.approx(expected, abs=1e-4)


@given(st.floats(0.02, 0.3), st.floats(0.02, 0.3), st.floats(0.02, 0.3), st.booleans())
@settings(max_examples=15, deadline=None)
def test_mirrored_and_turned_tanks_mirror_and_turn_their_waves(width, depth, fill, nonlinear):
    model = Model(Rectangle(width, depth, fill), damping_ratio=ZETA, modes=2).spatial()
    turned = dataclasses.replace(model, container=Rectangle(depth, width, fill))
    if nonlinear:
        model, turned = model.nonlinear(), turned.nonlinear()
    t = np.arange(0.0, 0.5, 0.002)
    found = run(model, push, t)
    mirrored = run(model, lambda t: push(t) * [-1.0, 1.0, 1.0], t)
    swapped = run(turned, lambda t: push(t)[:, [1, 0, 2]], t)
    assert np.array_equal(mirrored.sh_x, -found.sh_x)
    assert np.array_equal(mirrored.sh_y, found.sh_y)
    assert swapped.sh_x == pytest.approx(found.sh_y, rel=1e-9, abs=1e-12)
    assert swapped.msh == pytest.approx(found.msh, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("model", [M1, M1.nonlinear()], ids=["M1", "pendulum"])
def test_without_damping_energy_stays(model):
    undamped, t = dataclasses.replace(model, damping_ratio=0.0), np.arange(0.0, 10.0, 0.001)
    start = State(0.0, np.array([[0.005, 0.0, 0.0, 0.0]]), np.zeros(4))
    modal = simulate(undamped, Inputs(t, np.zeros((len(t), 3))), start, max_step=0.0005)[0].modal
    x, v = modal[:, 0, 0], modal[:, 0, 2]
    potential = 0.5 * OMEGA_X**2 * x**2
    if model.name == "2D-NL":
        length = GRAVITY / OMEGA_X**2
        potential = GRAVITY * length * (1.0 - np.cos(x / length))
    energy = 0.5 * v**2 + potential
    assert np.ptp(energy) < 1e-6 * energy[0]


# ---- heights on the wall


def test_along_one_axis_the_whole_side_is_highest():
    response = run(M1, along_x)
    assert np.array_equal(response.msh, np.abs(response.sh_x))
    assert set(np.round(response.azimuth[1:], 9)) == {0.0, round(math.pi, 9)}
    kind, heights = sloshing_height(response, along_x(T))
    assert kind == "SH"
    assert np.array_equal(np.abs(heights), response.msh)
    oblique = run(M1, lambda t: along_x(t) * 1.0 + along_x(t)[:, [1, 0, 2]])
    assert sloshing_height(oblique, along_x(T) + along_x(T)[:, [1, 0, 2]])[0] == "MSH"


# ---- one mechanism


def test_loss_of_liquid_is_that_of_both_axes(integrated, same):
    rate, tank = 0.01, Rectangle(0.12, 0.05, 0.05)
    model = Model(tank, damping_ratio=ZETA).with_effect("fill_loss", rate=rate)

    def derivative(t, s):
        slopes = []
        for axis, length in ((0, 0.12), (1, 0.05)):
            factor = math.pi / length * math.tanh(math.pi * (0.05 - rate * t) / length)
            omega = math.sqrt(GRAVITY * factor)
            drag = 2.0 * ZETA * omega * s[2 + axis]
            slopes.append(-drag - omega**2 * s[axis] - push(t)[axis])
        return [s[2], s[3], *slopes]

    expected = integrated(derivative, T)
    same(run(model).modal[:, 0, :2], expected[:, :2], 1e-6)
    deep = np.tanh(np.multiply.outer(0.05 - rate * T, [math.pi / 0.12, math.pi / 0.05]))
    same(run(model).sh_y, math.pi / 2.0 * deep[:, 1] * expected[:, 1], 1e-6)


@pytest.mark.parametrize(
    "name",
    [
        "anisotropic_stiffness",
        "sensor_tilt",
        "surface_nonlinearity",
        "visible_arc",
        "yaw_coupling",
    ],
)
def test_what_a_rectangle_cannot_have_is_refused(name):
    with pytest.raises(SloshModelError) as caught:
        M1.with_effect(name, **example_parameters(EFFECTS[name]))
    assert str(caught.value) == f"effect {name!r} is not for a rectangle"
    with pytest.raises(SloshModelError, match="effect 'pendulum_nonlinearity' is not for a cyl"):
        Model(Cylinder(0.05, 0.07)).with_effect("pendulum_nonlinearity")
