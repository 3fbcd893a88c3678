"""Tests the governor where the liquid is not known: starts, uneven steps, clocks, observers."""

import copy
import math

import numpy as np
import pytest

from slosh_governor.core import Command, Governor, ModelDoubt, SeenLiquid
from slosh_governor.core.cups import cups_of, reserve_of, steps_of, table_of
from slosh_governor.core.layout import PARTS_OF_ROW
from slosh_governor.core.unknown import Cause, UnknownWave, wave_heights
from slosh_model import Cylinder, Model, Simulator
from slosh_model.constants import GRAVITY
from slosh_model.tray import Tray, TrayContainer
from slosh_plan.errors import SloshPlanError
from slosh_plan.planning.limits import PlanLimits

PERIOD_NS = 10_000_000
LIMITS = PlanLimits(0.012, acceleration=6.0, jerk=74.0)
CUP = Model(Cylinder(0.05, 0.07)).with_effect("vertical_acceleration").nonlinear()
GAIN, OMEGA = CUP.height_gains()[0], CUP.mode_frequency(1)
STEEPEST = GRAVITY / OMEGA**2


def cups(model):
    return cups_of(Tray((TrayContainer("", model),)), LIMITS, turns=False)


def still(period_ns, modes=1):
    return SeenLiquid(period_ns, np.zeros((modes, 4)), 1e-4)


@pytest.mark.parametrize("rate", [20.0, 50.0, 100.0, 1000.0])
@pytest.mark.parametrize(
    ("radius", "modes"), [(0.035, 5), (0.02, 3), (0.003, 1), (0.05, 1), (0.2, 2)]
)
def test_a_crest_between_two_samples_is_never_missed(rate, radius, modes):
    """Each sample is at most 0.4 rad of the fastest mode away from the next one."""
    found = cups(Model(Cylinder(radius, 1.5 * radius), modes=modes))
    spacing = steps_of(found, 1.0 / rate) / rate
    parts = table_of(found, spacing, 0.03, turns=False)[0][0, PARTS_OF_ROW]
    phase = 1.03 * spacing * found[0].fastest / parts
    assert phase <= 0.4
    assert 0.04 < reserve_of(found, spacing, 0.03) == pytest.approx(1.04 / math.cos(phase / 2) - 1)
    assert reserve_of(found, spacing, 0.03) < 0.07


@pytest.mark.parametrize(("radius", "modes"), [(0.035, 5), (0.02, 3), (0.003, 1)])
def test_heights_of_high_modes_are_kept_at_a_low_rate(radius, modes):
    model = Model(Cylinder(radius, 1.5 * radius), modes=modes).nonlinear()
    limit = 0.25 * radius
    limits = PlanLimits(limit, acceleration=5.0, jerk=74.0)
    governor, liquid = Governor(model, limits, period=0.05, at_rest=True), Simulator(model)
    liquid.step(0.0, 0.0, 0.0, 0.0)
    before, highest = np.zeros(3), 0.0
    for step in range(120):
        now = 1 + step * 50_000_000
        speed = 0.5 * (-1.0) ** (step // 20) * (step < 100)
        governor.take(Command(now, (speed, 0.0, 0.0)))
        moved = governor.step(now)
        assert moved.safe
        assert 0.0 <= moved.peak <= limit
        for part in range(1, 51):
            row = before + (np.array(moved.acceleration) - before) * part / 50
            highest = max(highest, abs(liquid.step(0.001, *row.tolist())[0]))
        before = np.array(moved.acceleration)
    assert 0.3 * limit < highest <= limit


def test_a_frequency_error_between_whose_models_a_liquid_may_resonate_is_refused():
    assert ModelDoubt(0.1).frequency == 0.1
    with pytest.raises(SloshPlanError, match=r"frequency error = 0.11 must lie in 0 … 0.1"):
        ModelDoubt(0.11)


def test_a_governor_that_starts_is_not_safe_until_the_largest_wave_has_decayed():
    governor = Governor(CUP, LIMITS)
    moved = governor.idle(PERIOD_NS)
    assert not moved.safe
    assert moved.unknown == pytest.approx(STEEPEST, rel=0.01)
    assert moved.unknown_cause == Cause.START
    first = CUP.mode_constants()[0]
    slowest = 0.5 * 0.97 * first.damping_ratio * first.natural_frequency
    usable = math.log(STEEPEST / (0.5 * LIMITS.height)) / slowest
    assert 5.0 < usable < 60.0
    for seconds, safe in ((0.5 * usable, False), (1.05 * usable, True)):
        governor = Governor(CUP, LIMITS)
        governor.idle(PERIOD_NS)
        now = round(seconds * 1e9)
        governor.take(Command(now, (0.1, 0.0, 0.0)))
        moved = governor.step(now)
        assert (moved.safe, moved.unknown_since_ns) == (safe, PERIOD_NS)
        assert moved.share > 0.0  # it may move meanwhile
    assert Governor(CUP, LIMITS, at_rest=True).idle(PERIOD_NS).safe


@pytest.mark.parametrize("stepped", [0.3, 0.6, 1.0, 1.8, 4.0, -0.95])
def test_a_clock_that_steps_leaves_the_phase_of_the_wave_unknown(stepped):
    """The liquid goes on; what the governor computes is ahead or behind by the clock's step."""
    period, commands = 0.05, [0.3] * 9 + [-0.3] * 21
    told, heights = [], []
    for change in (0.0, stepped):
        governor = Governor(CUP, LIMITS, period=period, at_rest=True)
        for step, speed in enumerate(commands):
            now = round(1e9 * period * (20 + step + change * (step > 10)))
            governor.take(Command(now, (speed, 0.0, 0.0)))
            moved = governor.step(now)
            if step == 10:
                heights.append(wave_heights(governor._mechanics.first).max())
            if step == 13:
                told.append(moved)
    assert heights[0] == heights[1] > 0.2 * LIMITS.height
    assert told[0].unknown == 0.0
    turned = 2.0 * math.sin(0.5 * min(0.97 * OMEGA * period * abs(stepped), math.pi))
    assert told[1].unknown > 0.9 * turned * heights[0]
    assert told[1].unknown_cause in (Cause.LATE, Cause.CLOCK)


@pytest.mark.parametrize(
    ("back", "late"),
    [((0.45, 0.45), 0.0), ((0.3,) * 3, 0.0), ((0.2,) * 5, 0.0), ((0.1,) * 9, 0.0),
     ((0.6, 0.6), 0.0), ((0.5,) * 4, 0.0), ((0.5,), 0.5), ((0.3, 0.3), 0.5), ((0.7,), 1.2)],
)  # fmt: skip
def test_small_steps_of_a_clock_back_count_together(back, late):
    """The liquid goes on as long as a step is left out, or late and taken for one on time."""
    period, commands = 0.05, [0.3] * 9 + [-0.3] * 31
    governor = Governor(CUP, LIMITS, period=period, at_rest=True)
    clock, told, waves = 0.0, [], 0.0
    for step, speed in enumerate(commands):
        place, odd = divmod(step - 11, 2)
        clock -= back[place] if not odd and 0 <= place < len(back) else 0.0
        clock += late * (step == 12 + 2 * len(back))
        now = round(1e9 * period * (20 + step + clock))
        governor.take(Command(now, (speed, 0.0, 0.0)))
        told.append(governor.step(now).unknown)
        if step == 10:
            waves = wave_heights(governor._mechanics.first).max()
    assert told[10] == 0.0
    turned = 2.0 * math.sin(0.5 * min(0.97 * OMEGA * period * sum(back), math.pi))
    assert max(told) > 0.9 * turned * waves > 0.1 * LIMITS.height


def test_jitter_of_steps_that_are_late_and_in_time_again_does_not_grow():
    """Delays of the same size count when they are held, and once when they are made good."""
    rng, told = np.random.default_rng(0), []
    governor = Governor(CUP, LIMITS, period=0.05, at_rest=True)
    for step in range(400):
        now = round(1e9 * (1.0 + 0.05 * step + 0.0005 * rng.random()))
        speed = 0.3 * math.sin(0.4 * step)
        governor.take(Command(now, (speed, 0.0, 0.0)))
        told.append(governor.step(now).unknown)
    assert 0.0 < max(told) < 0.05 * LIMITS.height


@pytest.mark.parametrize("late", [0.3, 0.9, 1.5, 2.5, 6.0])
def test_a_late_step_in_a_stop_makes_it_little_longer(late):
    """The held velocity asks for another stop; what has become unknown does not."""
    governor, now = Governor(CUP, LIMITS, at_rest=True), 0
    for _ in range(60):
        now += PERIOD_NS
        governor.take(Command(now, (0.2, 0.0, 0.0)))
        begun = governor.step(now)
    told = copy.deepcopy(governor).stopped()
    governor.stop()
    gone = []
    while not governor.rests and len(gone) < 1000:
        now += PERIOD_NS + round(late * PERIOD_NS * (len(gone) == 2))
        gone.append(governor.step(now))
    held = 0.2 * late * 1e-9 * PERIOD_NS
    way, long = (one[-1].position[0] - begun.position[0] for one in (told, gone))
    assert long < 1.25 * way + held
    assert max(one.unknown for one in gone) > 0.0


def test_vertical_motion_pumps_an_unknown_wave_as_it_pumps_the_liquid():
    """Of all phases the highest wave is that of the bound."""
    model = Model(CUP.container, damping_ratio=1e-4, effects=CUP.effects, natural_frequency=OMEGA)
    unknown = UnknownWave(cups(model), ModelDoubt(0.0, 1.0))
    unknown.add(np.array([1e-4]), Cause.START)
    t = np.arange(2000) * 0.001
    vertical = 2.0 * np.cos(2.0 * OMEGA * t)
    waves = np.array([[math.cos(p), math.sin(p)] for p in np.linspace(0, np.pi, 60)])
    waves = 1e-4 * waves.T
    for az in vertical:
        unknown.advance(0.001, np.array([az]))
        soft = OMEGA * math.sqrt(1.0 + az / GRAVITY)
        c, s, k = math.cos(soft * 0.001), math.sin(soft * 0.001), soft / OMEGA
        waves = np.array([c * waves[0] + s / k * waves[1], c * waves[1] - s * k * waves[0]])
    highest = np.hypot(*waves).max()
    assert highest > 1.5e-4
    assert unknown.heights[0] == pytest.approx(highest, rel=0.01)


@pytest.mark.parametrize(
    "wrong",
    [
        {"stddev": -1.0}, {"stddev": math.nan}, {"frequency_factor": 0.0},
        {"frequency_factor": math.nan}, {"modal": np.full((1, 4), math.nan)},
        {"modal": np.full((1, 4), 1e300)}, {"modal": np.zeros((2, 4))}, {"stamp_ns": 0},
    ],
)  # fmt: skip
def test_an_impossible_observed_state_changes_nothing_and_is_named(wrong):
    told = []
    for given in (False, True):
        governor = Governor(CUP, LIMITS, at_rest=True)
        for step in range(1, 60):
            now = step * PERIOD_NS
            governor.take(Command(now, (0.3, 0.0, 0.0)))
            if given and step > 5:
                assert governor.see(still(now - 1)._replace(**wrong))
            told.append(governor.step(now))
    half = len(told) // 2
    assert [str(one) for one in told[:half]] == [str(one) for one in told[half:]]


def followed(change, seconds=3.0, uncorrected=0.0, **start):
    """Returns steps, and the true heights, of a governor whose observer tells `change`d states."""
    governor, liquid = Governor(CUP, LIMITS, **start), Simulator(CUP)
    liquid.step(0.0, 0.0, 0.0, 0.0)
    told, heights, states = [], [], []
    for step in range(1, round(100 * seconds)):
        now = step * PERIOD_NS
        speed = 0.3 * np.sign(np.sin(2.0 * step * 0.01))
        governor.take(Command(now, (speed, 0.5 * speed, 0.0)))
        states.append(liquid.modal)
        if len(states) > 15:
            seen = change(states)
            if seen is not None:
                assert governor.see(SeenLiquid(now, seen, 1e-4, uncorrected=uncorrected)) == ""
        told.append(governor.step(now))
        heights.append(math.hypot(*liquid.step(0.01, *told[-1].acceleration)[:2]))
    return told, np.array(heights)


LIES = {
    "0.1 s late": lambda states: states[-11],
    "mirrored": lambda states: states[-1] * [-1.0, 1.0, -1.0, 1.0],
    "turned": lambda states: states[-1][:, [1, 0, 3, 2]] * [-1.0, 1.0, -1.0, 1.0],
    "half": lambda states: 0.5 * states[-1],
    "frozen": lambda states: states[min(len(states) - 1, 30)],
}


@pytest.mark.parametrize("lie", LIES)
def test_an_observer_that_lies_cannot_replace_the_model(lie):
    told, heights = followed(LIES[lie], at_rest=True)
    assert heights.max() <= LIMITS.height
    # It enlarges what is possible, and is named.
    assert max(one.unknown for one in told) > 0.2 * LIMITS.height
    assert {one.unknown_cause for one in told} <= {"", str(Cause.FUSED)}
    assert any(not one.safe for one in told)


def test_an_observer_that_sees_the_liquid_ends_the_doubt_about_the_start():
    told, heights = followed(lambda states: states[-1])
    blind, _ = followed(lambda states: None)
    assert not blind[-1].safe
    assert blind[-1].unknown > 0.5 * LIMITS.height
    first = next(step for step, one in enumerate(told) if one.safe)
    assert 0.01 * first < 2.0
    assert told[-1].unknown < 0.1 * LIMITS.height
    assert heights.max() <= LIMITS.height


@pytest.mark.parametrize("uncorrected", [0.5, math.inf, math.nan])
def test_an_observer_without_measurements_does_not_end_the_doubt_about_the_start(uncorrected):
    """It is a model like the governor's: that both do alike proves nothing."""
    told, _ = followed(lambda states: states[-1], uncorrected=uncorrected)
    assert not any(one.safe for one in told)


@pytest.mark.parametrize("lie", LIES)
def test_an_observer_that_lies_does_not_end_the_doubt_about_the_start(lie):
    told, _ = followed(LIES[lie])
    assert not any(one.safe for one in told)


def test_a_late_step_enlarges_what_is_possible():
    governor, other = (Governor(CUP, LIMITS, at_rest=True) for _ in range(2))
    for step in range(1, 30):
        for one in (governor, other):
            one.take(Command(step * PERIOD_NS, (0.4, 0.0, 0.0)))
            moved = one.step(step * PERIOD_NS)
    assert moved.unknown == 0.0
    speed = 0.01 * abs(moved.acceleration[0])
    moved = governor.step(30 * PERIOD_NS + 15_000_000)
    # What the robot may have gone more or less in 15 ms, as a wave.
    assert moved.unknown >= 0.5 * 0.015 * speed * GAIN
    assert moved.unknown_cause == Cause.LATE
    assert other.step(30 * PERIOD_NS).unknown == 0.0


@pytest.mark.parametrize("jump", [10.0, -10.0, 0.5, -0.005, 1e6])
def test_after_a_clock_that_jumps_any_phase_of_the_wave_is_possible(jump):
    governor = Governor(CUP, LIMITS, at_rest=True)
    for step in range(1, 40):
        governor.take(Command(step * PERIOD_NS, (0.4, 0.0, 0.0)))
        governor.step(step * PERIOD_NS)
    moved = governor.step(39 * PERIOD_NS + round(jump * 1e9))
    assert moved.unknown_cause == Cause.CLOCK
    assert moved.unknown > 0.5 * LIMITS.height
    assert not moved.safe
