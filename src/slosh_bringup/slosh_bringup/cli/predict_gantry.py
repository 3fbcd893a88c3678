"""`slosh predict --gantry`: safe accelerations for a machine with unknown strokes."""

from __future__ import annotations

import json
import math
from dataclasses import asdict

from slosh_model.model import Model
from slosh_plan.gantry import FASTEST, GantryLimits, gantry_limits
from slosh_plan.limits import HeightLimits
from slosh_plan.prediction import ModelError
from slosh_report.json_values import plain

RESIDUAL = 1e-3
"""Residual height at which the next stroke may begin, where none is given [m]."""


def gantry_text(
    model: Model,
    limits: HeightLimits,
    machine: float | None,
    error: ModelError,
    *,
    as_json: bool,
) -> str:
    """Computes safe accelerations of a machine's axes and describes them as text or JSON.

    Args:
        model: of the container and its liquid.
        limits: of the height in a stroke, and after it.
        machine: acceleration of each axis that the machine has [m/s²]; None: it can be set.
        error: of the model, whose heights keep the limits with their intervals.
        as_json: whether to describe them as JSON in SI units.
    """
    limits = limits.under_rim(model)
    quiet = min(limits.residual if math.isfinite(limits.residual) else RESIDUAL, limits.height)
    kept = HeightLimits(error.highest(limits.height), error.highest(quiet))
    found = gantry_limits(model, kept, machine)
    if as_json:
        return json.dumps(plain(asdict(found)))
    return "\n".join(_lines(found, quiet))


def _lines(found: GantryLimits, quiet: float) -> list[str]:
    lines = [
        "limits of each axis, for strokes of any length, two axes at once:",
        f"  acceleration up to {found.acceleration:.3g} m/s², or with a jerk of up to "
        f"{found.jerk:.3g} m/s³ up to {found.smooth_acceleration:.3g} m/s²",
        f"  wait {found.wait:.1f} s after a stroke until the liquid is below {1e3 * quiet:.3g} mm",
    ]
    if math.isfinite(found.speed):
        most = "any speed" if found.speed >= FASTEST else f"speed up to {found.speed:.3g} m/s"
        lines += [
            f"  at the machine's own acceleration: {most}",
            "Opentrons protocol (its acceleration is fixed):",
            f"  pipette.default_speed = {math.floor(1e3 * found.speed)}  # mm/s",
            f"  protocol.delay(seconds={math.ceil(found.wait)})",
        ]
    lines += ["PyLabRobot protocol:", f"  await asyncio.sleep({math.ceil(found.wait)})"]
    return lines
