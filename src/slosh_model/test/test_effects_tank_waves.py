"""Tests second- and third-order effects against potential flow in a rectangle."""

import itertools
import math

import numpy as np
import pytest

from slosh_base.compiled.compilation import uncompiled
from slosh_model.constants import GRAVITY
from slosh_model.effects.amplitude_stiffening import frequency_shift
from slosh_model.measure import measured_heights
from slosh_model.model import Model
from slosh_model.response import Response
from slosh_model.shapes.rectangle import Rectangle
from slosh_model.simulate import Inputs, State, simulate
from slosh_testing.multimodal import Tanks, simulate_tanks

WIDTH, DEPTH = 0.1, 0.08
STEP = 0.002
TIMES = np.arange(0.0, 3.0, STEP)
RAMP = np.minimum(TIMES, 1.0)
PUSH_X, PUSH_Y = 0.06 * RAMP * np.sin(15.0 * TIMES), 0.05 * RAMP * np.cos(17.0 * TIMES)
DAMPING = 0.03


# bound_modes


def bound(fill, wall_x, wall_y, azimuths):
    """Returns the heights that the effect adds to given first modes."""
    liquid = Response(
        TIMES,
        wall_x,
        wall_y,
        np.zeros((len(TIMES), 1, 4)),
        container=Rectangle(WIDTH, DEPTH, 0.05),
    )
    plain = Model(Rectangle(WIDTH, DEPTH, fill), damping_ratio=0.02)
    model = plain.with_effect("bound_modes", damping_ratio=DAMPING)
    return measured_heights(model, liquid, azimuths) - measured_heights(plain, liquid, azimuths)


@pytest.mark.parametrize("fill", [0.02, 0.04, 0.1])
def test_the_double_wave_is_that_of_the_second_order(fill):
    """Tests that the effect gives the second-order wave of potential flow."""
    tank = Tanks.of(WIDTH, fill, DAMPING / math.sqrt(2.0))  # mode n is damped by √n of the first
    flow = simulate_tanks(tank, PUSH_X[:, np.newaxis], STEP, order=2, modes=2)
    first, second = flow.amplitudes[:, 0].T
    # cos(πξ) is 1 at -x.
    added = bound(fill, -first, 0.0 * first, [0.0, math.pi, math.pi / 2.0])
    size = np.abs(second).max()
    assert size > 5e-6
    assert np.abs(added - second[:, np.newaxis] * [1.0, 1.0, -1.0]).max() < 0.015 * size


class Waves:
    """Second-order potential flow in two directions, with modes cos(mπξ)cos(nπυ).

    Zakharov's equations on a grid, every product taken where it is and projected.
    """

    ORDERS = ((1, 0), (0, 1), (2, 0), (0, 2), (1, 1))

    def __init__(self, fill):
        nodes = (np.arange(12) + 0.5) / 12
        m, n = np.array(self.ORDERS).T
        self.kx, self.ky = m * np.pi / WIDTH, n * np.pi / DEPTH
        wave = np.hypot(self.kx, self.ky)
        self.square, self.rate = wave**2, wave * np.tanh(wave * fill)
        x, y = (a.ravel() for a in np.meshgrid(nodes, nodes))
        cx, cy = np.cos(np.pi * np.outer(x, m)), np.cos(np.pi * np.outer(y, n))
        sx, sy = np.sin(np.pi * np.outer(x, m)), np.sin(np.pi * np.outer(y, n))
        self.shapes, self.slope_x, self.slope_y = cx * cy, -self.kx * sx * cy, -self.ky * cx * sy
        self.project = (self.shapes / (self.shapes**2).sum(axis=0)).T
        self.damping = np.where(m + n == 2, 2.0 * DAMPING * np.sqrt(GRAVITY * self.rate), 0.0)
        self.lever = np.array([-4.0 * WIDTH, -4.0 * DEPTH, 0.0, 0.0, 0.0]) / np.pi**2

    def rates(self, state, push_x, push_y):
        eta, psi = state
        height = self.shapes @ eta
        first = self.shapes @ (self.rate * psi)
        moved = self.project @ (height * first)
        second = height * (self.shapes @ (self.square * psi)) - self.shapes @ (self.rate * moved)
        drift_x, drift_y = self.slope_x @ psi, self.slope_y @ psi
        climb = drift_x * (self.slope_x @ eta) + drift_y * (self.slope_y @ eta)
        pressure = 0.5 * (first**2 - drift_x**2 - drift_y**2)
        push = np.array([push_x, push_y, 0.0, 0.0, 0.0])
        return np.stack(
            [
                self.rate * psi + self.project @ (second - climb),
                -GRAVITY * eta - push * self.lever - self.damping * psi + self.project @ pressure,
            ]
        )

    def simulate(self):
        """Returns modal amplitudes (N, 5) at TIMES."""
        state, found = np.zeros((2, 5)), np.zeros((len(TIMES), 5))
        pushes = np.stack([PUSH_X, PUSH_Y], axis=1)
        for i, (a, b) in enumerate(itertools.pairwise(pushes)):
            k1 = self.rates(state, *a)
            k2 = self.rates(state + 0.5 * STEP * k1, *(0.5 * (a + b)))
            k3 = self.rates(state + 0.5 * STEP * k2, *(0.5 * (a + b)))
            k4 = self.rates(state + STEP * k3, *b)
            state = state + STEP / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
            found[i + 1] = state[0]
        return found


@pytest.mark.parametrize("fill", [0.03, 0.1])
def test_waves_along_both_axes_drive_one_that_is_high_at_two_corners(fill):
    amplitudes = Waves(fill).simulate()
    corners = [math.atan2(DEPTH, WIDTH), math.pi - math.atan2(DEPTH, WIDTH), 0.0, math.pi / 2.0]
    added = bound(fill, -amplitudes[:, 0], -amplitudes[:, 1], corners)
    across, along, product = amplitudes[:, 2:].T
    expected = np.stack(
        [across + along + product, across + along - product, across - along, along - across],
        axis=1,
    )
    assert np.abs(product).max() > 5e-6
    assert np.abs(added - expected).max() < 0.02 * np.abs(expected).max()


def test_the_maximum_is_that_over_the_whole_wall():
    turn = np.random.default_rng(5)
    slow = [np.interp(TIMES, TIMES[::60], turn.normal(0.0, 0.012, 25)) for _ in "xy"]
    liquid = Response(
        TIMES, *slow, np.zeros((len(TIMES), 1, 4)), container=Rectangle(WIDTH, DEPTH, 0.05)
    )
    model = Model(Rectangle(WIDTH, DEPTH, 0.07)).with_effect("bound_modes", kappa=3.0)
    corner = math.atan2(DEPTH, WIDTH)
    turns = np.linspace(0.0, 2.0 * math.pi, 720, endpoint=False)
    corners = [corner, math.pi - corner, math.pi + corner, -corner]
    expected = measured_heights(model, liquid, np.concatenate([turns, corners])).max(axis=1)
    found = measured_heights(model, liquid)[:, 0]
    assert found == pytest.approx(expected, abs=1.5e-4)
    assert np.abs(found - liquid.msh).max() > 0.005


# amplitude_stiffening


def shift(times, heights, omega):
    """Returns Δ(ω²)/ω² of a wave from the times of its zero crossings."""
    down = np.flatnonzero((heights[:-1] > 0.0) & (heights[1:] <= 0.0))
    low, high = heights[down], heights[down + 1]
    moments = times[down] + (times[down + 1] - times[down]) * low / (low - high)
    return (2.0 * math.pi / np.diff(moments).mean() / omega) ** 2 - 1.0


@pytest.mark.first(1)
@pytest.mark.parametrize("relative", [pytest.param(0.4, marks=pytest.mark.long), 0.5, 1.0])
def test_a_free_wave_has_the_frequency_of_the_third_order(relative):
    fill, height = relative * WIDTH, 0.04 * WIDTH
    model = Model(Rectangle(WIDTH, DEPTH, fill), damping_ratio=0.0, modes=2)
    mode = model.mode_constants()[0]
    omega = mode.natural_frequency
    times = np.arange(0.0, 30.0 * 2.0 * math.pi / omega, 0.06 / omega)
    calm = np.zeros((len(times), 3))
    start = np.zeros((1, 6))
    start[0, 0] = height
    flow = simulate_tanks(
        Tanks.of(WIDTH, fill), calm[:, :1], times[1], order=3, modes=6, start=start
    )
    displaced = np.array([[height / mode.curved_gain, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0]])
    stiffened = model.with_effect("amplitude_stiffening")
    found = simulate(stiffened, Inputs(times, calm), State(0.0, displaced, np.zeros(4)))[0]
    expected = shift(times, flow.amplitudes[:, 0, 0], omega)
    assert shift(times, found.modal[:, 0, 0], omega) == pytest.approx(
        expected, abs=0.012 * (math.pi * height / WIDTH) ** 2
    )
    assert expected < -5e-4


def test_waves_stiffen_below_the_depth_that_the_literature_gives_and_soften_above():
    """Tests the depth at which waves turn from stiffening to softening (h/w = 0.3368)."""
    shift_at = uncompiled(frequency_shift)
    assert shift_at(0.336 * math.pi) > 0.0 > shift_at(0.338 * math.pi)
    assert shift_at(20.0) == pytest.approx(-0.25, abs=1e-12)
