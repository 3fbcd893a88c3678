"""Tests the notes of finished items: they give back what was noted, and only that."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slosh_bringup.finished_work import NOTES, FinishedWork


class Colour(Enum):
    RED = "red"
    BLUE = "blue"


class Point(NamedTuple):
    name: str
    value: float = 0.0


@dataclass(frozen=True)
class Part:
    point: Point
    path: Path | None
    colour: Colour = Colour.RED


@dataclass(frozen=True)
class Whole:
    parts: tuple[Part, ...]
    pair: tuple[int, str]
    by_name: Mapping[str, Part]
    document: Mapping[str, Any]


numbers = st.floats(allow_nan=False)
parts = st.builds(
    Part,
    st.builds(Point, st.text(), numbers),
    st.none() | st.sampled_from([Path("/a/b"), Path("c")]),
    st.sampled_from(Colour),
)
wholes = st.builds(
    Whole,
    st.lists(parts, max_size=3).map(tuple),
    st.tuples(st.integers(), st.text()),
    st.dictionaries(st.text(), parts, max_size=2),
    st.dictionaries(st.text(), numbers | st.none() | st.lists(st.booleans()), max_size=2),
)


@given(wholes)
def test_a_note_gives_back_what_was_noted_in_its_state_alone(tmp_path_factory, whole):
    folder = tmp_path_factory.mktemp("results")
    FinishedWork(folder).note("a", "state", whole)
    assert FinishedWork(folder).find("a", "state", Whole) == whole
    assert FinishedWork(folder).find("a", "another", Whole) is None
    assert FinishedWork(folder).find("b", "state", Whole) is None


def test_a_number_that_is_not_known_stays_so(tmp_path):
    notes = FinishedWork(tmp_path)
    notes.note("a", "", Point("x", math.nan))
    found = notes.find("a", "", Point)
    assert found.name == "x"
    assert math.isnan(found.value)


@pytest.mark.parametrize("text", ["", "{", "[]", '{"state": "s"}', '{"state": "s", "value": [1]}'])
def test_a_spoilt_note_is_none(tmp_path, text):
    notes = FinishedWork(tmp_path)
    notes.note("a", "s", Point("x"))
    (tmp_path / NOTES / "a.json").write_text(text)
    assert notes.find("a", "s", Point) is None
    assert notes.has("a")
    notes.forget()
    assert not notes.has("a")
    assert not (tmp_path / NOTES).exists()


def test_what_was_begun_is_not_finished(tmp_path):
    notes = FinishedWork(tmp_path)
    notes.begin("a")
    assert notes.has("a")
    assert notes.find("a", "", Point) is None
    notes.note("a", "s", Point("x"))
    notes.begin("a")
    assert notes.find("a", "s", Point) == Point("x")
