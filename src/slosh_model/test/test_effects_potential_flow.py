"""Tests second- and third-order effects against potential flow in a cylinder."""

import math

import numpy as np
import pytest
from cylinder_waves import CylinderWaves
from scipy.integrate import quad
from scipy.special import jnp_zeros, jv

from slosh_model.effects import bound_modes
from slosh_model.measure import measured_heights
from slosh_model.model import Model
from slosh_model.response import Response
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.simulate import Inputs, State, simulate

RADIUS = 0.05
TIMES = np.arange(0.0, 2.0, 0.002)
AZIMUTHS = np.linspace(0.0, 2.0 * math.pi, 24, endpoint=False)
PUSH = np.stack([0.4 * np.sin(14.0 * TIMES), 0.3 * np.cos(12.0 * TIMES)], axis=1)
PUSH *= np.minimum(TIMES, 1.0)[:, np.newaxis]


def test_potential_flow_of_the_first_order_is_the_linear_model_with_curved_modes():
    flow = CylinderWaves(RADIUS, 0.07, order=1, damping_ratio=0.02)
    found = flow.simulate(TIMES, PUSH)[:, flow.place(1, 1)]
    model = Model(Cylinder(RADIUS, 0.07), damping_ratio=0.02)
    push = np.column_stack([PUSH, np.zeros(len(TIMES))])
    expected = simulate(model, Inputs(TIMES, push))[0].modal[:, 0, 0]
    gain = model.mode_constants()[0].curved_gain
    assert found == pytest.approx(gain * expected, abs=1e-6 * np.abs(found).max() + 1e-7)


@pytest.mark.parametrize("m", [0, 2])
def test_overlaps_of_the_bound_modes(m):
    first, k = jnp_zeros(1, 1)[0], jnp_zeros(m, 1)[0]

    def shape(r):
        return jv(m, k * r) / jv(m, k)

    overlap = quad(lambda r: r * shape(r) * (jv(1, first * r) / jv(1, first)) ** 2, 0.0, 1.0)[0]
    square = quad(lambda r: r * shape(r) ** 2, 0.0, 1.0)[0]
    root, given = {
        0: (bound_modes.AXISYMMETRIC, bound_modes.OVERLAP_AXISYMMETRIC),
        2: (bound_modes.DOUBLE, bound_modes.OVERLAP_DOUBLE),
    }[m]
    assert root == pytest.approx(k, rel=1e-14)
    assert given == pytest.approx(0.5 * overlap / square, rel=1e-12)
    assert first == pytest.approx(bound_modes.FIRST, rel=1e-14)


@pytest.mark.first(1)
@pytest.mark.parametrize("fill", [0.02, 0.04, 0.07])
def test_bound_modes_are_those_of_the_second_order(fill):
    """Tests that the effect gives the second-order waves of potential flow."""
    damping = 0.05
    flow = CylinderWaves(RADIUS, fill, order=2, radial=1, damping_ratio=damping)
    amplitudes = flow.simulate(TIMES, 0.25 * PUSH)
    liquid = Response(
        TIMES,
        amplitudes[:, flow.place(1, 1)],
        amplitudes[:, flow.place(1, 1, odd=True)],
        np.zeros((len(TIMES), 1, 4)),
    )
    plain = Model(Cylinder(RADIUS, fill))
    model = plain.with_effect("bound_modes", damping_ratio=damping)
    rise = measured_heights(model, liquid, AZIMUTHS) - measured_heights(plain, liquid, AZIMUTHS)
    for label, found in {
        (0, False): rise.mean(axis=1),
        (2, False): 2.0 * (rise * np.cos(2.0 * AZIMUTHS)).mean(axis=1),
        (2, True): 2.0 * (rise * np.sin(2.0 * AZIMUTHS)).mean(axis=1),
    }.items():
        expected = amplitudes[:, flow.place(label[0], 1, odd=label[1])]
        size = np.abs(expected).max()
        assert size > 4e-6
        assert np.abs(found - expected).max() < 0.01 * size


def test_the_maximum_is_that_over_the_whole_wall():
    """Tests that the maximum height is taken over the whole wall."""
    turn = np.random.default_rng(3)
    slow = np.stack([np.interp(TIMES, TIMES[::40], turn.normal(0.0, 0.012, 25)) for _ in "xy"])
    liquid = Response(TIMES, slow[0], slow[1], np.zeros((len(TIMES), 1, 4)))
    model = Model(Cylinder(RADIUS, 0.07)).with_effect("bound_modes", kappa=3.0)
    fine = np.linspace(0.0, 2.0 * math.pi, 720, endpoint=False)
    expected = measured_heights(model, liquid, fine).max(axis=1)
    found = measured_heights(model, liquid)[:, 0]
    assert found == pytest.approx(expected, abs=3e-5)  # as fine as the places are
    assert (found > expected - 1e-9).all()
    assert np.abs(found - liquid.msh).max() > 0.005


# swirl_stiffening


def circling(model, share):
    """Returns frequency and state of a mass that circles at a share of the radius."""
    frequency = model.mode_constants()[0].natural_frequency
    gamma = model.acting["swirl_stiffening"]["gamma"]
    frequency /= math.sqrt(1.0 - gamma * share**2)
    return frequency, np.array([[share * RADIUS, 0.0, 0.0, share * RADIUS * frequency]])


def test_a_mass_that_circles_is_faster_and_stays_on_its_circle():
    model = Model(Cylinder(RADIUS, 0.07), damping_ratio=0.0).with_effect(
        "swirl_stiffening", gamma=2.0
    )
    frequency, modal = circling(model, 0.2)
    still = Inputs(TIMES, np.zeros((len(TIMES), 3)))
    response = simulate(model, still, State(0.0, modal, np.zeros(4)))[0]
    circle = np.stack([np.cos(frequency * TIMES), np.sin(frequency * TIMES)], axis=1)
    found = response.modal[:, 0, :2]
    assert found == pytest.approx(0.2 * RADIUS * circle, abs=1e-7)


def test_swirl_takes_no_energy_and_leaves_planar_waves_alone():
    plain = Model(Cylinder(RADIUS, 0.07), damping_ratio=0.0)
    model = plain.with_effect("swirl_stiffening")
    still = Inputs(TIMES, np.zeros((len(TIMES), 3)))
    omega = plain.mode_constants()[0].natural_frequency
    modal = np.array([[0.01, 0.004, -0.05, 0.2]])
    x, y, vx, vy = simulate(model, still, State(0.0, modal, np.zeros(4)))[0].modal[:, 0].T
    energy = vx**2 + vy**2 + omega**2 * (x**2 + y**2)
    assert energy == pytest.approx(energy[0], rel=1e-6)
    planar = State(0.0, np.array([[0.01, 0.005, 0.2, 0.1]]), np.zeros(4))
    assert simulate(model, still, planar)[0].modal == pytest.approx(
        simulate(plain, still, planar)[0].modal, abs=1e-12
    )


# quasi_static_modes


# surface_tension
