"""Creates the governor from the parameters of its node, live and in a replay."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from slosh_model.model import Model
from slosh_plan.governor.governor import Command, Governor, ModelDoubt
from slosh_plan.planning.limits import PlanLimits

TWIST, POSE = "twist", "pose"
"""What commands are: velocities, or places to go to."""
TURNS = 1e-3
"""A larger angular velocity of a command [rad/s] is refused: it tilts or turns the container."""
_NOWHERE = (math.nan,) * 3


def governor_of(model: Model, parameters: Mapping[str, Any]) -> Governor:
    """Creates the governor of a node.

    Args:
        model: of the container and its liquid.
        parameters: of the node by name.

    Raises:
        SloshPlanError: an impossible limit.
    """
    height = float(parameters["limit"]) or float("inf")
    limits = PlanLimits(
        height, height, float(parameters["max_acceleration"]), float(parameters["max_jerk"]),
        rim_distance=float(parameters["rim_distance"]),
    )  # fmt: skip
    doubt = ModelDoubt(float(parameters["frequency_error"]), float(parameters["damping_factor"]))
    return Governor(
        model, limits, doubt=doubt, period=1.0 / float(parameters["rate"]),
        timeout=float(parameters["timeout"]),
    )  # fmt: skip


def velocity_command(
    stamp_ns: int, linear: tuple[float, ...], angular: tuple[float, ...]
) -> Command:
    """Creates a command from a TwistStamped; a rotation of the container makes it invalid.

    Args:
        stamp_ns: of the message [ns].
        linear, angular: x, y, z [m/s, rad/s].
    """
    x, y, z = linear if math.hypot(*angular) <= TURNS else _NOWHERE
    return Command(stamp_ns, (x, y, z))
