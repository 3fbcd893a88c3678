"""What a run came to, in one sentence: how high, how far above the limit, how often, how sure."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slosh_report.page.units import shown
from slosh_report.run_report.data import RunReport

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
    errors = {row.name: row.sigma for row in report.models}
    error = errors.get(report.nonlinear_name, math.nan)
    return f"; the model agrees within {_mm(error)} on average" if math.isfinite(error) else ""


def _highest(heights: NDArray[np.float64]) -> float:
    known = heights[np.isfinite(heights)]
    return float(known.max()) if len(known) else math.nan


def _is_bound(report: RunReport, peak: float) -> bool:
    return report.saturated is not None and bool(report.saturated[report.measured == peak].any())


def _mm(height: float) -> str:
    return f"{shown(height, 'mm', 1)} mm"
