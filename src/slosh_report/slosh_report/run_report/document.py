"""The same report for programs: what the page shows, as values that JSON can hold."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from slosh_report.json_values import plain
from slosh_report.page.series import gaps
from slosh_report.run_report.data import RunReport
from slosh_report.run_report.polar import azimuth_agreement
from slosh_report.run_report.sentence import sentence

SERIES = ("t", "measured", "linear", "nonlinear")
TABLES = (
    "title", "subtitle", "status", "warnings", "notes", "checks", "verifications", "key_figures",
    "facts", "linear_name", "nonlinear_name", "limit", "limit_name", "duration", "models",
    "motions", "events", "frames", "topics", "model_text",
)  # fmt: skip


def report_document(report: RunReport, *, series: bool = False) -> dict[str, Any]:
    """The report as nested dicts and lists; `json.dumps` takes it as it is.

    Every number that the page shows in a `<data>` element is in here: the element's `data-path`
    is its JSON pointer (RFC 6901) and its `value` is the number, to the last bit.

    Args:
        report: what the page shows.
        series: also the charts' series, under "series".

    Returns:
        numbers in SI units, under the names of RunReport and its rows; null: not known, or no
        bound. Beside these the `sentence`, `gaps` (start and end of each span without a
        measurement [s]), `azimuth` (see AzimuthAgreement; null: not known), each event's
        `duration` and whether each check and verification `passed`. Images are left out.
    """
    document = {"sentence": sentence(report), **{name: _table(report, name) for name in TABLES}}
    spans = gaps(report.t, report.measured)
    document["gaps"] = [{"start": start, "end": end} for start, end in spans]
    known = report.measured_azimuth is not None or report.estimated_azimuth is not None
    document["azimuth"] = plain(azimuth_agreement(report)) if known else None
    if series:
        document["series"] = _series(report)
    return document


def _series(report: RunReport) -> dict[str, Any]:
    document: dict[str, Any] = {name: plain(getattr(report, name)) for name in SERIES}
    if report.saturated is not None:
        document["saturated"] = plain(report.saturated)
    for name in ("measured_azimuth", "estimated_azimuth"):
        azimuths = getattr(report, name)
        if azimuths is not None:
            document[name] = plain(azimuths)
    return document


def _table(report: RunReport, name: str) -> Any:
    table = getattr(report, name)
    return [_ROWS[name](row) for row in table] if name in _ROWS else plain(table)


_ROWS: Mapping[str, Callable[[Any], dict[str, Any]]] = {
    "checks": lambda check: {
        **plain(check),
        "expected": plain(check.expected),
        "tolerance": plain(check.tolerance),
        "passed": check.passed,
    },
    "verifications": lambda found: {**plain(found), "passed": found.passed},
    "events": lambda span: {**plain(span), "duration": plain(span.duration)},
    "frames": lambda frame: {"caption": frame.caption, "time": plain(frame.time)},
}
"""Rows that say more than their fields, or less."""
