"""Tests what the study of tuning numbers counts as a change."""

import math

import pytest
from tuning import ROOMS, Answers, change, moved, numbers_of
from tuning_scenes import Answer


def test_a_whole_number_moves_by_one_at_least() -> None:
    assert [moved(value, by) for value, by in ((2, 0.2), (2, -0.2), (10, 0.2))] == [3, 1, 12]
    assert moved((0.5, 10.0), -0.2) == pytest.approx((0.4, 8.0))


def test_changes_are_told_by_their_kind() -> None:
    first, same = Answer((0.01, math.nan), "NONE"), Answer((0.02, 0.02), "NONE")
    usual: Answers = {"a": [first, same], "b": "refused"}
    assert not any(change(usual, usual))
    higher: Answers = {**usual, "a": [Answer((0.012, math.nan), "NONE"), same]}
    assert change(usual, higher).rms == pytest.approx(1.0)
    hidden: Answers = {**usual, "a": [first, Answer((0.02, math.nan), "NONE")]}
    assert change(usual, hidden) == (0.0, 1, 0)
    assert change(usual, {**usual, "b": []}) == (0.0, 0, 1)


@pytest.mark.parametrize("room", ROOMS)
def test_each_room_tells_its_numbers(room: str) -> None:
    for name, unit, value, meaning in numbers_of(room):
        assert unit, name
        assert meaning, name
        assert moved(value, 0.2) != value, name
