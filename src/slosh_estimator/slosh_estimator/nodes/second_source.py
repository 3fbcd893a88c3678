"""Compares a second source of the container's motion with the estimator's input."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from std_msgs.msg import String

from slosh_estimator.nodes.input_subscription import InputSubscription
from slosh_motion.errors import SloshMotionError
from slosh_motion.inputs.frames import SensorTransform, Vector
from slosh_motion.inputs.inputs import (
    ACCEL,
    IMU,
    JOINTS,
    ODOMETRY,
    POSE,
    TOPIC_NAMES,
    TRANSFORMS,
    InputSettings,
)
from slosh_motion.inputs.robot import HOW_TO_GET, available
from slosh_motion.inputs.sampling import Sample
from slosh_motion.mounting.verdict import MountingVerdict
from slosh_motion.mounting.watch import MountingWatch
from slosh_msgs_py import qos, topics
from slosh_msgs_py.node.guarded import GuardedNode

AUTO, NONE = "auto", "none"
SENSORS = (IMU, ACCEL)
MOTIONS = (POSE, JOINTS, ODOMETRY, TRANSFORMS)
"""In this order they are preferred."""
PATIENCE = 3
"""So many looks the robot's description is waited for, where there are joint states."""
CHOICES = (AUTO, NONE, *SENSORS, *MOTIONS)


class SecondSource:
    """Receives a second source of the motion, if there is one, and compares it with the input.

    Args:
        node: the node.
        kind: of the input.
        wanted: one of CHOICES.
        how: how the input is read, as of now.
        urdf: text of the robot's description; empty: it is heard where it is published.
        now: the time [ns].
    """

    def __init__(
        self,
        node: GuardedNode,
        kind: str,
        wanted: str,
        how: Callable[[], InputSettings],
        urdf: str,
        now: Callable[[], int],
    ) -> None:
        self._node, self._kind, self._how, self._now = node, kind, how, now
        self._senses = kind in SENSORS
        """Whether the input is the sensor of the two."""
        others = MOTIONS if self._senses else SENSORS
        self._candidates = [one for one in others if wanted in (AUTO, one)]
        self._urdf, self._asked, self._waited = urdf, False, 0
        self._other = ""
        self._subscription: InputSubscription | None = None
        self._other_how = InputSettings()
        self._watch: MountingWatch | None = None
        self._refusals: dict[str, str] = {}
        self._accused = False

    def told(self, stamp_ns: int, frame: str, force: Vector, rate: Vector | None) -> None:
        """Adds a sensor's specific force and angular velocity to the check of its mounting."""
        if self._subscription is None:
            return
        if self._watch is None:
            sensor = self._kind if self._senses else self._other
            how = self._how() if self._senses else self._other_how
            expected, in_world = how.expected(sensor, frame)
            self._watch = MountingWatch(expected, in_world=in_world)
        self._watch.take_sensor(stamp_ns, force, rate)

    def follow(self, input_ns: int, *samples: Sample | None) -> None:
        """Adds samples of the estimator's input to the check of the sensor's mounting."""
        if not self._senses:
            self._moved(input_ns, *samples)

    def _moved(self, _: int, *samples: Sample | None) -> None:
        """Adds samples of the container's motion to the check of the sensor's mounting."""
        if self._watch is None:
            return
        for one in samples:
            if one is not None:
                self._watch.take_motion(one.stamp_ns, (one.ax, one.ay, one.az), one.pose)

    def look(self) -> tuple[str, str]:
        """Returns the faults of the input and of the second source, if there are any."""
        if self._subscription is None:
            self._choose()
            return "", ""
        if self._watch is not None:
            self._watch.look()
        verdict, doubt = self._verdict, self._subscription.source.doubt
        contradicted = verdict is not None and bool(verdict.wrong)
        doubtful = self._senses and doubt is not None and doubt.wrong
        # A contradiction that was found before the doubt stays one.
        self._accused = contradicted and (self._accused or not doubtful)
        if doubtful and doubt is not None and not self._accused:
            return "", f"{self._other}, the second source: {doubt.text}"
        if verdict is None or not contradicted:
            return "", ""
        sensor, motion = self._names
        told = f"{sensor} against {motion}: {'; '.join(verdict.wrong)}"
        return (told, "") if self._senses else ("", told)

    def facts(self) -> dict[str, str]:
        """Returns how the second source compares with the input, for the diagnostics."""
        told = {f"second source {kind}": why for kind, why in self._refusals.items()}
        if self._subscription is None:
            return told
        sensor, motion = self._names
        verdict, watch = self._verdict, self._watch
        if verdict is None or watch is None:
            return told | {"second source": f"{sensor} against {motion}: no common motion yet"}
        state = "wrong" if verdict.wrong else "right"
        told["second source"] = f"{sensor} against {motion}: {state}, motions: {watch.motions}"
        seen = "; ".join((*verdict.remarks, *(f"not seen: {text}" for text in verdict.unseen)))
        return told | ({"second source, remarks": seen} if seen else {})

    @property
    def _names(self) -> tuple[str, str]:
        """Returns the input types of the motion sensor and of the other source of motion."""
        pair = self._kind, self._other
        return pair if self._senses else (pair[1], pair[0])

    @property
    def _verdict(self) -> MountingVerdict | None:
        return None if self._watch is None else self._watch.verdict

    def _choose(self) -> None:
        """Subscribes to the first candidate source that has a publisher."""
        for kind in self._candidates:
            if not self._node.count_publishers(TOPIC_NAMES[kind]):
                continue
            if kind == JOINTS and not self._has_robot():
                if available() and self._waited < PATIENCE:
                    self._waited += 1
                    return
                continue
            how = self._how()._replace(
                kind=kind, transform=SensorTransform(), pose_window=0.0, smoothing=0.0,
                base=None, chained=False, any_world=True, urdf=self._urdf,
            )  # fmt: skip
            try:
                self._subscription = InputSubscription(
                    self._node, kind, how, self._now,
                    self._moved if self._senses else _nothing, self._mounted,
                    None if self._senses else self.told,
                )  # fmt: skip
            except SloshMotionError as error:
                self._refusals[kind] = str(error)
                self._candidates.remove(kind)
                return
            self._other, self._other_how = kind, how
            return

    def _has_robot(self) -> bool:
        """Returns whether the robot's description is known; requests it if not."""
        if not available():
            self._refusals[JOINTS] = HOW_TO_GET
        elif not self._urdf and not self._asked:
            self._asked = True

            def described(message: String) -> None:
                self._urdf = self._urdf or message.data

            self._node.create_subscription(String, topics.ROBOT_DESCRIPTION, described, qos.EVENT)
        return bool(self._urdf) and available()

    def _mounted(self, parameters: Mapping[str, Any]) -> InputSettings:
        """Applies the mounting of the second source that fixed transforms give."""
        self._other_how = self._other_how.with_mounting(parameters)
        return self._other_how


def _nothing(_: int, *samples: Sample | None) -> None:
    """Ignores samples; used for sensors, whose raw readings are compared instead."""
