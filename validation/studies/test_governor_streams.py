"""Tests streams of governed liquids of every kind, and the independent liquid that judges them."""

import math

import governor_streams as study
import numpy as np
import pytest
from independent_liquid import GRAVITY, Liquids, Vessel

CUP, TANK = Vessel(0.06, radius=0.04), Vessel(0.05, width=0.1, depth=0.07)
REST = np.zeros(3)
SEEDS = {
    study.PLAIN: (16, 46), study.UNEVEN: (10, 18), study.CLOCK: (2, 16), study.NUMBERS: (6, 16),
    study.AGAIN: (2, 8), study.OTHER: (6, 10), study.KILLED: (6, 10), study.MOVING: (2, 18),
    study.SMALL: (8, 12), "observer: it stops at once": (42, 6),
    "observer: its images frozen": (2, 6), "its stddev −1": (6, 12), "its factor 0": (8, 12),
    "its stamps 0.1 s early": (2, 12),
    "its states at half scale": (8, 10), "its states frozen": (2, 6),
}  # fmt: skip
"""Streams of each kind; of those of others the first two."""


@pytest.mark.parametrize("vessel", [CUP, TANK], ids=["cup", "tank"])
def test_a_small_wave_oscillates_and_decays_as_its_mode(vessel: Vessel) -> None:
    factors = np.array([[1.0, 1.0], [1.1, 2.0]])
    liquids = Liquids(vessel, 0.01, factors)
    reach = vessel.radius or 0.5 * vessel.width
    xi = 1.8411837813406593 if vessel.radius else 0.5 * math.pi
    omega = math.sqrt(GRAVITY * xi / reach * math.tanh(xi * vessel.fill / reach))
    assert liquids.period == pytest.approx(2.0 * math.pi / omega, rel=1e-12)
    liquids.disturb(1e-5, 0.0, 0.0)
    assert liquids.height == pytest.approx(1e-5)
    start = liquids.place[:, 0].real.copy()
    liquids.move(1.0, REST, REST)
    for number, (frequency, damping) in enumerate(factors):
        w, zeta = omega * frequency, 0.01 * damping
        damped = w * math.sqrt(1.0 - zeta**2)
        left = math.exp(-zeta * w) * (math.cos(damped) + zeta * w / damped * math.sin(damped))
        assert liquids.place[number, 0].real / start[number] == pytest.approx(left, abs=2e-4)


@pytest.mark.parametrize("vessel", [CUP, TANK], ids=["cup", "tank"])
@pytest.mark.parametrize("frequency", [0.95, 1.0])
def test_a_constant_acceleration_holds_the_surface_normal_to_gravity(
    vessel: Vessel, frequency: float
) -> None:
    liquids = Liquids(vessel, 0.3, np.array([[frequency, 1.0]]))
    steady = np.array([0.02, 0.0, 0.0])
    liquids.move(4.0, steady, steady)
    reach = vessel.radius or 0.5 * vessel.width
    # The first mode of a round cup is higher at the wall than a plane: ξ²h m/(m_F R) R/(ω²…).
    xi = 1.8411837813406593
    shape = 2.0 / (xi**2 - 1.0) if vessel.radius else 1.0
    assert liquids.height == pytest.approx(shape * reach * 0.02 / GRAVITY, rel=1e-3)


@pytest.mark.parametrize("kind", study.KINDS)
def test_no_liquid_exceeds_its_limit_while_the_governor_says_safe(kind: str) -> None:
    """Runs streams that exceed it where the governor believes what it does not know."""
    told = [study.run(kind, seed) for seed in SEEDS.get(kind, (0, 2))]
    ran = [one for one in told if not one.refused]
    assert ran
    assert max(one.safe for one in ran) <= 1.0
    # A governor that is never safe would pass; one that never moves, too.
    assert max(one.share for one in ran) > 0.0


def test_a_clock_that_steps_by_a_period_is_not_safe() -> None:
    assert study.run(study.CLOCK, 6).safe <= 1.0
