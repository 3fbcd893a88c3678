"""Simulated cell node: publishes the messages of a robot and its camera."""

from __future__ import annotations

import json
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from threading import Event
from typing import Any, ClassVar

import cv2
import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_msgs.msg import String

from slosh_base.compiled.compilation import load_telling
from slosh_bringup.cell.motion_source import REPEATS, load_motion
from slosh_bringup.cell.renderer import CupRenderer, GrayImage, GreyLevels
from slosh_bringup.cell.truth import Push, integrate_truth, read_sensors
from slosh_bringup.cell_watch import reports
from slosh_bringup.nodes.cell_messages import (
    CAMERA_FRAME,
    PUBLISHED,
    accel_message,
    camera_info,
    force_message,
    imu_message,
    pose_message,
    truth_message,
)
from slosh_bringup.processes import config_folder
from slosh_bringup.ready_wait import PATIENCE, ReadyWait, sentence
from slosh_camera.calibrate.camera_file import read_calibration
from slosh_model.model_text import read_model
from slosh_msgs_py import images, qos, topics
from slosh_msgs_py.node.diagnostics import OK, WARN, Health
from slosh_msgs_py.node.parameters import ParameterSpec, declare
from slosh_msgs_py.node.prepared import PreparedNode
from slosh_msgs_py.node.readiness import Progress
from slosh_msgs_py.node.rivals import node_of
from slosh_msgs_py.node.run import run_node
from slosh_msgs_py.stamps import to_time

GROUPS: Mapping[str, tuple[str, ...]] = {
    topics.ACCEL: tuple(row.name for row in topics.DRIVING.values() if not row.is_absolute),
    topics.IMAGE: (topics.IMAGE, topics.IMAGE_COMPRESSED),
    topics.ESTIMATE: (topics.ESTIMATE,),
    topics.FREE_SURFACE: (topics.FREE_SURFACE,),
}
"""Topics that must be read before there is a motion, by the name of their kind."""
OF_CAMERA = (topics.IMAGE, topics.FREE_SURFACE)
"""Those that nobody reads where there is no camera."""
SETTLED = 1.0  # s; for so long nobody new has come: a recorder finds its topics one by one
POLL = 0.05


class ReadyCell:
    """Tracks whether the other nodes of a cell are ready and subscribed.

    Args:
        node: of the simulated cell.
        names: of the nodes that must be ready.
        readers: how many nodes must read each of GROUPS.
        patience: after so long without news it is given up [s].
        camera: whether images are published.
        commands: topics that must be read, too.
    """

    def __init__(
        self,
        node: Node,
        names: list[str],
        readers: int,
        patience: float,
        *,
        camera: bool = True,
        commands: Sequence[str] = (),
    ) -> None:
        self._node, self._readers, self._patience = node, readers, patience
        unread = () if camera else OF_CAMERA
        groups = {kind: names for kind, names in GROUPS.items() if kind not in unread}
        self._groups = groups | {name: (name,) for name in commands}
        self._namespace = node.get_namespace()
        self._wait = ReadyWait(names, time.monotonic(), patience)
        self._own = node.get_name()
        self._unread = ""
        node.create_subscription(DiagnosticArray, topics.DIAGNOSTICS, self._take, qos.DIAGNOSTICS)

    @property
    def waits_for(self) -> str:
        """Describes which nodes are not ready, and why."""
        return sentence(self._wait.missing()) or self._unread or "readers"

    def wait(self, stop: Event) -> str:
        """Waits until all nodes are ready and have subscribed to their topics.

        Args:
            stop: ends the waiting.

        Returns:
            why there is no sense in waiting longer; empty: all are ready, or it was stopped.
        """
        while not stop.wait(POLL) and self._wait.missing():
            given_up = self._wait.given_up(time.monotonic())
            if given_up:
                return given_up
        return self._wait_for_readers(stop)

    def _wait_for_readers(self, stop: Event) -> str:
        began = settled = time.monotonic()
        before: Mapping[str, set[str]] = {}
        while not stop.wait(POLL):
            now, there = time.monotonic(), {kind: self._reading(kind) for kind in self._groups}
            if there != before:
                before, settled = there, now
            self._unread = self._lacking(there)
            if not self._unread and now - settled >= (SETTLED if self._readers else 0.0):
                return ""
            if self._unread and now - began > self._patience:
                return self._unread
        return ""

    def _lacking(self, there: Mapping[str, set[str]]) -> str:
        for kind, names in there.items():
            if len(names) < self._readers:
                topic = self._node.resolve_topic_name(kind)
                known = f" ({', '.join(sorted(names))})" if names else ""
                return f"{topic} has {len(names)} of {self._readers} readers{known}"
        return ""

    def _reading(self, kind: str) -> set[str]:
        """Returns the names of the nodes that subscribe to a kind of topics, such as images."""
        return {
            node_of(info)
            for topic in self._groups[kind]
            for info in self._node.get_subscriptions_info_by_topic(
                self._node.resolve_topic_name(topic)
            )
        }

    def _take(self, message: DiagnosticArray) -> None:
        for report in reports(message, self._namespace):
            if report.node != self._own:
                self._wait.take(report, time.monotonic())


TICK = 0.002  # s; samples that fall due within it go out together
JPEG_QUALITY = 90
BEHIND = 1.0  # s; an image that would be sent later than that is left out
LATE = 0.1  # s; a sample that is later than that tells of a machine that is too slow
LINGER = 1.0  # s; the last messages are delivered before the process ends
PARAMETERS = (
    ParameterSpec("motion", "c3", "motion by name, or a motion table (.csv, .csv.gz)"),
    ParameterSpec("model", "", "model file of the simulated liquid; empty: the included one"),
    ParameterSpec(
        "calibration", "", "camera.yaml of the simulated camera; empty: the included one"
    ),
    ParameterSpec("rate", 1000.0, "rate of the topic accel [Hz]", (10.0, 1000.0)),
    ParameterSpec("imu_every", 5, "number of accel samples per imu sample; 0: no imu", (0, 1000)),
    ParameterSpec("fps", 60.0, "rate of the images [Hz]", (1.0, 240.0)),
    ParameterSpec("camera", True, "render and publish images"),
    ParameterSpec("raw", True, "publish camera/image_raw"),
    ParameterSpec("compressed", True, "publish camera/image_raw/compressed"),
    ParameterSpec(
        "acceleration_noise",
        0.02,
        "standard deviation of the acceleration noise [m/s^2]",
        (0.0, 10.0),
    ),
    ParameterSpec(
        "image_noise",
        2.5,
        "standard deviation of the image noise [grey levels of 255]",
        (0.0, 50.0),
    ),
    ParameterSpec(
        "push_at",
        -1.0,
        "time of a simulated push by hand that no robot sensor measures [s]; negative: no push",
        (-1.0, 1e6),
    ),
    ParameterSpec("push", 0.1, "speed that the push gives the liquid along x [m/s]", (-1.0, 1.0)),
    ParameterSpec(
        "camera_stop",
        [0.0, 0.0],
        "start and end of a camera failure without images [s]",
        (0.0, 1e6),
        length=2,
    ),
    ParameterSpec(
        "force_every",
        0,
        "number of accel samples per sample of a force sensor under the "
        "container; 0: no such sensor",
        (0, 1000),
    ),
    ParameterSpec("seed", 1, "seed of all noise", (0, 2**31 - 1)),
    ParameterSpec("repeat", 1, "number of times that the motion is played", REPEATS),
    ParameterSpec(
        "wait_for",
        "",
        "names of nodes that must be ready before the motion starts, separated by commas",
    ),
    ParameterSpec(
        "readers",
        2,
        "number of nodes that must read each topic before the motion starts; 0: start at once",
        (0, 100),
    ),
    ParameterSpec(
        "patience",
        PATIENCE,
        "time without messages from awaited nodes after which this node ends [s]",
        (0.0, 3600.0),
    ),
)


class CellNode(PreparedNode):
    """Node that plays a motion in real time and publishes sensor samples and images.

    Args:
        later: it gets ready by `run_node`.

    Attributes:
        parameters: that it declares.
        published: topic, type and quality of service of what it publishes.
        commands: topics of that which others must read, too.
    """

    parameters: ClassVar[tuple[ParameterSpec, ...]] = PARAMETERS
    published: ClassVar[tuple[tuple[str, Any, QoSProfile], ...]] = PUBLISHED
    commands: ClassVar[tuple[str, ...]] = ()

    def __init__(self, *, later: bool = False) -> None:
        super().__init__("cell")
        self._given = given = declare(self, self.parameters)
        config = config_folder()
        self._model = read_model(given["model"] or config / "truth.yaml")
        self._motion = load_motion(
            given["motion"], given["rate"], self.get_logger().info
        ).repeated(given["repeat"])
        self._readings = read_sensors(self._motion, given["acceleration_noise"], given["seed"])
        self._renderer = None
        if given["camera"]:
            calibration = read_calibration(given["calibration"] or config / "camera.yaml")
            look = GreyLevels(noise=given["image_noise"], seed=given["seed"])
            self._renderer = CupRenderer(calibration.view, look)
            self._info = camera_info(calibration)
        self._push = Push(given["push_at"], given["push"]) if given["push_at"] >= 0.0 else None
        self._pub = {
            topic: self.create_publisher(kind, topic, profile)
            for topic, kind, profile in self.published
        }
        self._counts = dict.fromkeys(self._pub, 0)
        names = [name.strip() for name in given["wait_for"].split(",") if name.strip()]
        self._others = ReadyCell(
            self, names, given["readers"], given["patience"], camera=given["camera"],
            commands=self.commands,
        )  # fmt: skip
        self.failure = ""
        self._latest = 0.0
        self._left_out = 0
        self._playing = False
        self._stop = threading.Event()
        self._finished = threading.Event()
        self._player = threading.Thread(target=self._play, name="player", daemon=True)
        self._watch(self._health, self._facts)
        self._get_ready(later=later)

    def prepare(self, progress: Progress) -> None:
        """Compiles or loads the liquid's equations and integrates the reference liquid."""
        load_telling(progress, "slosh_model.kernel")
        self._truth = integrate_truth(self._model, self._motion, self._push)
        if self._given["force_every"]:
            # It loads the identification's libraries.
            from slosh_bringup.cell.force_sensor import ForceSensor, sensed_force

            seed = self._given["seed"]
            self._force = sensed_force(self._model, self._motion, ForceSensor(), seed, self._push)

    def begin(self) -> None:
        """Starts the motion when the other nodes are ready."""
        self._player.start()

    def close(self) -> None:
        """Stops the publishing threads."""
        self._stop.set()
        if self._player.is_alive():
            self._player.join(timeout=5.0)

    @property
    def finished(self) -> bool:
        """Whether the motion is over and its last messages have been delivered."""
        return self._finished.is_set()

    def _health(self) -> Health:
        what = f"{self._motion.name}, {self._motion.duration:.1f} s"
        if not self._playing:
            return OK, f"waiting to play {what}: {self._others.waits_for}"
        if self._latest > LATE:
            return WARN, (
                f"playing {what}, up to {self._latest:.1f} s late: this machine is too slow"
            )
        return OK, f"playing {what}"

    def _facts(self) -> dict[str, Any]:
        late = f"{1e3 * self._latest:.0f}"
        facts = {"playing": self._playing, "late maximum [ms]": late, **self._counts}
        return {**facts, "images left out": self._left_out}

    def _publish(self, topic: str, message: Any) -> None:
        self._pub[topic].publish(message)
        self._counts[topic] += 1

    def _play(self) -> None:
        """Plays the motion and then ends the node, even if playing fails."""
        try:
            given_up = self._others.wait(self._stop)
            if given_up:
                self.failure = f"nothing is played: {given_up}"
            elif not self._stop.is_set():
                self._perform()
        finally:
            self._finished.set()

    def _perform(self) -> None:
        """Runs the sensor and the image thread until the motion ends; logs the message count."""
        start_ns = int(self.get_clock().now().nanoseconds)
        self._start = time.monotonic()
        self._playing = True
        camera = threading.Thread(target=self._film, args=(start_ns,), name="camera", daemon=True)
        camera.start()
        self._move(start_ns)
        camera.join()
        self._publish(topics.SUMMARY, String(data=json.dumps(self._summary())))
        self._report.report()
        self._stop.wait(LINGER)

    def _summary(self) -> dict[str, Any]:
        prefix = self.get_namespace().rstrip("/")
        published = {f"{prefix}/{topic}": count for topic, count in self._counts.items() if count}
        published[f"{prefix}/{topics.SUMMARY}"] = 1
        return {"motion": self._motion.name, "published": published}

    def _wait_until(self, t: float) -> bool:
        """Sleeps until a time of the motion; returns False if the node should end."""
        remaining = self._start + t - time.monotonic()
        return not (self._stop.wait(remaining) if remaining > 0.0 else self._stop.is_set())

    def _move(self, start_ns: int) -> None:
        """Publishes the sensor samples when they are due, a few at a time."""
        t, readings, due = self._motion.t, self._readings, 0
        stamps = start_ns + np.round(t * 1e9).astype(np.int64)
        every, forces = self._given["imu_every"], self._given["force_every"]
        while due < len(t) and self._wait_until(t[due] + TICK):
            now = time.monotonic() - self._start
            self._latest = max(self._latest, now - t[due] - TICK)
            while due < len(t) and t[due] <= now:
                stamp = to_time(int(stamps[due]))
                self._publish(topics.ACCEL, accel_message(stamp, readings.acceleration[due]))
                if every and due % every == 0:
                    felt, turning = readings.specific_force[due], readings.angular_velocity[due]
                    self._publish(topics.IMU, imu_message(stamp, felt, turning))
                    place, towards = readings.position[due], readings.attitude[due]
                    self._publish(topics.POSE, pose_message(stamp, place, towards))
                if forces and due % forces == 0:
                    self._publish(topics.FORCE, force_message(stamp, self._force[due]))
                due += 1

    def _heights(self, t: float) -> tuple[float, float]:
        """Returns exact liquid heights [m] at the wall at a time since the start [s]."""
        return self._truth.at(t)

    @property
    def _duration(self) -> float:
        return self._motion.duration

    def _film(self, start_ns: int) -> None:
        """Renders and publishes camera images and exact heights at the camera's rate.

        A late image is drawn all the same, up to BEHIND: a slow machine's demo has all of them. A
        camera that is always too fast for the machine would fall behind for ever: it leaves out
        what is later, as a driver does.
        """
        given = self._given
        frame = 0
        while (t := frame / given["fps"]) <= self._duration and self._wait_until(t):
            due = int((time.monotonic() - self._start) * given["fps"])
            if due - frame > BEHIND * given["fps"]:
                self._left_out += due - frame
                frame = due
                continue
            sh_x, sh_y = self._heights(t)
            stamp_ns = start_ns + round(t * 1e9)
            first, last = given["camera_stop"]
            if self._renderer is not None and not first <= t < last:
                self._publish_image(self._renderer.render(sh_x, sh_y), stamp_ns)
            self._publish(topics.TRUTH, truth_message(stamp_ns, sh_x, sh_y))
            frame += 1

    def _publish_image(self, pixels: GrayImage, stamp_ns: int) -> None:
        if self._given["raw"]:
            message = images.image_message(pixels, "mono8", stamp_ns, CAMERA_FRAME)
            self._publish(topics.IMAGE, message)
        if self._given["compressed"]:
            data = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])[1]
            jpeg = images.compressed_message(data.tobytes(), "jpeg", stamp_ns, CAMERA_FRAME)
            self._publish(topics.IMAGE_COMPRESSED, jpeg)
        self._info.header.stamp = to_time(stamp_ns)
        self._publish(topics.CAMERA_INFO, self._info)


def main(kind: type[CellNode] = CellNode) -> int:
    """Runs the simulated cell node, or another kind of it."""
    cv2.setNumThreads(1)  # small images; the other core belongs to the nodes
    return run_node(lambda: kind(later=True), finished=lambda node: node.finished)


if __name__ == "__main__":
    sys.exit(main())
