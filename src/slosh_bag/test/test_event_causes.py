"""Tests which messages start an event: limits, disagreement, blindness, wrong calm."""

import math

import pytest

from slosh_bag.black_box.black_box import Cause
from slosh_bag.black_box.causes import WAITING, CalmWatch, ComparisonWatch, limit_happening
from slosh_msgs.msg import Calm, LimitEvent, SloshComparison

MS = 1_000_000
TOLERANCE = 0.001


class Watched:
    """Calm reports every 100 ms, with measured heights in between."""

    def __init__(self):
        self.watch, self.found = CalmWatch(), []

    def answer(self, at, *, reason=Calm.CALM):
        message = Calm(calm=reason == Calm.CALM, reason=reason, tolerance=TOLERANCE)
        self.found += self.watch.answer(message, at * MS)
        return self

    def height(self, at, height, stddev=0.0):
        self.found += self.watch.height("measured", at * MS, height, stddev)
        return self


def test_a_limit_is_an_event_where_it_begins_to_be_exceeded():
    event = LimitEvent(kind=LimitEvent.KIND_START, description="20 mm exceeded")
    assert limit_happening(event, 5) == (Cause.LIMIT, 5, "20 mm exceeded")
    event.source = LimitEvent.SOURCE_DISAGREEMENT
    assert limit_happening(event, 5).cause is Cause.DISAGREEMENT
    event.kind = LimitEvent.KIND_END
    assert limit_happening(event, 5) is None


def test_disagreement_and_blindness_are_events_where_they_begin():
    watch = ComparisonWatch()
    ok, blind = SloshComparison.STATE_OK, SloshComparison.STATE_BLIND
    course = [
        (ok, False),
        (blind, False),
        (blind, True),
        (blind, True),
        (ok, False),
        (blind, True),
    ]
    found = [
        [event.cause for event in watch.take(SloshComparison(state=s, sides_disagree=d), 0)]
        for s, d in course
    ]
    both = [Cause.DISAGREEMENT, Cause.BLIND]
    assert found == [[], [Cause.BLIND], [Cause.DISAGREEMENT], [], [], both]


def test_a_height_above_the_tolerance_of_a_calm_liquid_is_told_with_the_next_answer():
    run = Watched().answer(0).height(50, 0.004)
    assert not run.found  # the container may have begun to move
    (event,) = run.answer(100, reason=Calm.SETTLING).found
    assert (event.cause, event.stamp_ns) == (Cause.FALSE_CALM, 50 * MS)
    assert "within 1.0 mm, but the measured height was at least 4.0 mm" in event.text


@pytest.mark.parametrize("reason", [Calm.MOVING, Calm.STALE])
def test_a_motion_is_no_false_calm(reason):
    assert not Watched().answer(0).height(50, 0.004).answer(100, reason=reason).found
    assert not Watched().answer(0, reason=reason).height(50, 0.004).answer(100).found


@pytest.mark.parametrize(
    ("height", "stddev", "told"),
    [
        (0.0009, 0.0, False), (0.0014, 0.0003, False), (0.0014, 0.0001, True),
        (0.0014, math.nan, True), (math.nan, 0.0, False), (math.inf, 0.0, False),
    ],
)  # fmt: skip
def test_a_height_must_surely_exceed_the_tolerance(height, stddev, told):
    assert bool(Watched().answer(0).height(50, height, stddev).answer(100).found) is told


def test_a_late_camera_is_held_against_the_answer_of_its_moment():
    run = Watched().answer(0, reason=Calm.SETTLING).answer(100).answer(200)
    assert not run.height(50, 0.004).found
    assert len(run.height(150, 0.004).found) == 1


def test_a_height_from_before_all_answers_or_after_them_is_not_judged():
    assert not Watched().height(0, 0.004).answer(100).answer(200).found
    assert not Watched().answer(0).height(50, 0.004).found


def test_a_liquid_that_goes_on_being_called_calm_is_one_event_and_the_next_calm_another():
    run = Watched().answer(0)
    for k in range(1, 50):
        run.height(100 * k - 50, 0.004).answer(100 * k)
    assert len(run.found) == 1
    run.answer(5000, reason=Calm.SETTLING).answer(5100).height(5150, 0.004).answer(5200)
    assert len(run.found) == 2


def test_a_clock_that_is_set_back_and_an_estimator_that_is_silent_cost_no_memory():
    run = Watched().answer(10_000).height(10_050, 0.004).answer(0)
    assert not run.found
    for k in range(3 * WAITING):
        run.height(k, 0.004)
    assert len(run.watch._heights) == WAITING
    assert len(run.answer(1_000_000).found) == 1
