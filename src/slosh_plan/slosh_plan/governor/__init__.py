"""The streaming governor: safe motion from commands, in real time."""

from slosh_plan.governor.governor import (
    Command,
    Governed,
    Governor,
    GovernorState,
    ModelDoubt,
    SeenLiquid,
    StopReason,
)

__all__ = [
    "Command",
    "Governed",
    "Governor",
    "GovernorState",
    "ModelDoubt",
    "SeenLiquid",
    "StopReason",
]
