"""Streaming governor: limits commanded motions in real time so that the liquid stays safe."""

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
