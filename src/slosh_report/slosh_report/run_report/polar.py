"""Polar chart: azimuth and height of the liquid's highest point, seen from above."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Array
from slosh_report.page.series import gap_length, highest
from slosh_report.page.svg import CARD, INK, MEASURED, NONLINEAR
from slosh_report.run_report.data import AzimuthSeries, RunReport

SIZE = (4.1, 3.8)
"""[in]; one drawing for all screens: it is no wider than a phone."""
THRESHOLD = 0.25
"""Below this part of the greatest height the surface is flat: its highest place is chance."""
DOTS = 360
PATH = 2400
"""Most dots and points of a path; of longer series the highest of each moment's neighbourhood."""
SHADES = 5
"""Steps from pale, early, to full, late."""


@dataclass(frozen=True, slots=True)
class AzimuthAgreement:
    """Agreement of the estimated azimuth of the highest point with the measured one.

    Attributes:
        threshold: moments count where both heights are above it [m].
        median: of the absolute difference [rad]; NaN: no such moment.
        count: of these moments.
    """

    threshold: float
    median: float
    count: int


def azimuth_threshold(report: RunReport) -> float:
    """Returns the height above which an azimuth is meaningful [m]; 0 if unknown."""
    heights = [series.height for series in _series(report)]
    known = [float(np.nanmax(h)) for h in heights if np.isfinite(h).any()]
    return THRESHOLD * max(known, default=0.0)


def azimuth_agreement(report: RunReport) -> AzimuthAgreement:
    """Compares estimated and measured azimuths at the times of measurement.

    The estimate is interpolated as the vector (h cos φ, h sin φ), which has no jump at ±π.
    """
    threshold = azimuth_threshold(report)
    measured, estimated = report.measured_azimuth, report.estimated_azimuth
    none = AzimuthAgreement(threshold, float("nan"), 0)
    if measured is None or estimated is None:
        return none
    t, phi, _ = _above(measured, threshold)
    known = np.isfinite(estimated.azimuth) & np.isfinite(estimated.height)
    if not known.any() or not len(t):
        return none
    vector = estimated.height[known] * np.exp(1j * estimated.azimuth[known])
    times = estimated.t[known]
    at = np.interp(t, times, vector.real) + 1j * np.interp(t, times, vector.imag)
    counted = (np.abs(at) > threshold) & _covered(t, times)
    if not counted.any():
        return none
    difference = np.abs(np.angle(at[counted] * np.exp(-1j * phi[counted])))
    return AzimuthAgreement(threshold, float(np.median(difference)), int(counted.sum()))


def draw_polar(axes: Any, *, report: RunReport) -> None:
    """Draws measured azimuths as dots and estimated ones as a path that darkens with time."""
    threshold = azimuth_threshold(report)
    axes.figure.subplots_adjust(0.12, 0.11, 0.88, 0.89)
    if report.estimated_azimuth is not None:
        _path(axes, *_above(report.estimated_azimuth, threshold))
    if report.measured_azimuth is not None:
        _dots(axes, *_above(report.measured_azimuth, threshold))
    _frame(axes, _emptiest(report, threshold))


def _frame(axes: Any, free: float) -> None:
    """Draws circles for heights and rays for azimuths, with labels."""
    from matplotlib.ticker import MaxNLocator

    degrees = range(0, 360, 45)
    signs = {0: "+x", 90: "+y", 180: "−x", 270: "−y"}
    labels = [f"{d}°\n{signs[d]}" if d in signs else f"{d}°" for d in degrees]
    axes.set_thetagrids(degrees, labels)
    drawn = axes.dataLim.y1
    top = 1.05 * drawn if np.isfinite(drawn) and drawn > 0.0 else 1.0
    axes.set_ylim(0.0, top)
    ticks = np.asarray(MaxNLocator(4).tick_values(0.0, top), dtype=np.float64)
    circles = [radius for radius in ticks.tolist() if 0.0 < radius < 0.95 * top]
    axes.set_yticks(circles, [])
    for circle in circles:  # texts of their own: those of an axis lie below the lines
        axes.text(
            np.radians(free), circle, f"{circle:g} mm", fontsize=8.0, ha="center", va="center",
            bbox={"facecolor": CARD, "edgecolor": "none", "pad": 0.8, "alpha": 0.85}, zorder=5.0,
        )  # fmt: skip
    axes.tick_params(labelsize=8.0, pad=1.0)
    axes.spines["polar"].set_visible(True)
    axes.spines["polar"].set_color(INK)


def _emptiest(report: RunReport, threshold: float) -> float:
    """Returns the azimuth with the fewest data, for placing labels [°]."""
    azimuths = np.concatenate([np.empty(0), *(_above(s, threshold)[1] for s in _series(report))])
    free = np.arange(22.5, 360.0, 45.0)
    near = np.cos(azimuths[:, None] - np.radians(free)) > np.cos(np.radians(22.5))
    return float(free[np.argmin(near.sum(axis=0))])


def _dots(axes: Any, t: Array, phi: Array, height: Array) -> None:
    chosen = highest(height, DOTS)
    for shade, part in _shades(t[chosen]):
        pick = chosen[part]
        axes.plot(phi[pick], 1e3 * height[pick], color=MEASURED, alpha=shade, linestyle="none",
                  marker="o", markersize=3.0, markeredgewidth=0.0)  # fmt: skip


def _path(axes: Any, t: Array, phi: Array, height: Array) -> None:
    chosen = highest(height, PATH)
    t, phi, height = t[chosen], phi[chosen], height[chosen]
    apart = np.diff(t) > gap_length(t)
    # A step to the opposite wall is not a way along it.
    flips = np.abs(np.angle(np.exp(1j * np.diff(phi)))) > 0.5 * np.pi
    cut = np.flatnonzero(apart | flips) + 1
    for shade, part in _shades(t):
        inside = cut[(cut > part.start) & (cut < part.stop)] - part.start
        line = slice(part.start, min(part.stop + 1, len(t)))  # on to the next shade's first point
        axes.plot(
            np.insert(np.unwrap(phi[line]), inside, np.nan),
            np.insert(1e3 * height[line], inside, np.nan),
            color=NONLINEAR, alpha=shade, linewidth=1.3,
        )  # fmt: skip


def _shades(t: Array) -> list[tuple[float, slice]]:
    """Returns opacity and index range of each part of the drawn path."""
    if not len(t):
        return []
    edges = np.searchsorted(t, np.linspace(t[0], t[-1], SHADES + 1)[1:-1])
    bounds = [0, *edges.tolist(), len(t)]
    levels = np.linspace(0.35, 1.0, SHADES)
    parts = zip(levels.tolist(), bounds[:-1], bounds[1:], strict=True)
    return [(level, slice(a, b)) for level, a, b in parts if b > a]


def _above(series: AzimuthSeries, threshold: float) -> tuple[Array, Array, Array]:
    """Returns times, azimuths and heights of samples above the azimuth threshold."""
    with np.errstate(invalid="ignore"):
        chosen = np.isfinite(series.azimuth) & (series.height > threshold)
    return series.t[chosen], series.azimuth[chosen], series.height[chosen]


def _covered(t: Array, known: Array) -> NDArray[np.bool_]:
    """Returns which times are at a known sample, or between two that have no gap between them."""
    before = np.searchsorted(known, t, side="right") - 1
    after = np.searchsorted(known, t, side="left")
    inside = (before >= 0) & (after < len(known))
    width = known[np.minimum(after, len(known) - 1)] - known[np.maximum(before, 0)]
    return np.asarray(inside & (width <= gap_length(known)))


def _series(report: RunReport) -> tuple[AzimuthSeries, ...]:
    both = (report.measured_azimuth, report.estimated_azimuth)
    return tuple(series for series in both if series is not None)
