"""Draws predicted motions side by side, as a picture and as an HTML page."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from markupsafe import Markup

from slosh_base.files.plain_text import plain_line
from slosh_base.types import Array
from slosh_bringup.simulate.chart import FAR, new_picture
from slosh_model.model import Model
from slosh_model.tilt import attitude_of, with_tilt
from slosh_plan import Prediction, Trajectory
from slosh_plan.heights import highest, msh_of
from slosh_plan.prediction import checked_horizon
from slosh_report.page.series import envelope
from slosh_report.page.svg import INK, LIMIT, LINEAR, NONLINEAR, SMALL, time_chart, time_ends
from slosh_report.page.template import make_environment

LOW = (SMALL[0], 1.7)

PANEL, PICTURE_HEIGHT = 3.6, 5.4
"""Width of a motion's panels and height of the picture [in]."""

MOST = 12
"""So many motions are drawn; the table holds all."""
HEADROOM = 1.15


class Palette(NamedTuple):
    """Colours of the lines in a diagram."""

    nonlinear: str
    linear: str
    limit: str
    ink: str


COLOURS = Palette(NONLINEAR, LINEAR, LIMIT, INK)
PICTURE_COLOURS = Palette("tab:blue", "tab:orange", "tab:red", "dimgray")


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


def draw_heights(axes: Any, one: PredictedProfile, colours: Palette, top: float) -> None:
    """Draws the heights of linear and nonlinear model, the limit or rim, and the motion's end."""
    axes.plot(*envelope(one.t, 1e3 * one.linear), color=colours.linear, linestyle=(0, (4, 2)))
    axes.plot(*envelope(one.t, 1e3 * one.nonlinear), color=colours.nonlinear)
    limits = one.answer.limits
    if 1e3 * limits.height < top:
        axes.axhline(1e3 * limits.height, color=colours.limit, linestyle=(0, (1, 2)))
        axes.annotate(
            f"{limits.height_name} {1e3 * limits.height:.1f} mm", (0.99, 1e3 * limits.height),
            xycoords=axes.get_yaxis_transform(), ha="right", va="bottom", color=colours.limit,
        )  # fmt: skip
    axes.axvline(one.answer.duration, color=colours.ink, linewidth=0.8, linestyle=(0, (1, 3)))
    axes.set_ylim(0.0, top)


def draw_acceleration(axes: Any, one: PredictedProfile, colours: Palette, top: float) -> None:
    """Draws the magnitude of the container's acceleration over time."""
    axes.plot(*envelope(one.t, one.acceleration), color=colours.ink)
    axes.axvline(one.answer.duration, color=colours.ink, linewidth=0.8, linestyle=(0, (1, 3)))
    axes.set_ylim(0.0, top)


def render_page(
    facts: Sequence[Mapping[str, Any]],
    shown: Sequence[PredictedProfile],
    doubts: Sequence[Sequence[str]],
) -> str:
    """Renders the HTML page of predicted motions; all texts in it are escaped.

    Args:
        facts: of all motions, as `slosh predict --json` gives them.
        shown: those that are drawn, the first ones.
        doubts: of all motions, what casts doubt on each as an input.
    """
    headline = f"{len(facts)} predicted motions"
    if any(one.answer.limits.given for one in shown):
        kept = sum(bool(row["kept"]) for row in facts)
        headline = f"{kept} of {len(facts)} motions within their limits"
    noted = [
        (row["trajectory"], "; ".join([*row["remarks"], *own]))
        for row, own in zip(facts, doubts, strict=True)
        if row["remarks"] or own
    ]
    template = make_environment("slosh_bringup.predict").get_template("predict.html.j2")
    return template.render(
        facts=facts,
        noted=noted,
        headline=headline,
        shown=shown,
        charts=[_charts(one, number, *scales(shown)) for number, one in enumerate(shown)],
    )


def _charts(
    one: PredictedProfile, number: int, height: float, acceleration: float
) -> tuple[Markup, Markup]:
    """Draws a motion's heights and acceleration as two SVG charts."""

    def heights(axes: Any) -> None:
        draw_heights(axes, one, COLOURS, height)
        axes.set_ylabel("height [mm]")

    def strength(axes: Any) -> None:
        draw_acceleration(axes, one, COLOURS, acceleration)
        axes.set_ylabel("‖a‖ [m/s²]")

    ends = time_ends(one.t)
    return (
        Markup(time_chart(heights, ends, SMALL, f"height-{number}")),
        Markup(time_chart(strength, ends, LOW, f"acceleration-{number}")),
    )


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
            draw_heights(upper, one, PICTURE_COLOURS, height)
            draw_acceleration(lower, one, PICTURE_COLOURS, acceleration)
            title = [plain_line(one.answer.name), *one.words()]
            upper.set_title("\n".join(title), fontsize=10.0)
            lower.set_xlabel("time [s]")
        rows[0][0].set_ylabel("height [mm], dashed: linear")
        rows[1][0].set_ylabel("‖a‖ [m/s²]")
