"""What is asked of the governor: commands, stops, and why it does not follow."""

from __future__ import annotations

import math

import numpy as np

from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array
from slosh_governor.core import layout
from slosh_governor.core.commands import Command, StopReason
from slosh_governor.core.robot_arm import GovernedArm
from slosh_governor.tuning import TUNING
from slosh_plan.trajectory import FARTHEST

_OVERDUE = (StopReason.SILENT, StopReason.LATE)
"""Reasons that do not replace another one."""


class Requests:
    """Holds the command in force, and the reason to stop.

    Args:
        size: coordinates of a command.
        timeout: a command holds for so long [s].
        arm: robot whose joints are commanded; None: x, y, z are.

    Attributes:
        command: in force; None: none is.
        latest: the last one that was given.
        count: of all that were given.
        reason: to stop.
        lost: whether the joints' positions are unknown.
        sent_ns: stamp of the command in force, or of one that its stamp made refused [ns]; 0:
            none.
        origin: (3,) by which targets differ from the governor's own places; None: not known yet.
    """

    def __init__(self, size: int, timeout: float, arm: GovernedArm | None) -> None:
        self._size, self._timeout, self._arm = size, timeout, arm
        self._bounds = None if arm is None else arm.bounds
        self.command: Command | None = None
        self.latest, self.count = Command(0), 0
        self.reason, self.lost = StopReason.NONE, False
        self.origin: Array | None = None
        self._came, self._taken_ns, self.sent_ns = False, 0, 0

    @property
    def follows(self) -> bool:
        """Whether a command is followed."""
        return self.reason is StopReason.NONE and self.command is not None

    def take(self, command: Command) -> None:
        """Stores a command for the next step; it replaces the previous command."""
        self.count += 1
        self.command = self.latest = command
        self._came = True

    def release(self, *, rests: bool) -> bool:
        """Ends a requested stop if the container rests; returns whether none is requested."""
        if self.reason is StopReason.REQUESTED and rests:
            self.reason = StopReason.NONE
            self.command = None
        return self.reason is not StopReason.REQUESTED

    def look(self, now_ns: int, since: float, *, late: bool, rests: bool) -> None:
        """Sets the reason to stop (bad or old command, late step, lost joints), or clears it.

        Args:
            now_ns: time of the step [ns].
            since: time since the step before [s].
            late: whether it is late.
            rests: whether the container is at rest.
        """
        came, self._came, self.sent_ns = self._came, False, 0
        if came:
            self._taken_ns = now_ns
        known = self.reason is not StopReason.JOINTS or rests
        if self.reason is not StopReason.REQUESTED and (self.lost or not known):
            self.command, self.reason = None, StopReason.JOINTS
            return
        reason = StopReason.NONE
        if self.command is not None:
            self.sent_ns = self.command.stamp_ns
            reason = self._refusal(self.command)
            if reason is StopReason.NONE:
                reason = self._overdue(now_ns, since if came else math.nan, late=late)
        if reason is not StopReason.NONE:
            self.command = None
            self.sent_ns = self.sent_ns if reason is StopReason.STAMP else 0
            refused = reason not in _OVERDUE and self.reason is not StopReason.REQUESTED
            if refused or self.reason is StopReason.NONE:
                self.reason = reason
        elif rests and self.command is not None and self.reason != StopReason.REQUESTED:
            self.reason = StopReason.NONE

    def _overdue(self, now_ns: int, since: float, *, late: bool) -> StopReason:
        """Returns why the command in force is not of the present: NONE if it is.

        Args:
            now_ns: time of the step [ns].
            since: time in which it has come [s]; NaN: it was there before.
            late: whether the step is late: then stamps say nothing.
        """
        age = (now_ns - self.sent_ns) / SECOND if self.sent_ns else 0.0
        early = max(self._timeout, TUNING.timeout)
        if not late and (age < -early or age > self._timeout + since) and since == since:
            return StopReason.STAMP
        if now_ns - self._taken_ns > self._timeout * SECOND:
            return StopReason.SILENT
        return StopReason.LATE if late else StopReason.NONE

    def _refusal(self, command: Command) -> StopReason:
        """Returns why a command is refused: NONE if it is finite, plausible and complete."""
        if command.refused is not StopReason.NONE:
            return command.refused
        size, speed = self._size, math.hypot(*command.velocity)
        if TUNING.fastest < speed < math.inf:
            return StopReason.FAST
        numbers = command.velocity if command.target is None else command.target
        usable = len(command.velocity) in (0, size) and len(numbers) == size and speed < math.inf
        if usable and command.target is not None:
            usable = math.hypot(*command.target) <= FARTHEST
            if self._arm is not None:
                usable = self._arm.usable(command.target)
        return StopReason.NONE if usable else StopReason.INVALID

    def velocity(self, place: Array) -> Array:
        """Returns the velocity (D,) to aim at; it is proportional to the distance to a target.

        Args:
            place: (D,) present positions.
        """
        wanted: Array = np.zeros(self._size)
        command = self.command
        if not self.follows or command is None:
            return wanted
        if command.velocity:
            wanted = np.array(command.velocity, dtype=np.float64)
        if command.target is None:
            return self._within(wanted, place)
        target = np.array(command.target)
        if self._bounds is not None:
            target = np.clip(target, self._bounds[layout.LOWER], self._bounds[layout.UPPER])
        elif self.origin is None:
            self.origin = target - place
        origin = 0.0 if self.origin is None else self.origin
        return self._within(wanted + TUNING.pull * (target - origin - place), place)

    def _within(self, velocity: Array, place: Array) -> Array:
        """Limits velocities (D,) to the joints' maxima, and lower near the position limits."""
        bounds, slack = self._bounds, TUNING.slack
        if bounds is None:
            return velocity
        low, high = bounds[layout.LOWER] - place, bounds[layout.UPPER] - place
        near = np.clip(velocity, TUNING.pull * low, TUNING.pull * high)
        fastest = (1.0 - slack) * bounds[layout.FASTEST]
        return np.clip(near, -fastest, fastest)
