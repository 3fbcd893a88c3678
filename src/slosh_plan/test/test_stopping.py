from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from slosh_model import Inputs, simulate
from slosh_plan import LiquidState, stopping
from slosh_plan.errors import SloshPlanError
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.stopping import NoSafeStopError, safe_stop
from slosh_plan.tuning import TUNING

LIMITS = PlanLimits(0.015, 0.015, 9.5, 74.0)
# The cup of conftest: R 50, h 70 mm, ζ 0.01.
XI, GRAVITY, ALPHA, ZETA, RADIUS, FILL = 1.8411837813406593, 9.81, 0.58, 0.01, 0.05, 0.07
DEPTH = np.tanh(XI * FILL / RADIUS)
OMEGA = np.sqrt(GRAVITY * XI / RADIUS * DEPTH)
GAIN = XI**2 * FILL / RADIUS * 2.0 * RADIUS * DEPTH / (XI * FILL * (XI**2 - 1.0))


def heights_of(stop, modal, after=2.5):
    """Returns maximum heights [m] by DL22's eqs. (11), (14) from a state, at 1 kHz."""
    motion, c2 = stop.trajectory, (OMEGA**2 * RADIUS / GRAVITY) ** 2

    def rate(now, state):
        a = [np.interp(now, motion.t, column, right=0.0) for column in motion.acceleration.T]
        q, v = state[:2], state[2:]
        bar = q / RADIUS
        pull = 2.0 * ZETA * OMEGA * c2 * bar @ v + c2 * v @ v / RADIUS
        pull += OMEGA**2 * ALPHA * bar @ bar * RADIUS
        force = -2.0 * ZETA * OMEGA * v - OMEGA**2 * (1.0 + a[2] / GRAVITY) * q
        force = force - np.array(a[:2]) - pull * bar
        return [*v, *np.linalg.solve(np.eye(2) + c2 * np.outer(bar, bar), force)]

    t = np.arange(round((stop.duration + after) * 1000) + 1) / 1000
    found = solve_ivp(rate, (0.0, t[-1]), modal, "DOP853", t, rtol=1e-8, atol=1e-10, max_step=0.01)
    return GAIN * np.hypot(found.y[0], found.y[1])


def live(cup, phase=0.3):
    """Returns the state of a cup after some acceleration."""
    t = np.arange(0.0, 0.5 + phase, 0.001)
    acceleration = np.zeros((len(t), 3))
    acceleration[:, 0] = 1.5 * np.sin(np.pi * t / 0.5) ** 2 * (t < 0.5)
    models = (cup.linear(), cup)
    linear, nonlinear = (simulate(one, Inputs(t, acceleration))[1].modal for one in models)
    return LiquidState(linear, nonlinear)


@pytest.mark.first(1)
@pytest.mark.parametrize("phase", [0.05, 0.12, 0.2, 0.3])
@pytest.mark.parametrize("speed", [0.3, 0.8])
def test_a_stop_keeps_every_limit_by_another_integrator(cup, phase, speed):
    state = live(cup, phase)
    velocity, acceleration = np.array([speed, 0.05, 0.02]), np.array([0.4, 0.2, 0.0])
    stop = safe_stop(cup, velocity, LIMITS, acceleration=acceleration, state=state)
    motion = stop.trajectory
    heights = heights_of(stop, state.nonlinear[0])
    assert heights.max() <= LIMITS.height * 1.001
    assert heights.max() == pytest.approx(stop.peak, rel=1e-3)
    # From how it moves now to rest, by rows of a millisecond.
    assert np.diff(motion.t) == pytest.approx(1e-3, abs=1e-9)
    assert motion.acceleration[0] == pytest.approx(acceleration, abs=1e-12)
    assert motion.acceleration[-1] == pytest.approx([0.0] * 3, abs=1e-12)
    change = np.trapezoid(motion.acceleration, motion.t, axis=0)
    assert change == pytest.approx(-velocity, abs=1e-4)
    assert np.gradient(motion.position, motion.t, axis=0)[1] == pytest.approx(velocity, abs=2e-3)
    assert np.linalg.norm(motion.acceleration, axis=1).max() <= LIMITS.acceleration
    steps = np.linalg.norm(np.diff(motion.acceleration, axis=0), axis=1)
    assert steps.max() <= 0.074 * (1.0 + 1e-9)
    # How far it goes.
    direction = velocity / np.linalg.norm(velocity)
    assert stop.distance == pytest.approx(motion.position[-1] @ direction, abs=1e-9)
    assert (np.diff(motion.position @ direction) >= -1e-9).all()
    assert 0.0 < stop.sideways < 0.01
    assert stop.quickest <= stop.duration


def test_the_liquid_costs_time_and_a_wave_that_helps_costs_less(cup):
    velocity = [0.8, 0.0, 0.0]
    at_rest = safe_stop(cup, velocity, LIMITS)
    assert at_rest.duration > 1.3 * at_rest.quickest
    durations = [
        safe_stop(cup, velocity, LIMITS, state=live(cup, phase)).duration
        for phase in (0.05, 0.12, 0.2, 0.3)
    ]
    assert max(durations) > min(durations)
    higher = safe_stop(cup, velocity, replace(LIMITS, height=0.03, residual=0.03))
    assert higher.duration < at_rest.duration


def test_no_stop_is_said(cup, monkeypatch):
    monkeypatch.setattr(stopping, "TUNING", replace(TUNING, longest_stop=1.0))
    state = live(cup, 0.05)
    with pytest.raises(NoSafeStopError, match=r"no stop of up to 1 s keeps 15 mm, .* found is"):
        safe_stop(cup, [0.5, 0.0, 0.0], replace(LIMITS, residual=1e-5), state=state)


@pytest.mark.parametrize(
    ("velocity", "changes", "text"),
    [
        ([0.0, 0.0, 0.0], {}, "does not move"),
        ([0.1, np.nan, 0.0], {}, "velocity must be three finite numbers"),
        ([0.1, 0.0], {}, "velocity must be three"),
        ([0.1, 0.0, 0.0], {"acceleration": [20.0, 0.0, 0.0]}, "accelerates with 20 m/s² already"),
        ([0.1, 0.0, 0.0], {"state": LiquidState(np.ones((1, 4)), np.ones((1, 4)))}, "begins"),
        ([0.1, 0.0, 0.0], {"state": LiquidState(np.zeros((2, 4)), np.zeros((2, 4)))}, "2 modes"),
    ],
)
def test_what_cannot_be_stopped_is_refused(cup, velocity, changes, text):
    with pytest.raises(SloshPlanError, match=text):
        safe_stop(cup, velocity, LIMITS, **changes)
