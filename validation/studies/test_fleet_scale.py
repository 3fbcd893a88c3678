"""Tests that generated bags have different motions, and limits of the simulated scaling."""

import pytest
from fleet_bags import MOTIONS, make_bag
from fleet_scale import simulated

from slosh_fleet.motions.motions import motions_of


def test_generated_bags_hold_motions_of_their_own(tmp_path):
    bags = [make_bag(number, tmp_path) for number in (0, 6)]  # of the same recording
    rows = [row for bag in bags for row in motions_of(bag)]
    assert len(rows) == 2 * MOTIONS
    assert len({row.digest for row in rows}) == 2 * MOTIONS
    assert len({round(row.nonlinear_peak, 9) for row in rows}) == 1
    before = sorted(tmp_path.rglob("*"))
    make_bag(0, tmp_path)
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize("workers", [1, 8, 64])
def test_a_free_scheduler_is_linear_and_a_slow_one_sets_the_pace(workers):
    tasks = [0.1] * 6400
    assert simulated(tasks, workers, 0.0, apart=True) == pytest.approx(1.0)
    cost = 0.05
    bound = min(1.0, 0.1 / (workers * cost))
    assert simulated(tasks, workers, cost, apart=True) == pytest.approx(bound, rel=0.02)


def test_several_items_a_task_keep_more_workers_busy():
    items, cost = [0.07] * 64 * 200, 0.004
    assert simulated(items, 64, cost, apart=True) < 0.35
    assert simulated(items, 64, cost) > 0.85
    assert simulated(items, 2, cost) > 0.99
