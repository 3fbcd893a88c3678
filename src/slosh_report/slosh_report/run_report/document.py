"""The same report for programs: what the page shows, as values that JSON can hold."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slosh_report.page.frame import Frame
from slosh_report.page.series import gaps
from slosh_report.run_report.data import RunReport
from slosh_report.run_report.polar import azimuth_agreement
from slosh_report.run_report.rows import Check, Span, Verification

SERIES = ("t", "measured", "linear", "nonlinear")
TABLES = (
    "title", "subtitle", "status", "warnings", "notes", "checks", "verifications", "key_figures",
    "facts", "linear_name", "nonlinear_name", "limit", "duration", "models", "motions", "events",
    "frames", "topics", "model_text",
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
        bound. Beside these `gaps` (start and end of each span without a measurement [s]),
        `azimuth` (see AzimuthAgreement; null: not known), each event's `duration` and whether
        each check and verification `passed`. Images are left out.
    """
    document = {name: _plain(getattr(report, name)) for name in TABLES}
    spans = gaps(report.t, report.measured)
    document["gaps"] = [{"start": start, "end": end} for start, end in spans]
    known = report.measured_azimuth is not None or report.estimated_azimuth is not None
    document["azimuth"] = _plain(azimuth_agreement(report)) if known else None
    if series:
        document["series"] = _series(report)
    return document


def _series(report: RunReport) -> dict[str, Any]:
    document: dict[str, Any] = {name: _numbers(getattr(report, name)) for name in SERIES}
    if report.saturated is not None:
        document["saturated"] = report.saturated.tolist()
    for name in ("measured_azimuth", "estimated_azimuth"):
        azimuths = getattr(report, name)
        if azimuths is not None:
            document[name] = {
                "name": azimuths.name,
                **{key: _numbers(getattr(azimuths, key)) for key in ("t", "azimuth", "height")},
            }
    return document


def _plain(value: Any) -> Any:
    """Dataclasses as dicts, tuples as lists, numbers as Python's own, unknown ones as None."""
    if is_dataclass(value):
        return _row(value)
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, str):
        return str(value)
    if isinstance(value, Sequence):
        return [_plain(entry) for entry in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value


def _row(row: Any) -> dict[str, Any]:
    document = {f.name: _plain(getattr(row, f.name)) for f in fields(row) if f.name != "image"}
    if isinstance(row, Span):
        document["duration"] = _plain(row.duration)
    if isinstance(row, (Check, Verification)):
        document["passed"] = row.passed
    if isinstance(row, Frame):
        del document["media_type"]
    return document


def _numbers(values: NDArray[np.float64]) -> list[float | None]:
    return [value if math.isfinite(value) else None for value in values.tolist()]
