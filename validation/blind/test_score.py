"""Tests which discovery results the scores count as right."""

import json

import pytest

from validation.blind import tables
from validation.blind.score import judge


def effect(name, confidence=0.97, alternatives=(), refitted=False):
    return {
        "name": name,
        "confidence": confidence,
        "alternatives": list(alternatives),
        "refitted": refitted,
        "parameters": {},
    }


def row(kind, hidden, verdict, *found, **more):
    return judge(
        {
            "case": "x",
            "kind": kind,
            "base": "2D-L",
            "noise": 3e-4,
            "sensor": "msh",
            "hidden": list(hidden),
            "strength": dict.fromkeys(hidden, 9.0),
            "counts": True,
            "equivalent": [],
            "wrong": None,
            "verdict": verdict,
            "found": list(found),
            "closed": 0.95,
            "error": "",
            **more,
        }
    )


LIKE = {"equivalent": [["accel_gain", "height_scale"]]}
ALPHA = {"wrong": ["alpha", 0.1, 0.58]}
SINGLE = [
    ("the name", True, "named", [effect("second_mode")], {}),
    ("another name", False, "named", [effect("fill_loss")], {}),
    ("the name and another", False, "named", [effect("second_mode"), effect("fill_loss")], {}),
    ("nothing", False, "none", [], {}),
    ("unexplained", False, "unexplained", [], {}),
    ("one of two", True, "ambiguous", [effect("fill_loss", 0.5, ["second_mode"])], {}),
    ("one of two, both wrong", False, "ambiguous", [effect("fill_loss", 0.5, ["x"])], {}),
    ("one of three", False, "ambiguous", [effect("second_mode", 0.4, ["x", "y"])], {}),
    ("no answer", False, "error", [], {}),
]


@pytest.mark.parametrize(("_", "right", "verdict", "found", "more"), SINGLE)
def test_one_missing_effect(_, right, verdict, found, more):
    assert row("single", ["second_mode"], verdict, *found, **more)["right"] is right


def test_a_certain_pick_of_two_alike_is_wrong():
    hidden = ["accel_gain"]
    assert not row("single", hidden, "named", effect("accel_gain", 0.99), **LIKE)["right"]
    assert row("single", hidden, "named", effect("accel_gain", 0.5), **LIKE)["right"]
    both = effect("height_scale", 0.5, ["accel_gain"])
    assert row("single", hidden, "ambiguous", both, **LIKE)["right"]


def test_two_missing_effects():
    hidden = ["fill_level", "second_mode"]
    first, second = effect("second_mode"), effect("fill_level")
    assert row("pairs", hidden, "named", first, second)["right"]
    assert not row("pairs", hidden, "named", first)["right"]
    assert not row("pairs", hidden, "named", first, second, effect("time_offset"))["right"]
    either = effect("fill_loss", 0.5, ["fill_level"])
    assert row("pairs", hidden, "ambiguous", first, either)["right"]
    # One found effect cannot stand for both.
    wide = effect("second_mode", 0.5, ["fill_level"])
    assert not row("pairs", hidden, "ambiguous", wide, effect("time_offset"))["right"]


def test_nothing_missing():
    assert row("none", [], "none")["right"]
    assert not row("none", [], "named", effect("fill_loss"))["right"]
    assert not row("none", [], "ambiguous", effect("fill_loss", 0.5, ["time_offset"]))["right"]
    assert not row("none", [], "unexplained")["right"]


def test_what_is_not_in_the_list():
    hidden = ["coriolis"]
    assert row("outside", hidden, "unexplained")["right"]
    assert row("outside", hidden, "named", effect("yaw_coupling", 0.8))["right"]
    assert not row("outside", hidden, "named", effect("yaw_coupling", 0.95))["right"]
    assert not row("outside", hidden, "named", effect("height_offset", 0.8))["right"]
    assert not row("outside", hidden, "none")["right"]


def test_a_wrong_parameter_beside_a_missing_effect():
    hidden, strengths = ["second_mode"], {"second_mode": 9.0, "alpha": 5.0}
    more = {**ALPHA, "strength": strengths}
    refitted = effect("surface_nonlinearity", refitted=True)
    kind = "wrong_parameter"
    assert row(kind, hidden, "named", effect("second_mode"), refitted, **more)["right"]
    assert not row(kind, hidden, "named", effect("second_mode"), **more)["right"]
    unseen = {**ALPHA, "strength": {"second_mode": 9.0, "alpha": 1.0}}
    assert row(kind, hidden, "named", effect("second_mode"), **unseen)["right"]


def test_certain_wrong_names_mislead():
    assert row("single", ["second_mode"], "named", effect("fill_loss", 0.95))["misled"]
    assert not row("single", ["second_mode"], "named", effect("fill_loss", 0.85))["misled"]
    assert not row("single", ["second_mode"], "named", effect("second_mode", 0.95))["misled"]
    assert row("outside", ["coriolis"], "named", effect("yaw_coupling", 0.95))["misled"]


def test_tables_have_counts_and_leave_weak_cases_apart():
    rows = [
        row("single", ["second_mode"], "named", effect("second_mode")),
        row("single", ["second_mode"], "named", effect("fill_loss", 0.6)),
        row("single", ["second_mode"], "none", counts=False, closed=None),
    ]
    rows = [json.loads(json.dumps(line)) for line in rows]
    text = tables.overview(rows)
    assert "| ≥ 95 % | 50 % (1/2) |" in text
    assert "| weaker than 3 noises: verdict `none` | - | 100 % (1/1) |" in text
    assert "| `second_mode` | 1/2 | 95 % | - |" in tables.by_effect(rows)
    assert "| 0.95 … 0.99 | 0.97 | 1/1 | 0 |" in tables.reliability(rows)
    for make in tables.TABLES.values():
        widths = {line.count("|") for line in make(rows).splitlines()}
        assert len(widths) == 1
