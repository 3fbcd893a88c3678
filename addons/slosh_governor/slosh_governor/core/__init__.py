"""Streaming governor: limits commanded motions in real time so that the liquid stays safe."""

from slosh_governor.core.commands import (
    Command,
    Governed,
    GovernorState,
    ModelDoubt,
    SeenLiquid,
    StopReason,
)
from slosh_governor.core.governor import Governor
from slosh_governor.core.robot_arm import GovernedArm

__all__ = [
    "Command",
    "Governed",
    "GovernedArm",
    "Governor",
    "GovernorState",
    "ModelDoubt",
    "SeenLiquid",
    "StopReason",
]
