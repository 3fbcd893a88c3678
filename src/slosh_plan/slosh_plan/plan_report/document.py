"""A plan as JSON: what the page's numbers are, for programs."""

from __future__ import annotations

import json
from typing import Any

from slosh_plan.plan_report.data import PlanReport, ShownMotion
from slosh_plan.planning.limits import PlanLimits
from slosh_report.json_values import plain

SCHEMA = 1

Document = dict[str, Any]


def plan_json(report: PlanReport) -> str:
    """The text of `plan.json`: strict JSON, the same for the same report."""
    return json.dumps(plan_document(report), indent=2, allow_nan=False) + "\n"


def plan_document(report: PlanReport) -> Document:
    """A report's numbers and names in SI units; `json.dumps` takes it as it is.

    Every number that the page shows in a `<data>` element is in here: the element's `data-path`
    is its JSON pointer (RFC 6901) and its `value` is the number, to the last bit.
    """
    plan, upper = report.plan, report.upper
    document: Document = plain(
        {
            "schema": SCHEMA,
            "model": report.model,
            "method": plan.method,
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
