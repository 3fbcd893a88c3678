"""Tests that a replay is checked against each expected number."""

from dataclasses import replace

import numpy as np
import pytest

from slosh_estimator.limits import Event, Kind, Source
from slosh_replay.manifest import Expectation, ExpectedEvent, ExpectedNumber
from slosh_replay.replay.checking import check_result, expectation_of
from slosh_replay.replay.result import ModelAccuracy, ReplayResult
from slosh_replay.replay.verification import Difference, Verification

SECOND = 1_000_000_000


def event(number, kind, source=Source.MEASURED, peak=0.02, duration=0.5):
    return Event(
        10 * SECOND, number, kind, source, 0.015, peak, 0, round(duration * SECOND), "text"
    )


def verified(**changes):
    found = Verification("/slosh/estimate", 100, 100, 0, 3, None, {}, {})
    return replace(found, **changes)


EVENTS = (
    event(1, Kind.START, duration=0.0), event(1, Kind.END),
    event(2, Kind.START, Source.DISAGREEMENT, 0.011, 0.0),
)  # fmt: skip
RESULT = ReplayResult(
    "c3", "/slosh/accel", np.empty(0, dtype=np.int64), np.empty(0), {},
    (
        ModelAccuracy("3D-L", 0.0011, 0.235, 0.236, 0.0015, 500),
        ModelAccuracy("3D-NL", 0.00014, -0.018, -0.018, 0.0002, 500),
    ),
    events=EVENTS,
    counters={"images": 552, "samples_dropped": 1, "not_used_live": 2},
    verified={"estimate": verified()},
    warnings=("/data/c3/c3_0.mcap: unfinished (cut off); 12 bytes could not be used",),
)  # fmt: skip
DIFFERENT = verified(
    identical=97,
    first=Difference(SECOND, "nonlinear.msh", 0.02, 0.02 + 1e-12),
    largest={"nonlinear.msh": 1e-12},
    counts={"nonlinear.msh": 3},
    causes=("model: effects.surface_nonlinearity.alpha: recorded 0.58, replayed with 0.5800001",),
)


def failures(expected, result=RESULT):
    """Returns the failures of a check in which one warning is expected."""
    return check_result(result, replace(expected, warnings=("unfinished",))).failures


def test_what_a_manifest_is_written_from_passes():
    expected = expectation_of(RESULT)
    assert check_result(RESULT, expected).passed
    assert expected.warnings == ("unfinished (cut off); 12 bytes could not be used",)
    assert (expected.images, expected.drops, expected.tolerance) == (552, 3, 0.0)
    assert [e.source for e in expected.events] == ["measured", "disagreement"]
    assert [e.peak.value for e in expected.events] == [0.02, 0.011]


@pytest.mark.parametrize(
    ("name", "value", "unit"), [("sigma", 0.00014, "mm"), ("epsilon", -0.018, "%")]
)
def test_a_number_at_its_bound_passes_and_beyond_fails(name, value, unit):
    sign = {"sigma": "MAE", "epsilon": "ε"}[name]
    for side in (-1, 1):
        inside = ExpectedNumber(value + side * 0.99e-6, 1e-6)
        outside = ExpectedNumber(value + side * 1.01e-6, 1e-6)
        assert failures(Expectation(**{name: {"3D-NL": inside}})) == ()
        (line,) = failures(Expectation(**{name: {"3D-NL": outside}}))
        assert line.startswith(f"{sign} 3D-NL: ")
        assert line.endswith(unit)


@pytest.mark.parametrize(("drops", "passes"), [(2, False), (3, True), (4, False)])
def test_drops_are_the_gates_and_the_live_estimators(drops, passes):
    assert (failures(Expectation(drops=drops)) == ()) is passes


def two_events(**changes):
    first = ExpectedEvent("measured", ExpectedNumber(0.02, 1e-6), ExpectedNumber(0.5, 1e-3))
    return Expectation(events=(replace(first, **changes), ExpectedEvent("disagreement")))


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"source": "estimated"}, "event 1: measured, expected estimated"),
        (
            {"peak": ExpectedNumber(0.021, 1e-6)},
            "event 1: peak: 20 mm, expected 20.999 … 21.001 mm",
        ),
        (
            {"duration": ExpectedNumber(0.6, 1e-3)},
            "event 1: duration: 0.5 s, expected 0.599 … 0.601 s",
        ),
    ],
)
def test_an_event_is_named_by_what_is_wrong_with_it(changes, text):
    assert failures(two_events(**changes)) == (text,)


def test_events_that_are_expected_and_lack_or_come_and_are_not():
    (line,) = failures(Expectation(events=two_events().events[:1]))
    assert line == "limit events: 2, expected 1"
    (line,) = failures(Expectation(events=()))
    assert line == "limit events: 2, expected 0"
    three = (*two_events().events, ExpectedEvent("estimated"))
    assert failures(Expectation(events=three)) == ("limit events: 2, expected 3",)
    assert failures(Expectation(events=None)) == ()


def test_estimates_that_differ_fail_with_message_field_and_cause():
    lines = failures(Expectation(tolerance=0.0), replace(RESULT, verified={"estimate": DIFFERENT}))
    text = "\n".join(lines)
    assert "97 of 100 messages bit for bit, 3 differ" in text
    assert "first difference: nonlinear.msh at 1.000000 s" in text
    assert "alpha: recorded 0.58" in text


def test_another_machines_rounding_is_allowed_a_billionth_and_no_more():
    for largest, passes in ((0.9e-9, True), (1.1e-9, False)):
        found = replace(DIFFERENT, largest={"nonlinear.msh": largest}, rounds_otherwise=True)
        lines = failures(Expectation(tolerance=0.0), replace(RESULT, verified={"estimate": found}))
        assert (lines == ()) is passes


@pytest.mark.parametrize("found", [None, verified(recorded=0, identical=0)])
def test_estimates_that_were_never_recorded_cannot_come_out_again(found):
    (line,) = failures(Expectation(tolerance=0.0), replace(RESULT, verified={"estimate": found}))
    assert "none were recorded" in line
    assert expectation_of(replace(RESULT, verified={"estimate": found})).tolerance is None


def test_warnings_that_lack_or_were_not_announced_fail():
    def lines(*texts):
        return check_result(RESULT, Expectation(warnings=texts)).failures

    assert lines("unfinished") == ()
    (line,) = lines()
    assert line.startswith("unexpected warning: /data/c3/c3_0.mcap: unfinished")
    assert check_result(RESULT, Expectation(warnings=None)).failures == ()  # nothing is stated
    (line,) = lines("unfinished", "two cells")
    assert line == "the expected warning 'two cells' is missing"
