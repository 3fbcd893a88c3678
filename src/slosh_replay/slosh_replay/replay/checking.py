"""Compares the results of a replay with the expected results in its manifest."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from slosh_estimator.limits import Event, Source
from slosh_msgs_py.topics import ESTIMATE
from slosh_replay.manifest import Expectation, ExpectedEvent, ExpectedNumber
from slosh_replay.replay.result import ReplayResult
from slosh_replay.replay.verification import ORDER_UNKNOWN, Verification
from slosh_report.page.units import unit_style
from slosh_report.run_report import CheckRow

HEIGHT_TOLERANCE, SHARE_TOLERANCE, TIME_TOLERANCE = 1e-6, 1e-4, 1e-3
"""Tolerances of a manifest that is written: of heights [m], of ε [1], of times [s]."""
ROUNDING = 1e-9
"""Tolerance of estimates on a machine that rounds otherwise than the recording one [SI units]."""

RECORDED = Expectation(tolerance=0.0, warnings=None)
"""What a bag without a manifest must give: its own estimates again; warnings are told."""


class Point(NamedTuple):
    """One check of a replay: its name, and the reason if it failed.

    Attributes:
        name: what it is.
        failure: why it is not as expected; empty: it is.
    """

    name: str
    failure: str = ""


@dataclass(frozen=True, slots=True)
class CheckedReplay:
    """A replay, with the results of the checks against its manifest.

    Attributes:
        name: of the bag.
        points: everything that was looked at.
        checks: the numbers among it.
    """

    name: str
    points: tuple[Point, ...]
    checks: tuple[CheckRow, ...] = ()

    @property
    def failures(self) -> tuple[str, ...]:
        """The failed checks, one line each."""
        return tuple(point.failure for point in self.points if point.failure)

    @property
    def passed(self) -> bool:
        """Whether all checks passed."""
        return not self.failures


def check_result(result: ReplayResult, expected: Expectation) -> CheckedReplay:
    """Compares a replay's results with all expected values that the manifest contains."""
    checks = [
        *_models("MAE", "mm", expected.sigma, {a.name: a.sigma for a in result.accuracy}),
        *_models("ε", "%", expected.epsilon, {a.name: a.epsilon for a in result.accuracy}),
    ]
    if expected.images is not None:
        checks.append(_exactly("images", result.counters.get("images", 0), expected.images))
    if expected.drops is not None:
        checks.append(_exactly("dropped samples", dropped(result), expected.drops))
    sources: list[Point] = []
    if expected.events is not None:
        found = excesses(result.events)
        checks.append(_exactly("limit events", len(found), len(expected.events)))
        checks += _events(expected.events, found)
        sources = _sources(expected.events, found)
    points = [
        *(Point(check.name, "" if check.passed else _failure(check)) for check in checks),
        *sources,
        *_estimates(result, expected.tolerance),
        *_further(result, expected.tolerance),
        _warnings(result.warnings, expected.warnings),
    ]
    return CheckedReplay(result.name, tuple(points), tuple(checks))


def expectation_of(result: ReplayResult) -> Expectation:
    """Returns expected results that the given replay meets.

    The tolerances leave room for another machine's rounding and for nothing else that matters.
    """
    found = result.verification
    compared = found is not None and found.total > 0
    return Expectation(
        tolerance=0.0 if compared else None,
        images=result.counters.get("images", 0),
        drops=dropped(result),
        sigma={
            row.name: ExpectedNumber(row.sigma, HEIGHT_TOLERANCE)
            for row in result.accuracy
            if math.isfinite(row.sigma)
        },
        epsilon={
            row.name: ExpectedNumber(row.epsilon, SHARE_TOLERANCE)
            for row in result.accuracy
            if math.isfinite(row.epsilon)
        },
        events=tuple(
            ExpectedEvent(
                Source(event.source).name.lower(),
                ExpectedNumber(event.peak, HEIGHT_TOLERANCE),
                ExpectedNumber(event.duration_ns * 1e-9, TIME_TOLERANCE),
            )
            for event in excesses(result.events)
        ),
        # Without the file's path, which is another one elsewhere.
        warnings=tuple(warning.split(": ", 1)[-1] for warning in result.warnings),
    )


def dropped(result: ReplayResult) -> int:
    """Returns how many input samples were dropped or not used by the live estimator."""
    return result.counters.get("samples_dropped", 0) + result.counters.get("not_used_live", 0)


def excesses(events: Sequence[Event]) -> list[Event]:
    """Returns the last event of each limit violation, which contains its peak."""
    last = {event.id: event for event in events}
    return [last[number] for number in sorted(last)]


def _models(
    name: str, unit: str, expected: Mapping[str, ExpectedNumber], found: Mapping[str, float]
) -> list[CheckRow]:
    return [
        CheckRow(f"{name} {model}", found.get(model, math.nan), *bound.bounds, unit)
        for model, bound in expected.items()
    ]


def _exactly(name: str, value: int, expected: int) -> CheckRow:
    return CheckRow(name, float(value), float(expected), float(expected))


def _events(expected: Sequence[ExpectedEvent], found: Sequence[Event]) -> list[CheckRow]:
    checks = []
    for number, (wanted, event) in enumerate(zip(expected, found, strict=False), start=1):
        if wanted.peak is not None:
            checks.append(CheckRow(f"event {number}: peak", event.peak, *wanted.peak.bounds, "mm"))
        if wanted.duration is not None:
            seconds = event.duration_ns * 1e-9
            checks.append(
                CheckRow(f"event {number}: duration", seconds, *wanted.duration.bounds, "s")
            )
    return checks


def _sources(expected: Sequence[ExpectedEvent], found: Sequence[Event]) -> list[Point]:
    points = []
    for number, (wanted, event) in enumerate(zip(expected, found, strict=False), start=1):
        name = Source(event.source).name.lower()
        failure = f"event {number}: {name}, expected {wanted.source}"
        points.append(Point(f"event {number}: source", "" if name == wanted.source else failure))
    return points


def _estimates(result: ReplayResult, tolerance: float | None) -> list[Point]:
    if tolerance is None:
        return []
    name = "recorded estimates"
    found = result.verification
    if found is not None and not found.total and found.unchecked:
        return [Point(name, line) for line in found.lines()]
    if found is None or not found.total:
        return [Point(name, "estimates: none were recorded; there is nothing to compare with")]
    return _same(name, found, tolerance)


def _further(result: ReplayResult, tolerance: float | None) -> list[Point]:
    """Checks that what else the nodes published comes out again, by their journals.

    Without a journal nothing tells in which order a node took its inputs: that is no failure.
    """
    return [
        point
        for name, found in result.verified.items()
        if name != ESTIMATE
        and tolerance is not None
        and found.total
        and ORDER_UNKNOWN not in found.causes
        for point in _same(f"recorded {name}", found, 0.0)
    ]


def is_reproduced(found: Verification, tolerance: float = 0.0) -> bool:
    """Returns whether a replay reproduced the recorded messages.

    Args:
        found: the comparison.
        tolerance: allowed difference [SI units]; 0: bit for bit, and within ROUNDING on a machine
            that rounds otherwise than the recording one.
    """
    allowed = tolerance or (ROUNDING if found.rounds_otherwise else 0.0)
    return found.exact or (allowed > 0.0 and found.within(allowed))


def _same(name: str, found: Verification, tolerance: float) -> list[Point]:
    if is_reproduced(found, tolerance):
        return [Point(name)]
    return [Point(name, line) for line in found.lines()]


def _warnings(found: Sequence[str], expected: Sequence[str] | None) -> Point:
    if expected is None:
        return Point("warnings")
    missing = [text for text in expected if not any(text in warning for warning in found)]
    strange = [warning for warning in found if not any(text in warning for text in expected)]
    lines = [
        *(f"the expected warning {text!r} is missing" for text in missing),
        *(f"unexpected warning: {warning}" for warning in strange),
    ]
    return Point("warnings", "; ".join(lines))


def _failure(check: CheckRow) -> str:
    if check.lower == check.upper:
        return f"{check.name}: {check.value:g}, expected {check.lower:g}"
    style = unit_style(check.unit)
    low, value, high = (
        f"{style.scale * number:.6g}" for number in (check.lower, check.value, check.upper)
    )
    return f"{check.name}: {value} {check.unit}, expected {low} … {high} {check.unit}"
