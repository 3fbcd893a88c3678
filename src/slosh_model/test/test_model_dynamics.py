"""Tests the equations of motion: closed forms, invariants, order, derivation."""

import dataclasses
import math

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp

from slosh_model.constants import GRAVITY
from slosh_model.errors import SloshModelError
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.simulate import Inputs, State, simulate

CUP = Cylinder(0.05, 0.07)
OMEGA = CUP.natural_frequency(1)
MODELS = {
    "2D-L": Model(CUP, damping_ratio=0.01),
    "3D-L": Model(CUP, damping_ratio=0.01).spatial(),
    "2D-NL": Model(CUP, damping_ratio=0.01).nonlinear(),
    "3D-NL": Model(CUP, damping_ratio=0.01).spatial().nonlinear(),
}


def excitation(t):
    """Returns a smooth spatial acceleration (N, 3) [m/s²]."""
    t = np.asarray(t)
    envelope = np.sin(np.pi * np.clip(t / 2.0, 0.0, 1.0)) ** 2
    return np.stack(
        [
            3.0 * envelope * np.sin(11.0 * t),
            2.5 * envelope * np.cos(7.0 * t + 0.4),
            4.0 * envelope * np.sin(9.0 * t + 1.0),
        ],
        axis=-1,
    )


def inputs(t, acceleration=None):
    t = np.asarray(t, dtype=float)
    return Inputs(t, np.zeros((len(t), 3)) if acceleration is None else acceleration)


def start(x=0.0, y=0.0, vx=0.0, vy=0.0):
    return State(0.0, np.array([[x, y, vx, vy]]), np.zeros(4))


def lagrange_equations(*, nonlinear, spatial):
    """Returns ẍ, ÿ of one mode, derived from T, V, D of DL22 (8)-(10), (13) by SymPy.

    The linear model is their linearisation about rest. A function of x, y, ẋ, ẏ, ẍ0, ÿ0, z̈0.
    """
    t = sympy.Symbol("t")
    x, y, x0, y0, z0 = (sympy.Function(name)(t) for name in ("x", "y", "x0", "y0", "z0"))
    curvature = OMEGA**2 * CUP.radius / GRAVITY
    z = curvature / (2 * CUP.radius) * (x**2 + y**2)
    lift = z.diff(t) + (z0.diff(t) if spatial else 0)
    kinetic = ((x0 + x).diff(t) ** 2 + (y0 + y).diff(t) ** 2 + lift**2) / 2
    spring = 0.58 * OMEGA**2 / 4 * (x**2 + y**2) ** 2 / CUP.radius**2
    potential = GRAVITY * z + spring
    dissipation = 0.01 * OMEGA * (x.diff(t) ** 2 + y.diff(t) ** 2 + z.diff(t) ** 2)
    equations = [
        kinetic.diff(q.diff(t)).diff(t) - kinetic.diff(q) + potential.diff(q)
        + dissipation.diff(q.diff(t))
        for q in (x, y)
    ]  # fmt: skip
    unknown = sympy.symbols("ax ay")
    symbols = sympy.symbols("X Y VX VY AX0 AY0 AZ0")
    by_order = {
        **dict(zip((x.diff(t, 2), y.diff(t, 2)), unknown, strict=True)),
        **dict(zip((q.diff(t, 2) for q in (x0, y0, z0)), symbols[4:], strict=True)),
    }
    plain = [equation.doit().subs(by_order) for equation in equations]
    plain = [e.subs({x.diff(t): symbols[2], y.diff(t): symbols[3]}) for e in plain]
    plain = [e.subs({x: symbols[0], y: symbols[1]}) for e in plain]
    matrix, right = sympy.linear_eq_to_matrix(plain, unknown)
    accelerations = list(matrix.LUsolve(right))
    if not nonlinear:
        rest = dict.fromkeys(symbols[:4], 0)
        accelerations = [
            e.subs(rest) + sum(e.diff(q).subs(rest) * q for q in symbols[:4])
            for e in accelerations
        ]
    return sympy.lambdify(symbols, accelerations, "math", cse=True)


@pytest.mark.first(2)
@pytest.mark.parametrize("name", MODELS)
def test_agrees_with_lagranges_equations_integrated_elsewhere(name):
    model = MODELS[name]
    acceleration = lagrange_equations(nonlinear="NL" in name, spatial="3D" in name)

    def derivative(t, s):
        ax, ay = acceleration(*s, *excitation(t))
        return [s[2], s[3], ax, ay]

    # Dense samples: the straight lines between them are the model's input, not its error.
    t = np.linspace(0.0, 4.0, 40001)
    reference = solve_ivp(
        derivative, (0.0, 4.0), [0.0] * 4, "DOP853", t_eval=t[::10], rtol=1e-12, atol=1e-14,
        max_step=0.02,
    ).y.T  # fmt: skip
    response, _ = simulate(model, inputs(t, excitation(t)))
    difference = np.max(np.abs(response.modal[::10, 0] - reference), axis=0)
    scale = np.max(np.abs(reference), axis=0)
    assert np.all(scale[:2] > 0.005)
    assert np.max(difference / scale) < 1e-6


def test_linear_free_decay_is_the_closed_form():
    zeta, x0 = 0.05, 0.004
    t = np.linspace(0.0, 3.0, 1501)
    response, _ = simulate(Model(CUP, damping_ratio=zeta), inputs(t), start(x=x0))
    damped = OMEGA * math.sqrt(1.0 - zeta**2)
    expected = (
        x0
        * np.exp(-zeta * OMEGA * t)
        * (np.cos(damped * t) + zeta * OMEGA / damped * np.sin(damped * t))
    )
    assert np.max(np.abs(response.modal[:, 0, 0] - expected)) < 1e-8 * x0 / 1e-3


@pytest.mark.parametrize("ratio", [0.5, 0.9, 1.0, 1.5])
def test_linear_harmonic_response_is_the_closed_form(ratio):
    zeta, amplitude = 0.05, 0.5
    drive = ratio * OMEGA
    t = np.arange(0.0, 25.0, 0.001)
    forcing = np.zeros((len(t), 3))
    forcing[:, 1] = amplitude * np.sin(drive * t)
    response, _ = simulate(Model(CUP, damping_ratio=zeta), inputs(t, forcing))
    late = t > 20.0  # of the transient, e^(-ζωt), 6e-9 is left
    factor = -amplitude / (OMEGA**2 - drive**2 + 2.0j * zeta * OMEGA * drive)
    expected = (factor * np.exp(1j * drive * t)).imag
    difference = response.modal[late, 0, 1] - expected[late]
    # The straight lines between samples take (drive dt)²/12 off the sine.
    assert np.max(np.abs(difference)) < 1e-4 * abs(factor)


@pytest.mark.parametrize("name", MODELS)
def test_order_of_convergence_is_four(name):
    t = np.array([0.0, 0.5])
    held = np.array([[0.4, -0.3, 1.0], [-0.5, 0.6, -2.0]])
    begin = start(0.008, -0.004, 0.05, 0.1)
    steps = [0.5 / n for n in (32, 64, 128)]

    def end(step):
        return simulate(MODELS[name], inputs(t, held), begin, max_step=step * 1.0001)[1].modal

    exact = end(0.5 / 4096)
    errors = [np.linalg.norm(end(step) - exact) for step in steps]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders == pytest.approx([4.0, 4.0], abs=0.2)


@pytest.mark.parametrize("alpha", [0.0, 0.58, 2.0])
def test_nonlinear_energy_is_conserved_without_damping(alpha):
    model = Model(CUP, damping_ratio=0.0).with_effect("surface_nonlinearity", alpha=alpha)
    t = np.linspace(0.0, 20.0, 4001)
    modal = simulate(model, inputs(t), start(0.02, 0.0, 0.0, 0.3))[0].modal[:, 0]
    x, y, vx, vy = modal.T / CUP.radius
    curvature = OMEGA**2 * CUP.radius / GRAVITY
    kinetic = 0.5 * (vx**2 + vy**2 + curvature**2 * (x * vx + y * vy) ** 2)
    square = x**2 + y**2
    potential = 0.5 * OMEGA**2 * square + 0.25 * OMEGA**2 * alpha * square**2
    energy = kinetic + potential
    assert np.ptp(energy) < 1e-6 * energy[0]
    angular_momentum = x * vy - y * vx
    assert np.ptp(angular_momentum) < 1e-6 * abs(angular_momentum[0])


def test_faster_than_free_fall_the_liquid_leaves_its_place():
    """Tests that waves grow exponentially at a downward acceleration above g."""
    t = np.linspace(0.0, 0.2, 201)
    falling = np.zeros((len(t), 3))
    falling[:, 2] = -2.0 * GRAVITY
    model = Model(CUP, damping_ratio=0.0).spatial()
    begin = State(0.0, np.array([[1e-4, 0.0, 0.0, 0.0]]), np.array([0.0, 0.0, falling[0, 2], 0.0]))
    x = simulate(model, inputs(t, falling), begin)[0].modal[:, 0, 0]
    assert x == pytest.approx(1e-4 * np.cosh(OMEGA * t), rel=1e-7)


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize(
    ("model", "modes", "slope", "tolerance"),
    [
        (Model(CUP, damping_ratio=0.3), 1, 0.987, 5e-4),
        (Model(CUP, damping_ratio=0.3).nonlinear(), 1, 0.987 * 1.8412**2 / 4.0, 5e-4),
        (Model(CUP, damping_ratio=0.3), 40, 1.0, 2e-5),
        (Model(CUP, damping_ratio=0.3).nonlinear(), 40, 1.0, 6e-3),
    ],
)
def test_constant_acceleration_tilts_the_surface(model, modes, slope, tolerance, direction):
    """Tests that a constant acceleration tilts the surface by R·a/g at the wall."""
    a = 0.01
    t = np.linspace(0.0, 4.0, 401)
    held = np.zeros((len(t), 3))
    held[:, 1] = direction * a
    response, _ = simulate(dataclasses.replace(model, modes=modes), inputs(t, held))
    height = response.sh_y[-1] * GRAVITY / (CUP.radius * a)
    assert height == pytest.approx(-direction * slope, abs=tolerance)
    assert response.azimuth[-1] == pytest.approx(-direction * math.pi / 2.0)


@pytest.mark.parametrize(
    ("t", "row", "match"),
    [
        ([0.0, 1.0], [math.nan, 0.0, 0.0], r"acceleration\[1\]\.x = nan is not finite"),
        ([0.0, 1.0], [0.0, 0.0, -math.inf], r"acceleration\[1\]\.z = -inf is not finite"),
        ([0.0, 0.0], [0.0, 0.0, 0.0], r"t\[1\].*does not come after"),
        ([0.0, math.inf], [0.0, 0.0, 0.0], r"t\[1\] = inf is not finite"),
        ([0.0, 1.7e9], [0.0, 0.0, 0.0], r"t\[1\] = 1.7e\+09 s comes more than 3600 s after"),
        (["a", "b"], [0.0, 0.0, 0.0], "t is not an array of numbers"),
    ],
)
def test_bad_inputs_are_named(t, row, match):
    with pytest.raises(SloshModelError, match=match):
        Inputs(np.array(t), np.array([[0.0, 0.0, 0.0], row]))


def test_shapes_are_checked():
    with pytest.raises(SloshModelError, match="shape"):
        Inputs(np.zeros(3), np.zeros((3, 2)))
    with pytest.raises(SloshModelError, match="empty"):
        Inputs(np.zeros(0), np.zeros((0, 3)))
    with pytest.raises(SloshModelError, match="shape"):
        Inputs(np.zeros((2, 1)), np.zeros((2, 3)))
    with pytest.raises(SloshModelError, match="attitude has the shape"):
        Inputs(np.arange(2.0), np.zeros((2, 3)), np.zeros((2, 3)))


def test_a_solution_that_blows_up_is_an_error():
    t = np.linspace(0.0, 100.0, 101)
    falling = np.zeros((len(t), 3))
    falling[:, 0], falling[:, 2] = 1.0, -1e6
    with pytest.raises(SloshModelError, match="left the finite numbers"):
        simulate(Model(CUP).spatial(), inputs(t, falling), max_step=0.01)
