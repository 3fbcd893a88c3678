"""Tests potential flow in a rectangular tank: linear theory, limits and literature."""

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from slosh_model.constants import GRAVITY
from slosh_model.errors import SloshModelError
from slosh_testing.multimodal import Tanks, simulate_tanks

WIDTH, HEIGHT = 0.06, 0.067
WALLS = (-0.5, 0.5)
Array = NDArray[np.float64]


def sway(times: Array) -> Array:
    return np.asarray(1.5 * np.sin(9.0 * times) * np.exp(-times))[:, None]


def modal(mode: int, damping: float) -> tuple[float, float, float]:
    """Returns frequency, damping rate and drive of a mode in linear theory."""
    k = mode * math.pi / WIDTH
    frequency = math.sqrt(GRAVITY * k * math.tanh(k * HEIGHT))
    rate = 2.0 * damping * math.sqrt(mode) * frequency
    return frequency, rate, 4.0 * WIDTH / (mode * math.pi) ** 2 * k * math.tanh(k * HEIGHT)


@pytest.mark.first(1)
@pytest.mark.parametrize("mode", [1, 3, 5])
def test_the_first_order_is_linear_modal_theory(mode: int) -> None:
    times = np.arange(801) * 1e-3
    # Accelerations are linear between samples, as those of a table are.
    given_there = sway(times)[:, 0]
    frequency, rate, drive = modal(mode, 0.04)

    def rates(t: float, y: Any) -> list[float]:
        a = np.interp(t, times, given_there)
        return [y[1], -rate * y[1] - frequency**2 * y[0] + drive * a]

    truth = solve_ivp(
        rates, (0, times[-1]), [0, 0], "DOP853", times, rtol=1e-10, atol=1e-14, max_step=1e-3
    ).y[0]
    tanks = Tanks.of(WIDTH, HEIGHT, 0.04)
    found = simulate_tanks(tanks, sway(times), 1e-3, order=1, modes=9).amplitudes[:, 0, mode - 1]
    assert np.abs(found - truth).max() < 1e-6 * np.abs(truth).max()


def test_under_a_lasting_acceleration_the_surface_is_a_tilted_plane() -> None:
    times = np.arange(750) * 4e-3
    slow = 0.4 * np.minimum(times / 1.5, 1.0)[:, None]
    surfaces = simulate_tanks(Tanks.of(WIDTH, HEIGHT, 0.3), slow, 4e-3, order=2, modes=15)
    inner = np.linspace(-0.4, 0.4, 9)
    plane = -0.4 / GRAVITY * inner * WIDTH
    assert np.allclose(surfaces.profile(inner)[-1, 0], plane, atol=0.01 * 0.4 / GRAVITY * WIDTH)


@settings(max_examples=8)
@given(order=st.integers(1, 4), gain=st.floats(0.1, 1.0))
def test_a_mirrored_motion_gives_the_mirrored_surface(order: int, gain: float) -> None:
    a = gain * sway(np.arange(60) * 4e-3)
    tanks = Tanks.of([WIDTH, WIDTH], HEIGHT, 0.03)
    there, back = np.moveaxis(
        simulate_tanks(tanks, np.hstack((a, -a)), 4e-3, order=order, modes=5).profile(
            np.linspace(-0.5, 0.5, 11)
        ),
        1, 0,
    )  # fmt: skip
    assert np.allclose(there, back[:, ::-1], rtol=0.0, atol=1e-12)


def standing_wave(depth: float, steepness: float, order: int) -> tuple[Array, Array, float]:
    """Returns times, amplitudes and small-wave frequency of a free standing wave.

    It begins at rest with the second mode that belongs to it (Tadjbakhsh & Keller 1960).
    """
    k = math.pi / WIDTH
    height, tanh = steepness / k, math.tanh(k * depth)
    linear = math.sqrt(GRAVITY * k * tanh)
    times = np.arange(round(12 * 2 * math.pi / linear / 1e-3)) * 1e-3
    start = [[height, 0.125 * k * height**2 * (tanh + 3.0 / tanh**3), *(0.0,) * 7]]
    amplitudes = simulate_tanks(
        Tanks.of(WIDTH, depth), np.zeros((len(times), 1)), 1e-3,
        order=order, modes=9, start=start,
    ).amplitudes[:, 0]  # fmt: skip
    return times, amplitudes, linear


def standing_frequency(depth: float, steepness: float, order: int) -> float:
    """Returns the frequency of a standing wave relative to that of a very small one."""
    times, amplitudes, linear = standing_wave(depth, steepness, order)
    first = amplitudes[:, 0]
    falls = np.flatnonzero((first[:-1] > 0) & (first[1:] <= 0))
    crossings = times[falls] + 1e-3 * first[falls] / (first[falls] - first[falls + 1])
    period = (crossings[-1] - crossings[0]) / (len(crossings) - 1)
    return 2.0 * math.pi / period / linear


@pytest.mark.long
def test_a_steep_wave_in_deep_water_is_slower_by_an_eighth_of_its_steepness_squared() -> None:
    # Rayleigh 1915; Tadjbakhsh & Keller, J. Fluid Mech. 8, 1960.
    steepness = 0.1
    shift = standing_frequency(0.2, steepness, 3) - 1.0
    assert shift == pytest.approx(-(steepness**2) / 8.0, rel=0.03)


@pytest.mark.long
def test_at_the_critical_depth_the_frequency_does_not_depend_on_the_amplitude() -> None:
    # Tadjbakhsh & Keller 1960: soft springs become hard ones at a depth of 0.337 widths.
    def shift(depth: float) -> float:
        return standing_frequency(depth * WIDTH, 0.06, 3) - 1.0

    assert brentq(shift, 0.25, 0.45, xtol=2e-3) == pytest.approx(0.337, abs=0.01)


@pytest.mark.long
@pytest.mark.parametrize("depth", [0.35 * WIDTH, 0.9 * WIDTH])
def test_crests_are_sharper_than_troughs_by_the_bound_second_mode(depth: float) -> None:
    # Were it another than the literature's, it would beat with the free one.
    times, amplitudes, linear = standing_wave(depth, 0.05, 2)
    bound = amplitudes[0, 1]
    for half_periods in range(1, 7):
        there = np.interp(half_periods * math.pi / linear, times, amplitudes[:, 1])
        assert there == pytest.approx(bound, rel=0.03)


def test_orders_converge() -> None:
    a = sway(np.arange(300) * 2e-3)
    tanks = Tanks.of(WIDTH, HEIGHT, 0.03)
    walls = [
        simulate_tanks(tanks, a, 2e-3, order=order, modes=7).profile(WALLS)
        for order in range(1, 6)
    ]
    changes = [float(np.abs(b - a).max()) for a, b in pairwise(walls)]
    assert changes[1] < 0.5 * changes[0]
    assert changes[3] < 0.2 * changes[1]


def test_the_surface_tension_of_water_quickens_short_waves() -> None:
    k = 5 * math.pi / WIDTH
    start = np.zeros((1, 5))
    start[0, 4] = 1e-5
    times = np.arange(600) * 1e-3
    tanks = Tanks.of(WIDTH, HEIGHT, 0.0, 7.28e-5)
    fifth = simulate_tanks(tanks, 0.0 * sway(times), 1e-3, order=1, modes=5, start=start)
    frequency = math.sqrt((GRAVITY * k + 7.28e-5 * k**3) * math.tanh(k * HEIGHT))
    assert np.allclose(fifth.amplitudes[:, 0, 4], 1e-5 * np.cos(frequency * times), atol=1e-9)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"accelerations": np.full((5, 1), math.nan)}, "accelerations: sample 0 is not finite"),
        ({"accelerations": np.zeros((5, 3))}, r"accelerations: shape \(5, 3\)"),
        ({"accelerations": np.zeros((0, 1))}, "accelerations: shape"),
        ({"vertical": np.zeros((4, 1))}, "vertical: "),
        ({"interval": 0.0}, "interval = 0.0 s"),
        ({"order": 9}, "order = 9"),
        (
            {"accelerations": np.full((400, 1), 9.0), "order": 4},
            "tank 0: the surface is too steep",
        ),
    ],
)
def test_what_cannot_be_simulated_is_refused(change: dict[str, Any], words: str) -> None:
    given_there: dict[str, Any] = {"accelerations": np.zeros((5, 1)), "interval": 0.01, **change}
    with pytest.raises(SloshModelError, match=words):
        simulate_tanks(Tanks.of(WIDTH, HEIGHT), **given_there)


@pytest.mark.parametrize(
    ("dimensions", "words"),
    [
        ((math.nan, 0.067), "width"),
        ((0.06, -0.1), "fill_height"),
        ((0.06, 0.067, 2.0), "damping_ratio"),
        (([0.06, 0.07], [0.06, 0.07, 0.08]), "differ in number"),
    ],
)
def test_impossible_tanks_are_refused(dimensions: tuple[Any, ...], words: str) -> None:
    with pytest.raises(SloshModelError, match=words):
        Tanks.of(*dimensions)
