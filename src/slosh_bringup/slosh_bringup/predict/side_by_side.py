"""Draws predicted motions side by side, in a picture and on a page."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from slosh_base.files.plain_text import plain_line
from slosh_base.types import Array
from slosh_bringup.simulate.chart import FAR, new_picture
from slosh_model.model import Model
from slosh_model.tilt import attitude_of, with_tilt
from slosh_plan import Prediction, Trajectory
from slosh_plan.heights import highest, msh_of
from slosh_plan.prediction import checked_horizon
from slosh_report.document import Chart, Document, Figure, Group, Line, Paragraph, Section, explain
from slosh_report.page.series import envelope
from slosh_report.page.svg import INK, LIMIT, SMALL
from slosh_report.texts import Mark

PANEL, PICTURE_HEIGHT = 3.6, 5.4
"""Width of a motion's panels and height of the picture [in]."""

MOST = 12
"""So many motions are drawn; the table holds all."""
HEADROOM = 1.15


@dataclass(frozen=True, slots=True, eq=False)
class PredictedProfile:
    """Predicted heights and acceleration of one motion over time.

    Attributes:
        t: (N,) with the time after the motion's end [s].
        linear, nonlinear: (N,) greatest height at the wall by the two models [m].
        acceleration: (N,) its size [m/s²].
        answer: peak, azimuth and the rest.
    """

    t: Array
    linear: Array
    nonlinear: Array
    acceleration: Array
    answer: Prediction

    @property
    def highest(self) -> float:
        """Greatest height [m] of the linear or nonlinear model within its range of validity."""
        heights = np.concatenate((self.linear, self.nonlinear))
        return float(np.max(heights, where=np.isfinite(heights), initial=0.0))

    def words(self) -> list[str]:
        """Describes peak height and limit of the prediction in sentences."""
        one = self.answer
        found = one.nonlinear
        return [
            f"peak {1e3 * found.peak:.1f} mm at {found.peak_time:.2f} s",
            f"linear peak {1e3 * one.linear.peak:.1f} mm",
            f"azimuth {math.degrees(found.azimuth):.0f}°",
            f"residual {1e3 * found.residual:.1f} mm",
        ]

    @property
    def limit(self) -> str:
        """Name and height of the limit."""
        limits = self.answer.limits
        return f"{limits.height_name} {1e3 * limits.height:.1f} mm"


def profiles(
    model: Model,
    motions: Sequence[Trajectory],
    found: Sequence[Prediction],
    horizon: float | None = None,
) -> list[PredictedProfile]:
    """Returns the predicted heights over time of the first MOST motions.

    Args:
        model, motions, horizon: as `slosh_plan.predict` had them.
        found: its answers.
    """
    after = checked_horizon(model, horizon)
    return [
        _profile(model, motion, answer, after)
        for motion, answer in list(zip(motions, found, strict=True))[:MOST]
    ]


def _profile(
    model: Model, motion: Trajectory, answer: Prediction, horizon: float
) -> PredictedProfile:
    used, inputs = with_tilt(model, attitude_of(motion)), motion.inputs(horizon)
    linear, nonlinear = (
        msh_of(model.container, highest(one, [inputs])[0].heights)
        for one in (used.linear(), used.nonlinear())
    )
    strength = np.linalg.norm(inputs.acceleration, axis=1)
    return PredictedProfile(inputs.t, linear, nonlinear, strength, answer)


def scales(shown: Sequence[PredictedProfile]) -> tuple[float, float]:
    """Returns the upper ends of the axes: heights [mm] and acceleration [m/s²]."""
    highest = 1e3 * max((one.highest for one in shown), default=0.0)
    limits = [1e3 * one.answer.limits.height for one in shown]
    near = [limit for limit in limits if limit < FAR * highest]
    strongest = max((float(one.acceleration.max(initial=0.0)) for one in shown), default=0.0)
    return HEADROOM * max([highest, *near]) or 1.0, HEADROOM * strongest or 1.0


def _draw_bounds(axes: Any, one: PredictedProfile, *, limit: str, end: str) -> None:
    """Draws the limit of the height or the rim, if a colour is given, and the motion's end."""
    if limit:
        height = 1e3 * one.answer.limits.height
        axes.axhline(height, color=limit, linestyle=(0, (1, 2)))
    axes.axvline(one.answer.duration, color=end, linewidth=0.8, linestyle=(0, (1, 3)))


def with_charts(document: Document, shown: Sequence[PredictedProfile]) -> Document:
    """Adds the charts of predicted motions, with common axis scales, to their document.

    Args:
        document: of all motions.
        shown: those that are drawn, the first ones.
    """
    tops = scales(shown)
    charts = tuple(_figure(one, number, *tops) for number, one in enumerate(shown))
    first = f"The first {len(shown)} motions." if len(shown) < len(document.data) else ""
    blocks = (
        Paragraph(first, "explain"),
        Group(charts, "small-charts"),
        explain(
            "The charts have the same scales of height and of acceleration. The dotted vertical "
            "line is the end of the motion."
        ),
    )
    section = Section("Over time", blocks, "over-time")
    return replace(document, sections=(*document.sections, section))


def _figure(one: PredictedProfile, number: int, height: float, acceleration: float) -> Figure:
    """Returns a motion's heights and acceleration as two charts."""
    words = ", ".join(one.words())
    is_seen = 1e3 * one.answer.limits.height < height
    heights = Chart(
        f"height-{number}",
        Mark(one.answer.name, "b"),
        f"Heights over time: {words}",
        (
            Line("linear", "linear", one.t, one.linear),
            Line("nonlinear", "nonlinear", one.t, one.nonlinear),
        ),
        keys=(*[Mark(one.limit, "key limit")] * is_seen, Mark(words, "full")),
        draw=partial(_draw_bounds, one=one, limit=LIMIT if is_seen else "", end=INK),
        top=height,
        sizes=(SMALL,),
    )
    strength = Chart(
        f"acceleration-{number}",
        "",
        "Size of the acceleration over time",
        (Line("", "plain", one.t, one.acceleration),),
        "‖a‖ [m/s²]",
        1.0,
        draw=partial(_draw_bounds, one=one, limit="", end=INK),
        top=acceleration,
        sizes=((SMALL[0], 1.7),),
    )
    return Figure((heights, strength))


def write_picture(path: Path, shown: Sequence[PredictedProfile]) -> None:
    """Draws heights and acceleration of each motion, with common axis scales, to a file.

    Args:
        path: the `.png` or `.svg` file.
        shown: at least one.

    Raises:
        OSError: the file cannot be written; what was there is as it was.
    """
    height, acceleration = scales(shown)
    with new_picture(path, (max(PANEL * len(shown), 6.0), PICTURE_HEIGHT)) as figure:
        rows = figure.subplots(
            2, len(shown), sharey="row", sharex="col", height_ratios=(2, 1), squeeze=False
        )
        for one, upper, lower in zip(shown, *rows, strict=True):
            is_seen = 1e3 * one.answer.limits.height < height
            upper.plot(*envelope(one.t, 1e3 * one.linear), color="tab:orange", linestyle="--")
            upper.plot(*envelope(one.t, 1e3 * one.nonlinear), color="tab:blue")
            lower.plot(*envelope(one.t, one.acceleration), color="dimgray")
            for axes, limit in ((upper, "tab:red" if is_seen else ""), (lower, "")):
                _draw_bounds(axes, one, limit=limit, end="dimgray")
            title = [plain_line(one.answer.name), *one.words(), *[one.limit] * is_seen]
            upper.set_title("\n".join(title), fontsize=10.0)
            lower.set_xlabel("time [s]")
        rows[0][0].set_ylim(0.0, height)
        rows[1][0].set_ylim(0.0, acceleration)
        rows[0][0].set_ylabel("height [mm], dashed: linear, dotted: limit")
        rows[1][0].set_ylabel("‖a‖ [m/s²]")
