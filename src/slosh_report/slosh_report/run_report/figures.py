"""Converts a run's report to JSON-compatible values."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slosh_report.json_values import plain
from slosh_report.page.series import gaps
from slosh_report.page.units import shown
from slosh_report.run_report.data import RunReport
from slosh_report.run_report.polar import azimuth_agreement

SERIES = ("t", "measured", "linear", "nonlinear")
TABLES = (
    "title", "subtitle", "status", "warnings", "notes", "checks", "verifications", "key_figures",
    "facts", "linear_name", "nonlinear_name", "limit", "limit_name", "duration", "models",
    "motions", "events", "frames", "topics", "model_text",
)  # fmt: skip

LEAST = 1e-4
"""A smaller mean error is told as this one [m]."""
_OFTEN = {1: "once", 2: "twice", 3: "three times"}


def report_document(report: RunReport, *, series: bool = False) -> dict[str, Any]:
    """Returns a run's report as nested dictionaries and lists.

    Every number that the page shows in a `<data>` element is in here: the element's `data-path`
    is its JSON pointer (RFC 6901) and its `value` is the number, to the last bit.

    Args:
        report: what the page shows.
        series: also the charts' series, under "series".

    Returns:
        numbers in SI units, under the names of RunReport and its rows; null: not known, or no
        bound. Beside these the `sentence`, `gaps` (start and end of each span without a
        measurement [s]), `azimuth` (see AzimuthAgreement; null: not known), each event's
        `duration` and whether each check and verification `passed`; of `further` containers
        only the peaks, the limit and the `sentence`. Images are left out.
    """
    document = {"sentence": sentence(report), **{name: _table(report, name) for name in TABLES}}
    spans = gaps(report.t, report.measured)
    document["gaps"] = [{"start": start, "end": end} for start, end in spans]
    known = report.measured_azimuth is not None or report.estimated_azimuth is not None
    document["azimuth"] = plain(azimuth_agreement(report)) if known else None
    document["further"] = [_further(one, series=series) for one in report.further]
    if series:
        document["series"] = _series(report)
    return document


def _further(report: RunReport, *, series: bool) -> dict[str, Any]:
    """Returns the heights of a further container of a tray."""
    document: dict[str, Any] = {
        "title": report.title,
        "sentence": sentence(report),
        "limit": report.limit,
        "measured": plain(_highest(report.measured)),
        "estimated": plain(_highest(report.nonlinear)),
    }
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


def sentence(report: RunReport) -> str:
    """Describes the result of a run in one sentence.

    Args:
        report: of a run with a camera, without one, or with neither heights nor a limit.

    Returns:
        for example: The liquid rose to 24.1 mm, 4.1 mm above the limit, twice; the model agrees
        within 0.2 mm on average.
    """
    measured, estimated = _highest(report.measured), _highest(report.nonlinear)
    if not (math.isfinite(measured) or math.isfinite(estimated)):
        return "No height is known, measured or estimated."
    if not math.isfinite(measured):
        limited = _limited(report, estimated, "estimated")
        return f"By the model the liquid rose to {_mm(estimated)}{limited}; nothing was measured."
    bound = "at least " if _is_bound(report, measured) else ""
    limited = _limited(report, measured, "measured")
    return f"The liquid rose to {bound}{_mm(measured)}{limited}{_agreement(report)}."


def _limited(report: RunReport, peak: float, source: str) -> str:
    """Describes the peak height relative to the height limit, and the number of violations."""
    count = sum(span.source == source for span in report.events)
    often = _OFTEN.get(count, f"{count} times")
    if report.limit is None:
        return f", beyond a limit that changed, {often}" if count else ""
    apart = f", {_mm(abs(peak - report.limit))} "
    if peak <= report.limit:
        return f"{apart}below the {report.limit_name}"
    return f"{apart}above the {report.limit_name}" + (f", {often}" if count else "")


def _agreement(report: RunReport) -> str:
    """Describes the mean difference between the nonlinear model and the camera."""
    row = next((row for row in report.models if row.name == report.nonlinear_name), None)
    if row is None or not math.isfinite(row.sigma):
        return ""
    known = int(np.count_nonzero(np.isfinite(report.measured)))
    # Of a run in which little could be compared, such as the rest before it, that is told.
    few = f" over {row.count} of {known} images" if 0 < row.count < 0.5 * known else ""
    return f"; the model agrees within {_mm(max(row.sigma, LEAST))} on average{few}"


def _highest(heights: NDArray[np.float64]) -> float:
    known = heights[np.isfinite(heights)]
    return float(known.max()) if len(known) else math.nan


def _is_bound(report: RunReport, peak: float) -> bool:
    return report.saturated is not None and bool(report.saturated[report.measured == peak].any())


def _mm(height: float) -> str:
    return f"{shown(height, 'mm', 1)} mm"
