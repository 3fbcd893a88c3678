"""Result of a simulated motion: peak height, limit, rim, and faults of the input table."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from slosh_base.types import Array
from slosh_estimator.validity import began_text
from slosh_model.gaps import row_spacing, unresolved
from slosh_model.least_wave import growth_text
from slosh_model.model import Model
from slosh_model.simulate import Inputs
from slosh_model.wall import Wall, WallPlace
from slosh_motion.checks.constancy import BEGAN
from slosh_motion.checks.table_checks import InputDoubt, motion_doubts
from slosh_motion.tables.motion_table import MotionTable
from slosh_plan.doubts import rows_doubt
from slosh_plan.limits import HeightLimits
from slosh_plan.validity import greatest


@dataclass(frozen=True, slots=True)
class SimulationAnswer:
    """Result of a simulated motion: peak height, limits and warnings.

    Attributes:
        model: its name.
        samples: rows of the motion.
        peak: greatest height over the wall, as a sensor reads it [m].
        peak_time: when, on the motion's clock [s].
        liquid_peak: the liquid's own greatest height [m].
        limit: greatest height that is allowed [m]; None: not asked.
        freeboard: height of the rim above the still level [m]; None: unknown.
        acceleration: greatest ‖a‖ of the motion [m/s²].
        jerk: greatest change of it [m/s³].
        rim_distance: least vertical distance to the rim that is allowed [m]; 0: the rim itself.
        wall: the container's.
        outside: why this model was not validated for it, one text each; empty: it was.
        doubts: what looks wrong in the table, one text each.
        unresolved: share by which heights may be higher since rows are far apart.
        growth: by which vertical acceleration makes the smallest wave grow; 1: not visibly.
    """

    model: str
    samples: int
    peak: float
    peak_time: float
    liquid_peak: float
    limit: float | None
    freeboard: float | None
    acceleration: float
    jerk: float
    rim_distance: float
    wall: Wall
    outside: tuple[str, ...]
    doubts: tuple[InputDoubt, ...]
    unresolved: float = 0.0
    growth: float = 1.0

    @property
    def doubtful(self) -> bool:
        """Whether the input table looks faulty, so that the result is unreliable."""
        return any(doubt.wrong for doubt in self.doubts)

    @property
    def over_limit(self) -> bool | None:
        """Whether the peak height may exceed the limit, or None if no limit is given."""
        return None if self.limit is None else self._upper(self.peak) > self.limit

    def _upper(self, height: float) -> float:
        """Returns the greatest height that the motion between the rows allows [m]."""
        return height * (1.0 + self.unresolved) if height > 0.0 else height

    @property
    def place(self) -> WallPlace:
        """Place on the wall where the liquid reaches its greatest height."""
        return self.wall.place(self._upper(self.liquid_peak))

    @property
    def over_rim(self) -> bool | None:
        """Whether the liquid rises above the rim, or None if the rim's height is unknown."""
        return None if self.freeboard is None else self.place.distance_to_rim < 0.0

    @property
    def too_near(self) -> bool | None:
        """Whether the liquid comes closer to the rim than allowed, or None if that is unknown."""
        return None if self.freeboard is None else self.place.distance_to_rim < self.rim_distance

    def facts(self) -> dict[str, Any]:
        """Returns the result as a dictionary in SI units; unknown values are None."""
        return {
            "model": self.model,
            "peak": self.peak,
            "peak_time": self.peak_time,
            "samples": self.samples,
            "within_validity": not self.outside and not self.doubtful,
            "outside": list(self.outside),
            "limit": self.limit,
            "over_limit": self.over_limit,
            "freeboard": self.freeboard,
            "over_rim": self.over_rim,
            "rim_distance": self.rim_distance,
            "over_rim_distance": self.too_near,
            "wall": self._wall_facts(),
            "peak_acceleration": self.acceleration,
            "peak_jerk": self.jerk,
            "warnings": list(self.doubts),
            "peak_upper": self._upper(self.peak) if math.isfinite(self.unresolved) else None,
            "growth": self.growth,
        }

    def text(self) -> str:
        """Formats the result in one line, heights in mm."""
        parts = [f"{self.model}: peak {1e3 * self.peak:.1f} mm at t = {self.peak_time:.3f} s"]
        if 0.0 < self.unresolved < math.inf:
            parts.append(f"up to {1e3 * self._upper(self.peak):.1f} mm between the rows")
        if self.unresolved == math.inf:
            parts.append("the rows do not tell the motion: no height is certain")
        elif self.limit is not None:
            parts.append(_beside(self._upper(self.peak) - self.limit, "the limit", self.limit))
        if self.freeboard is not None and math.isfinite(self.unresolved):
            parts.append(_beside(-self.place.distance_to_rim, "the rim", self.freeboard))
            if self.rim_distance > 0.0:
                least = (
                    f"{'' if self.too_near else 'not '}less than {1e3 * self.rim_distance:g} mm"
                )
                parts.append(f"{least} to the rim")
        parts += [*self._on_wall(), *filter(None, [growth_text(self.growth)])]
        outside = f"outside validity ({', '.join(self.outside)})"
        valid = "input doubtful, see the warning" if self.doubtful else "within validity"
        parts.append(outside if self.outside else valid)
        return ", ".join(parts)

    def _on_wall(self) -> list[str]:
        found, along, wall = [], self.place.height_along_wall, self.wall
        if wall.leans and math.isfinite(along):
            found.append(f"{1e3 * along:.1f} mm along the inclined wall")
        if wall.crest_inside:
            found.append(
                f"the crest is {1e3 * wall.crest_place:.0f} mm from the axis, "
                f"{wall.crest_ratio:.2f} times as high"
            )
        return found

    def _wall_facts(self) -> dict[str, float | None]:
        """Returns where on the wall the liquid is highest, for JSON; unknown values are None."""
        facts = {**self.place._asdict()}
        if self.wall.crest_inside:
            facts |= {"crest_ratio": self.wall.crest_ratio, "crest_place": self.wall.crest_place}
        return {name: value if math.isfinite(value) else None for name, value in facts.items()}


def make_answer(
    model: Model,
    inputs: Inputs,
    heights: tuple[Array, Array, Array],
    limits: HeightLimits,
    doubts: tuple[InputDoubt, ...],
    growth: float = 1.0,
) -> SimulationAnswer:
    """Computes peak height, limits and warnings of a simulated motion.

    Args:
        model: what was simulated.
        inputs: the motion.
        heights: (M,) times, between the rows and after the last one, too [s], (M,) height as a
            sensor reads it, and (M,) the liquid's own maximum [m].
        limits: what was asked to be kept.
        doubts: what looks wrong in the table.
        growth: by which vertical acceleration makes the smallest wave grow.
    """
    t, read, liquid = heights
    peak = int(np.argmax(read))
    acceleration, jerk = greatest(inputs)
    return SimulationAnswer(
        model=model.name,
        samples=len(inputs.t),
        peak=float(read[peak]),
        peak_time=float(t[peak]),
        liquid_peak=float(liquid.max()),
        limit=limits.height if math.isfinite(limits.height) else None,
        freeboard=model.container.freeboard,
        acceleration=acceleration,
        jerk=jerk,
        rim_distance=limits.rim_distance,
        wall=model.container.wall,
        outside=_outside(model, acceleration, jerk, float(liquid.max())),
        doubts=doubts,
        unresolved=unresolved(row_spacing(inputs.t, inputs.acceleration), model),
        growth=growth,
    )


def _outside(model: Model, acceleration: float, jerk: float, peak: float) -> tuple[str, ...]:
    """Lists the model's limits of validity that the motion exceeds."""
    limits = model.limits
    failing = model.container.linear_height
    bounds = (limits.acceleration, limits.jerk)
    if model == model.linear():
        bounds = (limits.planar_acceleration, limits.planar_jerk)
    high = (f"height {1e3 * peak:.3g} of {1e3 * failing:.3g} mm",) if peak > failing else ()
    found = (("acceleration", acceleration, "m/s²"), ("jerk", jerk, "m/s³"))
    return high + tuple(
        f"{name} {value:.3g} of {bound:g} {unit}"
        for (name, value, unit), bound in zip(found, bounds, strict=True)
        if value > bound
    )


def _beside(excess: float, name: str, bound: float) -> str:
    place = "above" if excess > 0.0 else "below"
    return f"{1e3 * abs(excess):.1f} mm {place} {name} of {1e3 * bound:g} mm"


def doubts(model: Model, motion: MotionTable) -> tuple[InputDoubt, ...]:
    """Lists what looks wrong in a motion table; empty if nothing does."""
    sparse = rows_doubt(row_spacing(motion.t, motion.acceleration), model)
    told = tuple(
        InputDoubt(began_text(remark.text, model) if BEGAN in remark.text else remark.text)
        for remark in motion.remarks
        if remark.wrong
    )
    if any(doubt.wrong for doubt in sparse):
        # What such rows tell of rest and gravity says nothing.
        return (*told, *sparse)
    seen = motion_doubts(motion.t, motion.acceleration, motion.attitude)
    return (*told, *sparse, *(doubt for doubt in seen if doubt not in told))
