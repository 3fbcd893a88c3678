"""Charts of a discovery: a motion before and after, and the motion that separates."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slosh_discovery.discover.finding import MotionFinding, SeparatingMotion
from slosh_discovery.discovery_report.figures import highest
from slosh_model.simulate import Inputs
from slosh_report.page.lines import (
    DASHES,
    badge,
    chart_points,
    draw_line,
    time_chart,
    time_ends,
)
from slosh_report.page.svg import GAP, INK, LINEAR, MEASURED, NONLINEAR

Array = NDArray[np.float64]
Size = tuple[float, float]

BAND = 2.0
"""Half width of the band of noise, in standard deviations: 95 % of the noise lies in it."""
COLOURS = (MEASURED, LINEAR, NONLINEAR)
STYLES: tuple[Any, ...] = ("-", DASHES, "-")
"""Of the three components of a vector."""
TURNING = 1e-3
"""Smaller angles [rad] and rates [rad/s] are not worth a chart."""


def heights_chart(
    finding: MotionFinding, moments: Mapping[str, float], size: Size, name: str
) -> str:
    """Measured height, base and found model over a motion [mm], as SVG text.

    Of wall heights by azimuth the highest are shown.

    Args:
        finding: the motion.
        moments: letters of the moments that are marked [s].
        size: of the figure [in].
        name: of the chart.
    """
    motion = finding.motion

    def draw(axes: Any) -> None:
        axes.axhline(0.0, color=INK, linewidth=0.8)
        points = chart_points(size)
        for values, colour, width, dashes in (
            (motion.peak_heights, MEASURED, 2.0, "-"),
            (highest(finding.before_heights, motion.heights), LINEAR, 1.3, DASHES),
            (highest(finding.after_heights, motion.heights), NONLINEAR, 1.3, "-"),
        ):
            draw_line(axes, motion.t, values, colour, width, dashes, points)
        _letters(axes, moments.items())
        axes.set_ylabel("height [mm]")

    return time_chart(draw, time_ends(motion.t), size, name)


def residual_chart(finding: MotionFinding, size: Size, name: str) -> str:
    """Measured minus model before and after, over the band of the noise [mm], as SVG text."""
    motion = finding.motion
    measured = motion.peak_heights

    def draw(axes: Any) -> None:
        if np.isfinite(finding.noise):
            band = 1e3 * BAND * finding.noise
            axes.axhspan(-band, band, color=GAP, linewidth=0.0)
        axes.axhline(0.0, color=INK, linewidth=0.8)
        points = chart_points(size)
        before = measured - highest(finding.before_heights, motion.heights)
        after = measured - highest(finding.after_heights, motion.heights)
        draw_line(axes, motion.t, before, LINEAR, 1.2, DASHES, points)
        draw_line(axes, motion.t, after, NONLINEAR, 1.3, "-", points)
        axes.set_ylabel("measured − model [mm]")

    return time_chart(draw, time_ends(motion.t), size, name)


def acceleration_chart(motion: SeparatingMotion, size: Size, name: str) -> str:
    """The container's acceleration over a motion [m/s²], as SVG text."""
    inputs = motion.inputs
    return _vector_chart(inputs.t, inputs.acceleration, 1.0, "acceleration [m/s²]", size, name)


def turning_chart(motion: SeparatingMotion, size: Size, name: str) -> str | None:
    """Tilt and yaw of the container over a motion [°], or its rates; None: it does not turn."""
    inputs = motion.inputs
    turning = turning_of(inputs)
    if turning is None:
        return None
    values, label = turning
    return _vector_chart(inputs.t, values, 180.0 / np.pi, label, size, name)


def turning_of(inputs: Inputs) -> tuple[Array, str] | None:
    """(N, 2) tilt and yaw [rad], or (N, 3) rates [rad/s], and the axis' label in degrees."""
    if inputs.attitude is not None:
        x, y, z, w = (inputs.attitude / np.linalg.norm(inputs.attitude, axis=1)[:, None]).T
        upright = np.clip(1.0 - 2.0 * (x**2 + y**2), -1.0, 1.0)
        angles = np.column_stack([np.arccos(upright), np.unwrap(2.0 * np.arctan2(z, w))])
        return (angles, "angle [°]") if np.ptp(angles, axis=0).max() > TURNING else None
    if inputs.angular_velocity is None or np.abs(inputs.angular_velocity).max() < TURNING:
        return None
    return inputs.angular_velocity, "rate [°/s]"


def _vector_chart(t: Array, values: Array, scale: float, label: str, size: Size, name: str) -> str:
    def draw(axes: Any) -> None:
        axes.axhline(0.0, color=INK, linewidth=0.8)
        for component, colour, dashes in zip(values.T, COLOURS, STYLES, strict=False):
            draw_line(axes, t, component, colour, 1.3, dashes, chart_points(size), scale=scale)
        axes.set_ylabel(label)

    return time_chart(draw, time_ends(t), size, name)


def _letters(axes: Any, moments: Iterable[tuple[str, float]]) -> None:
    for letter, moment in moments:
        badge(axes, moment, letter)
