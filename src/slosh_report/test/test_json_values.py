"""Tests the conversion of values to JSON, with null for values that JSON lacks."""

import json
from dataclasses import dataclass
from enum import Enum, StrEnum

import numpy as np
import pytest

from slosh_report.json_values import plain


class Side(Enum):
    FRONT = "front"


class Word(StrEnum):
    PASSED = "passed"


@dataclass(frozen=True, slots=True)
class Row:
    name: str
    value: float


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (0.1, 0.1),
        (float("nan"), None),
        (-float("inf"), None),
        (np.float32(0.5), 0.5),
        (np.float64("nan"), None),
        (np.int64(3), 3),
        (np.bool_(True), True),
        (True, True),
        (7, 7),
        (None, None),
        ("text", "text"),
        (Side.FRONT, "front"),
        (Word.PASSED, "passed"),
        (np.array([1.0, np.nan]), [1.0, None]),
        (np.array([True, False]), [True, False]),
        ((1.0, float("inf")), [1.0, None]),
        ({3: (np.float64(0.1),)}, {"3": [0.1]}),
        (Row("b", np.float64("nan")), {"name": "b", "value": None}),
        ({"rows": (Row("a", 1.0),)}, {"rows": [{"name": "a", "value": 1.0}]}),
    ],
)
def test_a_value_is_what_json_can_hold(value, expected):
    found = plain(value)
    assert found == expected
    assert type(found) is type(expected)
    assert json.loads(json.dumps(found, allow_nan=False)) == expected
