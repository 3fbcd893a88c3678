"""Map from a machine's speed to the stroke's time law; interpolated speeds are checked."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from slosh_base.types import Array
from slosh_machines.design import Stroke, StrokeHeights, designed, heights
from slosh_machines.profile import Profile
from slosh_machines.tuning import TUNING
from slosh_model.model import Model
from slosh_plan.errors import SloshPlanError
from slosh_plan.planning.limits import PlanLimits

SHARES = (0.25, 0.5, 0.75)
"""Places between two speeds of the map at which the interpolated law is simulated."""
FINEST = 0.05
"""Speeds that are nearer to each other are one [1/min]."""
MOST = 400
"""Speeds of a map, at most."""


@dataclass(frozen=True, slots=True, eq=False)
class MapRow:
    """The stroke's time law at one machine speed of the map.

    Attributes:
        speed: of the machine [1/min].
        profile: the law.
        found: its heights, over many cycles.
    """

    speed: float
    profile: Profile
    found: StrokeHeights


@dataclass(frozen=True, slots=True, eq=False)
class MotionMap:
    """Time laws by speed; between two speeds their coefficients are interpolated linearly.

    Attributes:
        stroke: the machine's cycle.
        limits: that all laws keep.
        rows: by rising speed; each and all laws between them keep the limits.
        checked: speeds between the rows whose laws were simulated, and their heights.
        fastest: highest speed asked for [1/min]; the map may end before.
        reason: why it ends before; empty: it does not.
    """

    stroke: Stroke
    limits: PlanLimits
    rows: tuple[MapRow, ...]
    checked: tuple[tuple[float, StrokeHeights], ...]
    fastest: float
    reason: str

    def profile(self, speed: float) -> Profile:
        """Returns the time law at a speed in the map's range [1/min].

        Raises:
            SloshPlanError: the speed is outside the range.
        """
        speeds = np.array([row.speed for row in self.rows])
        if not speeds[0] <= speed <= speeds[-1]:
            raise SloshPlanError(
                f"speed {speed:g}/min is outside the map, {speeds[0]:g} … {speeds[-1]:g}/min"
            )
        weights = np.array([row.profile.weights for row in self.rows])
        return Profile(np.array([np.interp(speed, speeds, column) for column in weights.T]))


def motion_map(
    model: Model,
    stroke: Stroke,
    speeds: Sequence[float],
    limits: PlanLimits,
    progress: Callable[[float], None] = lambda share: None,
) -> MotionMap:
    """Designs the time laws of a stroke for a machine's speeds, starting with the lowest.

    The map ends below the first speed at which a limit is exceeded, found to FINEST.

    Args:
        model: the model of the liquid; the stroke is along the container's x.
        stroke: the machine's cycle.
        speeds: rising [1/min].
        limits: of height, residual, acceleration and jerk.
        progress: is told the share that is done.

    Raises:
        SloshPlanError: the lowest speed exceeds a limit, or there is no safe one above it.
    """
    limits = limits.under_rim(model)
    rows: list[MapRow] = []
    checked: list[tuple[float, StrokeHeights]] = []
    reason = ""
    for number, speed in enumerate(speeds):
        row = _row(model, stroke, speed, limits, rows)
        added = _joined(model, stroke, row, limits, rows, checked)
        progress((number + 1) / len(speeds))
        if not added:
            reason = _approach(model, stroke, speed, limits, rows, checked) or _why(
                speed, row, limits
            )
            break
    if len(rows) < 2:
        raise SloshPlanError(
            f"no stroke keeps the limits at the lowest speed, or at any above it: {reason}"
        )
    return MotionMap(stroke, limits, tuple(rows), tuple(checked), float(speeds[-1]), reason)


def _row(
    model: Model, stroke: Stroke, speed: float, limits: PlanLimits, rows: list[MapRow]
) -> MapRow | None:
    """Designs the time law at a speed; None if acceleration or jerk limit forbid it."""
    before = rows[-1].profile if rows else None
    profile = designed(model, stroke, speed, limits, before)
    if profile is None:
        return None
    return MapRow(speed, profile, heights(model, stroke, profile, speed))


def _joined(
    model: Model,
    stroke: Stroke,
    row: MapRow | None,
    limits: PlanLimits,
    rows: list[MapRow],
    checked: list[tuple[float, StrokeHeights]],
    depth: int = 0,
) -> bool:
    """Appends a row to the map; first inserts rows if interpolated motions exceed a limit.

    Returns:
        whether the row was added; else all rows up to the last safe one were.
    """
    if row is None or row.found.excess(limits) > 0.0:
        return False
    if not rows:
        rows.append(row)
        return True
    between = _between(model, stroke, rows[-1], row)
    if all(found.excess(limits) <= 0.0 for _, found in between):
        checked += between
        rows.append(row)
        return True
    if depth == TUNING.halvings:
        return False
    middle = _row(model, stroke, 0.5 * (rows[-1].speed + row.speed), limits, rows)
    return _joined(model, stroke, middle, limits, rows, checked, depth + 1) and _joined(
        model, stroke, row, limits, rows, checked, depth + 1
    )


def _between(
    model: Model, stroke: Stroke, low: MapRow, high: MapRow
) -> list[tuple[float, StrokeHeights]]:
    """Simulates time laws that are interpolated between two rows of the map."""
    found = []
    for share in SHARES:
        weights: Array = (1.0 - share) * low.profile.weights + share * high.profile.weights
        speed = (1.0 - share) * low.speed + share * high.speed
        found.append((speed, heights(model, stroke, Profile(weights), speed)))
    return found


def _approach(
    model: Model,
    stroke: Stroke,
    unsafe: float,
    limits: PlanLimits,
    rows: list[MapRow],
    checked: list[tuple[float, StrokeHeights]],
) -> str:
    """Finds the highest safe speed below an unsafe one by bisection, and adds it to the map.

    Returns:
        in words what exceeds a limit just above it; empty: nothing was tried.
    """
    reason = ""
    while rows and unsafe - rows[-1].speed > FINEST:
        middle = 0.5 * (rows[-1].speed + unsafe)
        row = _row(model, stroke, middle, limits, rows)
        if not _joined(model, stroke, row, limits, rows, checked):
            unsafe, reason = middle, _why(middle, row, limits)
    return reason


def _why(speed: float, row: MapRow | None, limits: PlanLimits) -> str:
    """Describes in words which limit is exceeded at a speed."""
    if row is None:
        return (
            f"at {speed:.4f}/min the stroke needs more than {limits.acceleration:g} m/s² or "
            f"{limits.jerk:g} m/s³"
        )
    found = row.found
    if found.excess(limits) <= 0.0:
        return f"below {speed:.4f}/min no laws were found that can be interpolated"
    return (
        f"at {speed:.4f}/min the lowest wave has {1e3 * found.peak:.2f} of "
        f"{1e3 * limits.height:.4g} mm, in the dwell {1e3 * found.residual:.2f} of "
        f"{1e3 * limits.residual:.4g} mm"
    )
