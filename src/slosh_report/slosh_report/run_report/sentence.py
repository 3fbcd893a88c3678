"""What a run came to, in one sentence: how high, how far above the limit, how often, how sure."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slosh_report.page.units import shown
from slosh_report.run_report.data import RunReport

LEAST = 1e-4
"""A smaller mean error is told as this one [m]."""
_OFTEN = {1: "once", 2: "twice", 3: "three times"}


def sentence(report: RunReport) -> str:
    """What a run came to.

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
    """How far the peak is from the limit, and how often it was exceeded."""
    count = sum(span.source == source for span in report.events)
    often = _OFTEN.get(count, f"{count} times")
    if report.limit is None:
        return f", beyond a limit that changed, {often}" if count else ""
    apart = f", {_mm(abs(peak - report.limit))} "
    if peak <= report.limit:
        return f"{apart}below the {report.limit_name}"
    return f"{apart}above the {report.limit_name}" + (f", {often}" if count else "")


def _agreement(report: RunReport) -> str:
    """By how much the nonlinear model differs from the camera, in the mean."""
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
