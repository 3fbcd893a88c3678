"""Tests the division of items among tasks: all of them once, long enough, and balanced."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slosh_bringup.task_batches import TASK_SECONDS, Batches


def worked(durations, workers, *, cost=0.0, sizes=None):
    """Simulates workers that take tasks in turn; returns the tasks' items and each one's end."""
    batches, free, tasks = Batches(durations, sizes), [0.0] * workers, []
    while batch := batches.take(workers):
        seconds = sum(duration for _, duration in batch)
        number = free.index(min(free))
        free[number] += cost + seconds
        batches.learn(batch, seconds)
        tasks.append(batch)
    return tasks, free


@given(
    st.lists(st.tuples(st.floats(0.0, 5.0), st.floats(0.0, 1e9)), max_size=80),
    st.integers(1, 70),
)
def test_each_item_is_in_one_task_in_its_order(items, workers):
    durations = [duration for duration, _ in items]
    tasks, _ = worked(durations, workers, sizes=[size for _, size in items])
    assert [one for batch in tasks for one in batch] == list(enumerate(durations))
    assert all(tasks)


def test_without_sizes_each_item_is_a_task_though_their_number_is_unknown():
    batches = Batches(iter("abc"))
    taken = [batches.take(1) for _ in range(4)]
    assert taken == [[(0, "a")], [(1, "b")], [(2, "c")], []]


@pytest.mark.parametrize("workers", [1, 2, 16])
@pytest.mark.parametrize("duration", [0.002, 0.07, 3.0])
def test_a_scheduler_s_cost_is_small_and_all_workers_end_together(workers, duration):
    durations, cost = [duration] * 4000, 0.004
    tasks, free = worked(durations, workers, cost=cost, sizes=[1.0] * len(durations))
    assert max(sum(d for _, d in batch) for batch in tasks) <= max(TASK_SECONDS, duration) + 1e-9
    ideal = sum(durations) / workers
    assert max(free) < 1.03 * ideal + 2 * duration + 20 * cost


def test_a_large_item_is_a_task_of_its_own_and_small_ones_share_one():
    sizes = [1.0] * 100 + [1000.0] + [1.0] * 100
    durations = [0.01 + 0.01 * size for size in sizes]
    tasks, _ = worked(durations, 1, sizes=sizes)
    assert [len(batch) for batch in tasks if any(index == 100 for index, _ in batch)] == [1]
    assert len(tasks) < 60


def test_tasks_grow_again_after_items_that_were_done_before():
    """Of a repeated run the first half takes no time, as it is noted."""
    durations = [1e-4] * 500 + [0.1] * 500
    tasks, free = worked(durations, 2, sizes=[1.0] * 1000)
    assert max(free) < 1.1 * sum(durations) / 2
    assert len(tasks) < 200
