"""Tests which of the governor's last steps a late observed state belongs to."""

import numpy as np
import pytest

from slosh_plan.governor.past import PastLiquid
from slosh_plan.tuning import TUNING


def filled(stamps):
    """Returns the past of steps whose states and accelerations are their numbers."""
    past = PastLiquid(np.zeros((2, 3)))
    for number, stamp in enumerate(stamps):
        past.add(stamp, np.full((4, 5), number), np.full(3, number))
    return past


@pytest.mark.parametrize(("stamp", "count"), [(30, 1), (25, 1), (20, 2), (10, 3), (9, 0), (31, 0)])
def test_steps_at_or_after_a_moment_are_counted(stamp, count):
    assert filled([10, 20, 30]).since(stamp) == count


def test_nothing_is_known_before_the_first_step():
    assert filled([]).since(5) == 0


def test_states_and_later_accelerations_are_found_again_when_old_ones_are_overwritten():
    steps = TUNING.governor_past + 10
    past = filled(range(steps))
    assert past.since(9) == 0  # overwritten
    count = past.since(steps - 20)
    stores, felt = past.last(count)
    assert count == 20
    assert (stores == steps - 20).all()
    assert felt[:-1, 0].tolist() == list(range(steps - 19, steps))
    stores[:] = felt[:] = -1.0  # copies
    assert (past.last(count)[0] == steps - 20).all()


def test_steps_before_a_clock_that_went_back_are_not_counted_again():
    assert filled([10, 20, 30, 12, 22]).since(12) == 4
    assert filled([10, 40, 15, 50]).since(20) == 1
