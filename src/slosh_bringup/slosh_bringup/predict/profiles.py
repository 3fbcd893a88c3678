"""Heights and accelerations of predicted motions over time, and the panels that show them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from slosh_base.types import Array
from slosh_bringup.simulate.chart import FAR
from slosh_model.model import Model
from slosh_model.simulate import simulate
from slosh_model.tilt import attitude_of, feeling
from slosh_plan import Prediction, Trajectory
from slosh_plan.prediction import checked_horizon
from slosh_report.page.series import envelope

MOST = 12
"""So many motions are drawn; the table holds all."""
HEADROOM = 1.15


class Palette(NamedTuple):
    """Colours of a panel's lines."""

    nonlinear: str
    linear: str
    limit: str
    ink: str


@dataclass(frozen=True, slots=True, eq=False)
class Profile:
    """A motion over time, and what is predicted of it.

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
        """The greatest height by either model, without one that left its range [m]."""
        heights = np.concatenate((self.linear, self.nonlinear))
        return float(np.max(heights, where=np.isfinite(heights), initial=0.0))

    def words(self) -> list[str]:
        """What is predicted, in full."""
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
) -> list[Profile]:
    """The first MOST motions over time.

    Args:
        model, motions, horizon: as `slosh_plan.predict` had them.
        found: its answers.
    """
    after = checked_horizon(model, horizon)
    return [
        _profile(model, motion, answer, after)
        for motion, answer in list(zip(motions, found, strict=True))[:MOST]
    ]


def _profile(model: Model, motion: Trajectory, answer: Prediction, horizon: float) -> Profile:
    felt, inputs = feeling(model, attitude_of(motion)), motion.inputs(horizon)
    linear, nonlinear = (simulate(one, inputs)[0].msh for one in (felt.linear(), felt.nonlinear()))
    strength = np.linalg.norm(inputs.acceleration, axis=1)
    return Profile(inputs.t, linear, nonlinear, strength, answer)


def scales(shown: Sequence[Profile]) -> tuple[float, float]:
    """Tops of the height and of the acceleration axis, the same for all panels [mm], [m/s²]."""
    highest = 1e3 * max((one.highest for one in shown), default=0.0)
    limits = [1e3 * one.answer.limits.height for one in shown]
    near = [limit for limit in limits if limit < FAR * highest]
    strongest = max((float(one.acceleration.max(initial=0.0)) for one in shown), default=0.0)
    return HEADROOM * max([highest, *near]) or 1.0, HEADROOM * strongest or 1.0


def draw_heights(axes: Any, one: Profile, colours: Palette, top: float) -> None:
    """Heights by both models, limit or rim, and where the motion ends."""
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


def draw_acceleration(axes: Any, one: Profile, colours: Palette, top: float) -> None:
    """The size of the acceleration."""
    axes.plot(*envelope(one.t, one.acceleration), color=colours.ink)
    axes.axvline(one.answer.duration, color=colours.ink, linewidth=0.8, linestyle=(0, (1, 3)))
    axes.set_ylim(0.0, top)
