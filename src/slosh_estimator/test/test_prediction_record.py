"""Tests the outcomes of predictions."""

import math

import pytest

from slosh_estimator.agreement import MotionAgreement
from slosh_estimator.prediction_record import Announced, PredictionRecord

S = 1_000_000_000


def motion(start: float, lasts: float = 2.0, peak: float = 0.012) -> MotionAgreement:
    return MotionAgreement(
        round(start * S), round((start + lasts) * S), 60, 0.0, 0.0, peak, 0.001, peak + 0.0005
    )


def announced(
    number: int, stamp: float, start: float = 0.0, peak: float = 0.010, duration: float = 2.0
) -> Announced:
    return Announced(number, round(stamp * S), round(start * S), duration, peak)


def test_a_motion_is_judged_by_its_prediction():
    record = PredictionRecord()
    record.announce(announced(7, 10.0))
    outcome = record.judge(motion(11.0))
    assert outcome is not None
    assert (outcome.id, outcome.counted, outcome.count) == (7, True, 1)
    assert outcome.stamp_ns == 13 * S
    assert outcome.start_ns == 11 * S
    assert (outcome.predicted, outcome.measured, outcome.estimated) == (0.010, 0.012, 0.0125)
    assert outcome.error == pytest.approx(0.002)
    assert outcome.description == "predicted 10.0 mm, measured 12.0 mm"
    # A prediction is for one motion.
    assert record.judge(motion(20.0)) is None


def test_the_record_is_that_of_all_outcomes():
    record = PredictionRecord()
    assert math.isnan(record.sigma)
    for number, measured in enumerate((0.012, 0.008, 0.010)):
        record.announce(announced(number, 10.0 * number))
        outcome = record.judge(motion(10.0 * number + 1.0, peak=measured))
    assert outcome.count == 3
    assert outcome.sigma == pytest.approx(0.004 / 3)
    assert outcome.epsilon == pytest.approx((-0.002 / 0.012 + 0.002 / 0.008) / 3)
    assert outcome.worst == pytest.approx(0.002)
    record.reset()
    assert record.count == 0
    assert record.last is None
    assert math.isnan(record.epsilon)


def test_a_model_that_predicts_too_much_has_no_worst():
    record = PredictionRecord()
    record.announce(announced(1, 0.0))
    assert record.judge(motion(1.0, peak=0.009)).worst == 0.0


def test_another_motion_is_not_counted():
    record = PredictionRecord()
    record.announce(announced(1, 10.0, duration=5.0))
    outcome = record.judge(motion(11.0, lasts=2.0))
    assert not outcome.counted
    assert outcome.count == 0
    assert math.isnan(outcome.sigma)
    assert outcome.description.startswith("the motion lasted 2.0 s instead of 5.0 s")


def test_a_prediction_waits_for_its_own_moment():
    record = PredictionRecord()
    record.announce(announced(1, 10.0, start=30.0))
    record.announce(announced(2, 11.0, start=50.0))
    assert record.judge(motion(12.0)) is None
    assert record.judge(motion(30.2)).id == 1
    assert record.judge(motion(49.8)).id == 2


def test_of_plans_without_a_moment_the_newest_counts():
    record = PredictionRecord()
    record.announce(announced(1, 10.0))
    record.announce(announced(2, 10.5))
    assert record.judge(motion(11.0)).id == 2
    assert record.judge(motion(20.0)) is None


def test_a_refused_trajectory_is_no_prediction():
    record = PredictionRecord()
    record.announce(announced(1, 10.0, peak=math.nan))
    record.announce(announced(2, 10.0, peak=math.inf))
    assert record.judge(motion(11.0)) is None
