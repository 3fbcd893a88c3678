import random

import pytest

from slosh_bag.nodes.topic_input import SequenceGaps


def lost(numbers: list[int | None], publishers: int = 1) -> int:
    gaps = SequenceGaps()
    for number in numbers:
        gaps.take(number, publishers)
    gaps.settle(new_publishers=False)
    return gaps.lost


def test_what_one_publisher_left_out() -> None:
    assert lost([7, 8, 9, 12, 13, 20]) == 2 + 6


def test_who_speaks_in_turns() -> None:
    """A publisher that replaces another does not alternate with it; two active ones do."""
    gaps = SequenceGaps()
    for number in (500, 501, 1, 2, 3):
        gaps.take(number, 2)
    assert gaps.turns == 0
    for number in (502, 4, 503, 5):
        gaps.take(number, 2)
    assert gaps.turns == 4


def test_a_new_publisher_is_not_taken_for_a_gap() -> None:
    """Its first messages may arrive before the new publisher has been discovered."""
    gaps = SequenceGaps()
    for number in (8, 9, 40, 41):
        gaps.take(number)
    gaps.settle(new_publishers=True)
    assert gaps.lost == 0
    for number in (42, 45):
        gaps.take(number)
    assert gaps.lost == 0
    gaps.settle(new_publishers=False)
    assert gaps.lost == 2


def test_a_middleware_that_does_not_count_loses_nothing() -> None:
    assert lost([None, None]) == 0


@pytest.mark.parametrize("dropped", [0, 3])
def test_several_publishers_in_any_order(dropped: int) -> None:
    """In any order of messages, the counted losses are close to the true ones."""
    mixing = random.Random(5)
    streams = [list(range(start, start + 300)) for start in (1, 40, 5000)]
    for stream in streams:
        del stream[150 : 150 + dropped]
    came: list[int | None] = []
    while any(streams):
        came.append(mixing.choice([stream for stream in streams if stream]).pop(0))
    assert lost(came, 3) == pytest.approx(3 * dropped, abs=2 * dropped)
