"""Simulated cell whose motion is commanded, and whose container moves as the governor allows."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from geometry_msgs.msg import TwistStamped

from slosh_bringup.errors import SloshBringupError
from slosh_bringup.nodes import cell_node
from slosh_bringup.nodes.cell_messages import PUBLISHED, accel_message, imu_message, pose_message
from slosh_governor.governed_cup import CupSample, GovernedCup, commanded_velocity
from slosh_governor.nodes.governed_play import GovernedPlay
from slosh_model.constants import GRAVITY
from slosh_msgs_py import qos, topics
from slosh_msgs_py.node.parameters import ParameterSpec
from slosh_msgs_py.node.readiness import Progress
from slosh_msgs_py.stamps import to_time

PARAMETERS = (
    *cell_node.PARAMETERS,
    ParameterSpec(
        "govern", 100.0,
        "rate of the governor that receives the motion's velocity as commands and moves the "
        "container [Hz], equal to its parameter rate",
        (20.0, 1000.0),
    ),
)  # fmt: skip


class GovernedCellNode(cell_node.CellNode):
    """Simulated cell that publishes its motion's velocity as commands of an operator.

    The sensors' samples are those of the motion that the governor makes of it.
    """

    parameters = PARAMETERS
    published = (*PUBLISHED, (topics.DESIRED_TWIST, TwistStamped, qos.STREAM_OUT))
    commands = (topics.DESIRED_TWIST,)
    _followed: GovernedPlay

    def prepare(self, progress: Progress) -> None:
        """Prepares the cell, and refuses a motion that no velocity commands."""
        super().prepare(progress)
        commanded_velocity(self._motion)

    def begin(self) -> None:
        """Listens to the governor, and starts the motion when the other nodes are ready."""
        period = 1.0 / self._given["govern"]
        cup = GovernedCup(self._model, self._given["rate"], period, self._push)
        self._followed = GovernedPlay(self, self._motion, cup, period)
        super().begin()

    def _summary(self) -> dict[str, Any]:
        outcome = self._followed.outcome
        of_cell = {"values": {"governed": outcome.document()}, "rows": outcome.rows()}
        return {**super()._summary(), "results": of_cell}

    def _move(self, start_ns: int) -> None:
        """Publishes the motion as commands, and samples of the motion that the governor allows."""
        every, noise = self._given["imu_every"], self._given["acceleration_noise"]
        random = np.random.default_rng(self._given["seed"])
        still, upright, sent = np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]), 0

        def send(stamp_ns: int, sample: CupSample) -> None:
            nonlocal sent
            stamp, measured = to_time(stamp_ns), noise * random.standard_normal((2, 3))
            felt = sample.acceleration + measured[0]
            self._publish(topics.ACCEL, accel_message(stamp, felt))
            if every and sent % every == 0:
                force = sample.acceleration + [0.0, 0.0, GRAVITY] + measured[1]
                self._publish(topics.IMU, imu_message(stamp, force, still))
                self._publish(topics.POSE, pose_message(stamp, sample.position, upright))
            sent += 1

        try:
            self._followed.run(start_ns, self._publish, send, self._stop)
        except SloshBringupError as error:
            self.failure = str(error)
        self._latest = self._followed.late

    def _heights(self, t: float) -> tuple[float, float]:
        """Returns exact liquid heights [m] at the wall at a time; waits for the motion."""
        while not self._followed.knows(t) and not self._stop.wait(cell_node.TICK):
            pass
        return self._followed.heights(t)

    @property
    def _duration(self) -> float:
        return self._followed.duration


def main() -> int:
    """Runs the simulated cell that is governed."""
    return cell_node.main(GovernedCellNode)


if __name__ == "__main__":
    sys.exit(main())
