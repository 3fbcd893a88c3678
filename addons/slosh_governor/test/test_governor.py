"""Tests the governor: limits with wrong models, and stops if command or clock fail."""

import copy
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slosh_governor.core import (
    Command,
    Governor,
    GovernorState,
    ModelDoubt,
    SeenLiquid,
    StopReason,
)
from slosh_model import Cylinder, Inputs, Model, Rectangle, simulate
from slosh_plan.errors import SloshPlanError
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.planning.time_law import PlannedMotion
from slosh_testing.planned_equations import AGREE, planned_heights

PERIOD_NS = 10_000_000
LIMITS = PlanLimits(0.012, acceleration=6.0, jerk=74.0)
CUP = Model(Cylinder(0.05, 0.07)).with_effect("vertical_acceleration").nonlinear()
TANK = Model(Rectangle(0.1, 0.07, 0.08)).with_effect("vertical_acceleration").nonlinear()


def run(governor, commands, start=1):
    """Returns the governor's steps for rows of velocities; None means no command."""
    moved = []
    for step, row in enumerate(commands, start):
        now = step * PERIOD_NS
        if row is not None:
            governor.take(Command(now, tuple(float(value) for value in row)))
        moved.append(governor.step(now))
    return moved


def stopped(governor, moved):
    """Returns the governor's steps until it rests, without commands."""
    found = list(moved)
    while found[-1].rest > 0.0 or found[-1].state is not GovernorState.RESTING:
        found += run(governor, [None], len(found) + 1)
        assert len(found) < len(moved) + 200
    return found


def jumps(seed, count=250):
    """Returns random velocities with jumps [m/s], sometimes zero."""
    rng = np.random.default_rng(seed)
    rows, row = [], np.zeros(3)
    for _ in range(count):
        if rng.random() < 0.04:
            row = rng.normal(size=3) * [0.4, 0.4, 0.15] * (rng.random() < 0.8)
        rows.append(row)
    return rows


@pytest.mark.parametrize("held", [1, 2, 8])
def test_a_command_that_begins_gently_is_followed(held):
    """Commands of 100, 50 and 12.5 Hz, from rest to 0.3 m/s in 2 s."""
    governor = Governor(CUP, LIMITS, at_rest=True)
    speeds = 0.3 * np.linspace(0.0, 1.0, 200) ** 2
    rows = [(speeds[n], 0.0, 0.0) if n % held == 0 else None for n in range(len(speeds))]
    moved = run(governor, rows)
    assert moved[-1].velocity[0] > 0.9 * speeds[-held]
    assert all(one.safe for one in moved)


def as_planned(moved):
    """Converts governed steps to a motion at 1 kHz, for the independent equations."""
    t = np.arange(len(moved) * 10 + 1) / 1000.0
    rows = np.concatenate([np.zeros((1, 3)), [one.acceleration for one in moved]])
    acceleration = np.column_stack(
        [np.interp(t, 0.01 * np.arange(len(rows)), column) for column in rows.T]
    )
    return PlannedMotion(t, np.zeros_like(acceleration), acceleration, np.zeros(len(t)))


@pytest.mark.parametrize("model", [CUP, TANK], ids=["cup", "tank"])
@pytest.mark.parametrize("seed", [1, 3])
def test_heights_keep_the_limit_by_another_integrator(model, seed):
    governor = Governor(model, LIMITS, at_rest=True)
    moved = stopped(governor, run(governor, jumps(seed)))
    assert all(one.safe for one in moved)
    heights = planned_heights(model.container, as_planned(moved))
    assert 0.5 * LIMITS.height < heights.max() <= LIMITS.height * (1.0 + AGREE)
    # Without a limit of the height the same commands spill.
    free = Governor(model, PlanLimits(1.0, acceleration=6.0, jerk=74.0), at_rest=True)
    heights = planned_heights(model.container, as_planned(run(free, jumps(seed))))
    assert heights.max() > 2.0 * LIMITS.height


@settings(max_examples=8, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    frequency=st.floats(-0.03, 0.03),
    damping=st.floats(-1.0, 1.0),
    limit=st.floats(0.004, 0.02),
)
def test_every_motion_keeps_its_limits_for_other_liquids(seed, frequency, damping, limit):
    limits = PlanLimits(limit, acceleration=4.0, jerk=60.0)
    governor = Governor(CUP, limits, at_rest=True)
    moved = stopped(governor, run(governor, jumps(seed, 150)))
    first = CUP.mode_constants()[0]
    other = Model(
        CUP.container,
        damping_ratio=first.damping_ratio * 2.0**damping,
        natural_frequency=first.natural_frequency * (1.0 + frequency),
        effects=CUP.effects,
    )
    motion = as_planned(moved)
    inputs = Inputs(np.arange(len(motion.acceleration)) / 1000.0, motion.acceleration)
    assert simulate(other, inputs)[0].msh.max() <= limit
    acceleration = np.array([one.acceleration for one in moved])
    assert np.linalg.norm(acceleration, axis=1).max() <= 4.0 * (1.0 + 1e-6)
    jerk = np.linalg.norm(np.diff(acceleration, axis=0, prepend=np.zeros((1, 3))), axis=1) / 0.01
    assert jerk.max() <= 60.0 * (1.0 + 1e-6)
    # Velocity and position are those of the acceleration; it ends at rest.
    before = np.concatenate([np.zeros((1, 3)), acceleration[:-1]])
    velocity = np.cumsum(0.005 * (before + acceleration), axis=0)
    assert np.array([one.velocity for one in moved]) == pytest.approx(velocity, abs=1e-5)
    assert moved[-1].velocity == (0.0, 0.0, 0.0)
    assert moved[-1].position != (0.0, 0.0, 0.0)


def test_a_slow_command_is_followed_whole_and_a_fast_one_in_part():
    slow = run(Governor(CUP, LIMITS, at_rest=True), [(0.02, 0.0, 0.0)] * 100)
    assert {one.state for one in slow} == {GovernorState.FOLLOWING}
    assert slow[-1].velocity[0] == pytest.approx(0.02, abs=1e-6)
    fast = run(Governor(CUP, LIMITS, at_rest=True), [(0.6, 0.0, 0.0)] * 200)
    assert {one.state for one in fast} >= {GovernorState.FOLLOWING, GovernorState.LIMITED}
    assert fast[-1].velocity[0] == pytest.approx(0.6, abs=0.06)
    assert max(one.peak for one in fast) <= LIMITS.height
    # A model that is sure needs no margin for others, and is not slower.
    sure = run(
        Governor(CUP, LIMITS, doubt=ModelDoubt(0.0, 1.0), at_rest=True), [(0.6, 0.0, 0.0)] * 200
    )
    assert np.mean([one.margin for one in sure]) < 0.6 * np.mean([one.margin for one in fast])
    assert sure[60].position[0] > fast[60].position[0]


def test_a_target_is_reached():
    governor = Governor(CUP, LIMITS, at_rest=True)
    for step in range(400):
        target = (1.0, 2.0, 0.5) if step < 10 else (1.2, 2.0, 0.6)
        governor.take(Command(step * PERIOD_NS, target=target))
        moved = governor.step((step + 1) * PERIOD_NS)
    assert moved.position == pytest.approx((0.2, 0.0, 0.1), abs=1e-3)


def fails(kind):
    """Returns the commands up to a fault at step 60, and the expected reason to stop."""
    rows = [(0.4, 0.0, 0.0)] * 60
    if kind == "silence":
        return rows + [None] * 200, StopReason.SILENT
    if kind == "NaN":
        return rows + [(0.4, math.nan, 0.0)] + [(0.4, 0.0, 0.0)] * 30 + [
            None
        ] * 170, StopReason.INVALID
    return rows + [(400.0, 0.0, 0.0)] * 200, StopReason.FAST


@pytest.mark.parametrize("kind", ["silence", "NaN", "unit"])
def test_it_stops_to_rest_without_a_usable_command(kind):
    rows, reason = fails(kind)
    governor = Governor(CUP, LIMITS, at_rest=True)
    moved = run(governor, rows)
    begun = next(step for step, one in enumerate(moved) if one.reason is reason)
    assert 60 <= begun <= 75
    states = [one.state for one in moved[begun:]]
    assert states[0] is GovernorState.STOPPING
    rest = states.index(GovernorState.RESTING)
    assert 0.01 * rest <= moved[begun - 1].rest + 0.011
    assert moved[begun + rest].velocity == (0.0, 0.0, 0.0)
    # The next usable command moves it again, from rest.
    again = run(governor, [(0.1, 0.0, 0.0)] * 50, len(moved) + 1)
    assert again[-1].velocity[0] > 0.01
    assert again[-1].reason is StopReason.NONE


@pytest.mark.parametrize(
    ("age", "reason"),
    [
        (0.0, StopReason.NONE), (0.1, StopReason.NONE), (-0.1, StopReason.NONE),
        (0.12, StopReason.STAMP), (3.0, StopReason.STAMP), (-0.12, StopReason.STAMP),
        (-6.0, StopReason.STAMP), (None, StopReason.NONE),
    ],
)  # fmt: skip
def test_a_command_that_was_old_when_it_came_or_is_of_the_future_is_a_stop(age, reason):
    governor = Governor(CUP, LIMITS, at_rest=True)
    start = 1_000
    run(governor, [(0.3, 0.0, 0.0)] * 40, start)
    now = (start + 40) * PERIOD_NS
    sent = 0 if age is None else now - round(1e9 * age)
    governor.take(Command(sent, (0.3, 0.0, 0.0)))
    moved = governor.step(now)
    assert moved.reason is reason
    assert moved.age == pytest.approx(math.nan if age is None else age, nan_ok=True)
    # A command that is in force grows old by the timeout from when it came.
    assert run(governor, [None] * 5, start + 41)[-1].reason is reason
    again = run(governor, [(0.3, 0.0, 0.0)] * 100, start + 46)
    assert again[-1].reason is StopReason.NONE
    assert again[-1].velocity[0] > 0.1


@pytest.mark.parametrize("jump_ns", [50 * PERIOD_NS, -PERIOD_NS, 0])
def test_a_clock_that_is_late_stands_still_or_goes_back_is_a_stop(jump_ns):
    governor = Governor(CUP, LIMITS, at_rest=True)
    run(governor, [(0.3, 0.0, 0.0)] * 40)
    now = 40 * PERIOD_NS + jump_ns
    governor.take(Command(now, (0.3, 0.0, 0.0)))
    moved = governor.step(now)
    assert (moved.state, moved.reason) == (GovernorState.STOPPING, StopReason.LATE)


def test_a_requested_stop_lasts_until_it_is_released():
    governor = Governor(CUP, LIMITS, at_rest=True)
    moved = run(governor, [(0.3, 0.0, 0.0)] * 40)
    governor.stop()
    assert not governor.release()
    moved += run(governor, [(0.3, 0.0, 0.0)] * 200, 41)
    assert (moved[-1].state, moved[-1].reason) == (GovernorState.RESTING, StopReason.REQUESTED)
    assert governor.release()
    moved += run(governor, [(0.3, 0.0, 0.0)] * 20, 241)
    assert moved[-1].velocity[0] > 0.02
    assert moved[-1].reason is StopReason.NONE


def test_a_copy_tells_how_it_will_stop():
    governor = Governor(CUP, LIMITS, at_rest=True)
    begun = run(governor, [(0.4, 0.2, 0.0)] * 30)
    told = copy.deepcopy(governor).stopped()
    governor.stop()
    moved = run(governor, [(0.4, 0.2, 0.0)] * len(told), 31)
    assert [one.acceleration for one in told] == [one.acceleration for one in moved]
    assert moved[-1].state is GovernorState.RESTING
    # Quicker stops are looked for on the way.
    assert 0.2 < 0.01 * len(told) <= begun[-1].rest + 0.01


def test_an_observed_state_near_the_models_is_taken_and_adds_its_distance():
    truth = Model(CUP.container, natural_frequency=CUP.mode_frequency(1) * 1.02,
                  effects=CUP.effects)  # fmt: skip
    governor = Governor(CUP, LIMITS, at_rest=True)
    moved = run(governor, [(0.3, 0.0, 0.0)] * 150)
    rows = np.concatenate([np.zeros((1, 3)), [one.acceleration for one in moved]])
    response, _ = simulate(truth, Inputs(0.01 * np.arange(151), rows))
    assert moved[-1].liquid_ns == 0
    assert moved[-1].unknown == 0.0
    # 30 ms late: of after 147 steps.
    governor.see(SeenLiquid(147 * PERIOD_NS + 1, response.modal[147], 1e-5, 1.02, 0.0))
    (after,) = run(governor, [(0.3, 0.0, 0.0)], 151)
    assert after.liquid_ns == 147 * PERIOD_NS + 1
    # The eight liquids already comprise this one, but for what lies between two of them.
    assert 0.0 < after.unknown < 0.05 * LIMITS.height


@pytest.mark.parametrize(
    ("limits", "options", "text"),
    [
        (PlanLimits(math.inf), {}, "needs a limit of the height"),
        (LIMITS, {"period": 0.2}, "period = 0.2 s must lie in"),
        (LIMITS, {"period": math.nan}, "period = nan"),
    ],
)
def test_what_cannot_be_governed_is_refused(limits, options, text):
    with pytest.raises(SloshPlanError, match=text):
        Governor(CUP, limits, **options)
    with pytest.raises(SloshPlanError, match="frequency error = 3"):
        ModelDoubt(frequency=3.0)
    with pytest.raises(SloshPlanError, match=r"damping factor = 0\.5"):
        ModelDoubt(damping=0.5)


@pytest.mark.parametrize("period", [0.001, 0.004, 0.02])
def test_it_keeps_the_limit_at_any_rate(period):
    governor = Governor(CUP, LIMITS, period=period, at_rest=True)
    moved, step_ns = [], round(period * 1e9)
    count = round(0.6 / period)
    for step in range(1, count + 1):
        governor.take(Command(step * step_ns, (0.4, -0.2, 0.0)))
        moved.append(governor.step(step * step_ns))
    moved += governor.stopped()
    rows = np.concatenate([np.zeros((1, 3)), [one.acceleration for one in moved]])
    times = period * np.arange(len(rows))
    inputs = Inputs(times, rows).resampled(np.arange(0.0, times[-1], 0.002))
    assert simulate(CUP, inputs)[0].msh.max() <= LIMITS.height
    assert moved[-1].acceleration == (0.0, 0.0, 0.0)


def test_equal_inputs_give_equal_bits():
    one, other = (run(Governor(CUP, LIMITS, at_rest=True), jumps(5)) for _ in range(2))
    assert [m[:-1] for m in one if not math.isnan(m.age)] == [
        m[:-1] for m in other if not math.isnan(m.age)
    ]
