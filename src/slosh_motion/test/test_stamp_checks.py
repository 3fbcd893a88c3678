"""Tests the comparison of stamps with log times."""

import numpy as np
import pytest

from slosh_motion.checks.stamp_checks import StampUnit, stamp_doubts

BEGIN = 1_700_000_000_000_000_000
RATES = [10.0, 20.0, 50.0, 100.0, 125.0, 250.0, 500.0, 1000.0]


def recorded(seed):
    """Returns honest stamps and log times [ns]: uneven, lost, late, with stalls and an offset."""
    draw = np.random.default_rng(seed)
    rate = draw.choice(RATES)
    t = np.arange(int(rate * draw.uniform(1.0, 20.0))) / rate
    t = t + draw.uniform(0.0, draw.choice([0.0, 0.1, 0.5]), len(t)) / rate
    t = t[draw.random(len(t)) > draw.choice([0.0, 0.01, 0.2])]
    logs = t + draw.exponential(draw.choice([1e-5, 1e-3, 5e-3]), len(t))
    for begin in draw.uniform(0.0, t[-1], draw.integers(0, 4)):
        end = begin + draw.choice([0.02, 0.1, 0.5])
        logs[(logs > begin) & (logs < end)] = end
    logs = np.maximum.accumulate(logs)
    stamps = t * (1.0 + draw.uniform(-1e-4, 1e-4)) + draw.choice([0.0, 0.3, -5.0])
    return nanoseconds(stamps), nanoseconds(logs)


def nanoseconds(seconds):
    return np.rint(1e9 * np.asarray(seconds)).astype(np.int64) + BEGIN


@pytest.mark.parametrize("seed", range(60))
def test_honest_stamps_are_not_blamed(seed):
    assert stamp_doubts(*recorded(seed), "poses") == ()


def even(rate=100.0, seconds=5.0):
    logs = np.arange(int(rate * seconds)) / rate
    return logs, nanoseconds(logs + 0.002 * np.sin(70.0 * logs))


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize(
    ("factor", "word"),
    [(0.5, "at a rate that is not real"), (1.25, "at a rate that is not real"),
     (1.1, "at a rate that is not real"), (1000.0, "in another unit"), (1e-3, "in another unit")],
)  # fmt: skip
def test_stamps_that_run_at_another_rate_are_named(rate, factor, word):
    t, logs = even(rate)
    (doubt,) = stamp_doubts(nanoseconds(factor * t), logs, "poses")
    assert word in doubt
    advanced = float(doubt.partition("advance by ")[2].split()[0])
    assert advanced == pytest.approx(factor * (t[-1] - t[0]), rel=2e-3)
    assert doubt.wrong


@pytest.mark.parametrize("step", [0.03, -0.02, 1.0])
@pytest.mark.parametrize("rate", [50.0, 125.0, 500.0])
def test_a_clock_that_was_set_is_named_with_the_step(rate, step):
    t, logs = even(rate)
    (doubt,) = stamp_doubts(nanoseconds(t + step * (t > 2.0)), logs, "poses")
    assert f"step by {1e3 * step:+.0f} ms, 2.0" in doubt
    assert doubt.wrong


def test_one_stamp_for_all_is_named():
    t, logs = even()
    (doubt,) = stamp_doubts(nanoseconds(0.0 * t), logs, "poses")
    assert "have the same stamp" in doubt


def test_a_simulated_clock_is_no_fault_but_told():
    t, logs = even()
    (doubt,) = stamp_doubts(nanoseconds(0.5 * t) - BEGIN + 10**9, logs, "poses")
    assert "a simulated clock" in doubt
    assert not doubt.wrong
    assert stamp_doubts(nanoseconds(t) - BEGIN + 10**9, logs, "poses") == ()


@pytest.mark.parametrize(
    ("unit", "word"), [(1, "always 0"), (1_000, "milliseconds"), (1_000_000, "microseconds")]
)
@pytest.mark.parametrize("rate", [20.0, 125.0, 500.0])
def test_a_fraction_in_another_unit_is_named(rate, unit, word):
    t, logs = even(rate)
    stamps = nanoseconds(t)
    seconds, fractions = np.divmod(stamps, 10**9)
    wrong = seconds * 10**9 + (0 if unit == 1 else fractions * unit // 10**9)
    (doubt,) = stamp_doubts(wrong, logs, "poses")
    assert word in doubt
    assert "in ns" in doubt


@pytest.mark.parametrize("rate", [1.0, 2.0, 1000.0])
def test_stamps_at_whole_seconds_and_within_the_first_second_are_no_fault(rate):
    unit = StampUnit()
    for stamp in (BEGIN + np.arange(60) * round(1e9 / rate)).tolist():
        unit.take(stamp)
        assert unit.text == ""
