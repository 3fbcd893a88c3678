"""Content of the HTML page and of the JSON document about a plan."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import numpy as np

from slosh_base.types import Array
from slosh_plan.planning.checked import CheckedMotion
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.planning.plan import Plan
from slosh_plan.planning.time_law import STEP
from slosh_report.json_values import plain

SCHEMA = 1

Document = dict[str, Any]


@dataclass(frozen=True, slots=True, eq=False)
class ShownMotion:
    """A motion along the path that a plan's HTML page shows, with its title.

    Attributes:
        title: for people.
        found: the motion and what it reaches.
    """

    title: str
    found: CheckedMotion

    @property
    def times(self) -> Array:
        """Times (M,) [s] of the heights, which continue after the motion's end."""
        return STEP * np.arange(len(self.found.msh), dtype=np.float64)

    @property
    def acceleration(self) -> Array:
        """Magnitude (N,) of the container's acceleration [m/s²]."""
        return np.asarray(np.linalg.norm(self.found.motion.acceleration, axis=1))

    @property
    def jerk(self) -> Array:
        """Magnitude (N - 1,) of the jerk [m/s³], by finite differences."""
        steps = np.diff(self.found.motion.acceleration, axis=0)
        return np.asarray(np.linalg.norm(steps, axis=1) / STEP)


@dataclass(frozen=True, slots=True, eq=False)
class PlanReport:
    """A plan, with other motions along the same path for comparison.

    Attributes:
        plan: the plan.
        model: the model's name.
        planned, scaled: the motion that was planned, and the best of known laws.
        proposal: the waypoints in their own times; None: they tell no motion.
        waypoints: (N, 3) [m].
        band: (2, M) lower and upper end of the planned motion's heights (95 %) [m]; None: the
            model's error is not known.
        subtitle: where model and path come from; may be empty.
        notes: what the reader must know, a sentence each.
    """

    plan: Plan
    model: str
    planned: ShownMotion
    scaled: ShownMotion
    proposal: ShownMotion | None
    waypoints: Array
    band: Array | None
    subtitle: str = ""
    notes: tuple[str, ...] = ()

    @property
    def upper(self) -> tuple[float, float] | None:
        """Upper ends of the 95 % band [m] for peak and residual height; None without a band."""
        if self.band is None:
            return None
        end = len(self.planned.found.motion.t) - 1
        return float(self.band[1].max()), float(self.band[1][end:].max())

    @property
    def motions(self) -> tuple[ShownMotion, ...]:
        """Comparison motions followed by the planned motion, without duplicates."""
        before = () if self.proposal is None else (self.proposal,)
        if self.scaled.found is self.planned.found:
            return (*before, self.planned)
        return (*before, self.scaled, self.planned)


def plan_json(report: PlanReport) -> str:
    """Returns the text of `plan.json`: strict JSON, identical for identical plans."""
    return json.dumps(plan_document(report), indent=2, allow_nan=False) + "\n"


def plan_document(report: PlanReport) -> Document:
    """Returns a report's numbers and names in SI units as a JSON-compatible dictionary.

    Every number that the page shows in a `<data>` element is in here: the element's `data-path`
    is its JSON pointer (RFC 6901) and its `value` is the number, to the last bit.
    """
    plan, upper = report.plan, report.upper
    document: Document = plain(
        {
            "schema": SCHEMA,
            "model": report.model,
            "method": plan.method,
            "law": plan.law,
            "reason": plan.reason or None,
            "limits": plan.limits,
            "margin": plan.margin,
            "upper": None if upper is None else upper[0],
            "residual_upper": None if upper is None else upper[1],
            "motions": [_motion(motion, plan.limits) for motion in report.motions],
            "path": {
                "length": plan.path.length,
                "stops": len(plan.path.legs) - 1,
                "departure": plan.path.departure,
                "waypoints": len(report.waypoints),
            },
            "seconds": plan.seconds,
            "notes": report.notes,
        }
    )
    return document


def _motion(motion: ShownMotion, limits: PlanLimits) -> Document:
    found = motion.found
    return {
        "title": motion.title,
        "duration": found.motion.duration,
        "speed": float(found.motion.speed.max()),
        "peak": found.peak,
        "residual": found.residual,
        "acceleration": found.acceleration,
        "jerk": found.jerk,
        "exceeds": [name for name, share in found.excess(limits).items() if share > 1e-9],
    }
