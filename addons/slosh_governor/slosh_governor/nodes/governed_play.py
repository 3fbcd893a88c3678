"""Publishes an operator's commands and moves the simulated container by the governor's output."""

from __future__ import annotations

import bisect
import math
import queue
import threading
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np
from geometry_msgs.msg import TwistStamped
from rclpy.node import Node

from slosh_base.types import Array
from slosh_bringup.cell.motions import CellMotion
from slosh_bringup.errors import SloshBringupError
from slosh_bringup.nodes.cell_messages import WORLD_FRAME
from slosh_governor.governed_cup import (
    CupSample,
    GovernedCup,
    GovernedOutcome,
    GovernedStep,
    commanded_velocity,
)
from slosh_msgs.msg import GovernedMotion
from slosh_msgs_py import qos, topics
from slosh_msgs_py.stamps import to_nanoseconds, to_time

TICK = 0.002  # s; between two looks at what is due
COMMANDS = 100.0  # Hz; of the operator
SILENCE = 5.0  # s; without a step of the governor, after which the play ends
RESTS = 5.0  # s; after the last command, until which the container must be at rest


class GovernedPlay:
    """Publishes an operator's commands and moves a container by the governor's output.

    Args:
        node: of the simulated cell.
        motion: that the operator wants.
        cup: the container, at rest.
        period: of the governor [s].

    Attributes:
        cup: the container.
        limit: of the height, that the governor keeps [m]; NaN: it has not told.
        late: largest delay of a sample [s].
        ended: whether the container is at rest after the last command.
    """

    def __init__(self, node: Node, motion: CellMotion, cup: GovernedCup, period: float) -> None:
        self._clock, self._motion, self._period = node.get_clock(), motion, period
        self._velocity = commanded_velocity(motion)
        self.cup, self.limit, self.late, self.ended = cup, math.nan, 0.0, False
        self._told: queue.SimpleQueue[GovernedMotion] = queue.SimpleQueue()
        self._due: deque[CupSample] = deque()
        self._begun_ns, self._start_ns, self._state = 0, 0, GovernedMotion.RESTING
        node.create_subscription(
            GovernedMotion, topics.GOVERNED_MOTION, self._told.put, qos.STREAM_IN
        )

    @property
    def outcome(self) -> GovernedOutcome:
        """Comparison of the governed with the commanded motion: distance and liquid height."""
        return self.cup.outcome(self._motion, self.limit)

    @property
    def duration(self) -> float:
        """Time from the start to the end of the motion [s]; infinite until it has ended."""
        return self._offset + self.cup.now if self.ended else math.inf

    def knows(self, t: float) -> bool:
        """Returns whether the liquid heights are computed for a time since the start [s]."""
        return self.ended or (self._begun_ns > 0 and t <= self._offset + self.cup.now)

    def heights(self, t: float) -> tuple[float, float]:
        """Returns liquid heights [m] at the wall at +x and +y, at a time since the start [s]."""
        return self.cup.at(t - self._offset)

    def run(
        self,
        start_ns: int,
        publish: Callable[[str, Any], None],
        send: Callable[[int, CupSample], None],
        stop: threading.Event,
    ) -> None:
        """Runs until the container is at rest after the last command, or a stop is requested.

        Args:
            start_ns: of the motion [ns].
            publish: sends a message to a topic.
            send: publishes the sensors' readings of a sample, with its stamp [ns].
            stop: ends the play.

        Raises:
            SloshBringupError: steps of the governor that do not follow each other, or none.
        """
        self._start_ns, commands, heard = start_ns, 0, 0.0
        try:
            while not stop.wait(TICK):
                now_ns = int(self._clock.now().nanoseconds)
                t = 1e-9 * (now_ns - start_ns)
                if t * COMMANDS >= commands:
                    commands = math.floor(t * COMMANDS) + 1
                    publish(topics.DESIRED_TWIST, self._command(now_ns, t))
                heard = t if self._follow() else heard
                self._send_due(now_ns, send)
                if t - heard > SILENCE:
                    raise SloshBringupError(
                        f"no {topics.GOVERNED_MOTION} for {SILENCE:g} s: the governor is silent"
                    )
                if self._is_over(t):
                    break
        finally:
            self.ended = True

    @property
    def _offset(self) -> float:
        """Time from the start to the governor's first step [s]."""
        return 1e-9 * (self._begun_ns - self._start_ns) if self._begun_ns else 0.0

    def _command(self, now_ns: int, t: float) -> TwistStamped:
        """Creates the velocity command at a time since the start [s]."""
        row = bisect.bisect_right(self._motion.t, t) - 1
        over = t > self._motion.duration
        wanted = np.zeros(3) if over else self._velocity[max(row, 0)]
        return twist_message(to_time(now_ns), wanted)

    def _follow(self) -> bool:
        """Moves the container by the governor's new steps; returns False if there are none."""
        moved = False
        while not self._told.empty():
            told = self._told.get()
            moved = True
            if not told.steps:
                continue
            self._begun_ns = self._begun_ns or to_nanoseconds(told.header.stamp)
            self._state, self.limit = told.state, told.limit
            end = 1e-9 * (to_nanoseconds(told.header.stamp) - self._begun_ns) + self._period
            motion = np.array(told.velocity), np.array(told.acceleration)
            self._due += self.cup.move(GovernedStep(told.steps, end, *motion))
        return moved

    def _send_due(self, now_ns: int, send: Callable[[int, CupSample], None]) -> None:
        """Sends the sensor samples whose stamps are not in the future."""
        while self._due:
            stamp_ns = self._begun_ns + round(1e9 * self._due[0].t)
            if stamp_ns > now_ns:
                return
            self.late = max(self.late, 1e-9 * (now_ns - stamp_ns))
            send(stamp_ns, self._due.popleft())

    def _is_over(self, t: float) -> bool:
        """Returns whether the motion has ended at a time since the start [s]."""
        after = t - self._motion.duration
        rests = self._state == GovernedMotion.RESTING and not self._due
        return after > 0.0 and (rests or after > RESTS)


def twist_message(stamp: Any, velocity: Array) -> TwistStamped:
    """Creates a TwistStamped message with a velocity in world axes [m/s]."""
    message = TwistStamped()
    message.header.stamp, message.header.frame_id = stamp, WORLD_FRAME
    linear = message.twist.linear
    linear.x, linear.y, linear.z = velocity.tolist()
    return message
