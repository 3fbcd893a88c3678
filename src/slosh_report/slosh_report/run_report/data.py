"""Contents of a report: arrays and tables in SI units."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Array
from slosh_report.errors import SloshReportError
from slosh_report.page.frame import Frame
from slosh_report.run_report.rows import (
    CheckRow,
    ExcessSpan,
    Fact,
    KeyFigure,
    ModelRow,
    RunMotion,
    Status,
    TopicRow,
    VerificationRow,
)

OPEN = Status()


@dataclass(frozen=True, slots=True)
class AzimuthSeries:
    """Azimuth of the liquid's highest point over time.

    Attributes:
        name: "measured", or the model's.
        t: (N,) on the report's time axis [s], not decreasing.
        azimuth: (N,) from the container's +x, counter-clockwise from above [rad]; NaN: unknown.
        height: (N,) of that point [m]; NaN: unknown.

    Raises:
        SloshReportError: series that do not match, or time that goes back.
    """

    name: str
    t: Array
    azimuth: Array
    height: Array

    def __post_init__(self) -> None:
        _check_time(self.t, f"azimuth of {self.name}: t")
        for name in ("azimuth", "height"):
            _check_shape(getattr(self, name), self.t, f"azimuth of {self.name}: {name}")


@dataclass(frozen=True, slots=True)
class RunReport:
    """Everything that the HTML report of a run shows.

    Attributes:
        title, subtitle: headings.
        t: (N,) [s], not decreasing, from the run's start.
        measured, linear, nonlinear: (N,) heights [m]; NaN: none.
        linear_name, nonlinear_name: of the two models.
        saturated: (N,) whether the measured height is a lower bound only; None: never.
        limit: of the height [m]; None: none.
        limit_name: what it is: the limit that was set, or the rim of the container.
        measured_azimuth, estimated_azimuth: of the highest point; None: not known.
        status: passed, failed or no expectation, with reasons.
        checks: numbers against what was expected of them.
        verifications: what was recorded and whether it came out again.
        key_figures, facts, events, models, motions, frames, topics: tables, in the order shown.
        model_text: the model file.
        effects: of the model: what each is, in a sentence, by name.
        further: of each container behind a tray's first that has a camera: its heights, with its
            name as title.
        warnings: what a reader must know before believing the page, one line each.
        notes: remarks, one line each.

    Raises:
        SloshReportError: series that do not match, or time that goes back.
    """

    title: str
    t: Array
    measured: Array
    linear: Array
    nonlinear: Array
    subtitle: str = ""
    linear_name: str = "L"
    nonlinear_name: str = "NL"
    limit: float | None = None
    limit_name: str = "limit"
    key_figures: tuple[KeyFigure, ...] = ()
    events: tuple[ExcessSpan, ...] = ()
    models: tuple[ModelRow, ...] = ()
    frames: tuple[Frame, ...] = ()
    topics: tuple[TopicRow, ...] = ()
    model_text: str = ""
    effects: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    status: Status = OPEN
    checks: tuple[CheckRow, ...] = ()
    verifications: tuple[VerificationRow, ...] = ()
    facts: tuple[Fact, ...] = ()
    motions: tuple[RunMotion, ...] = ()
    measured_azimuth: AzimuthSeries | None = None
    estimated_azimuth: AzimuthSeries | None = None
    saturated: NDArray[np.bool_] | None = None
    further: tuple[RunReport, ...] = ()

    def __post_init__(self) -> None:
        _check_time(self.t, "t")
        for name in ("measured", "linear", "nonlinear"):
            _check_shape(getattr(self, name), self.t, name)
        if self.saturated is not None:
            _check_shape(self.saturated, self.t, "saturated")

    @property
    def duration(self) -> float:
        """Time from the first to the last sample [s]; 0 if there are none."""
        return float(self.t[-1] - self.t[0]) if len(self.t) else 0.0


def _check_time(t: Array, name: str) -> None:
    if t.ndim != 1:
        raise SloshReportError(f"{name} has the shape {t.shape}, expected one dimension")
    if not np.isfinite(t).all():
        raise SloshReportError(f"{name} holds a time that is not finite")
    back = np.flatnonzero(np.diff(t) < 0.0)
    if len(back):
        raise SloshReportError(f"{name} goes back after {t[back[0]]:.3f} s; sort it by time")


def _check_shape(series: NDArray[np.generic], t: Array, name: str) -> None:
    if series.shape != t.shape:
        raise SloshReportError(f"{name} has the shape {series.shape}, t has {t.shape}")
