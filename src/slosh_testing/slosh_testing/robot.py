"""A simulated robot and camera for tests with real nodes in their own processes."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import AccelStamped, PoseStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CompressedImage, Image, Imu

from slosh_bringup.processes import NodeGroup, NodeProcess, config_folder, node_environment
from slosh_msgs.msg import FreeSurface, SloshComparison, SloshEstimate
from slosh_msgs_py import qos, topics
from slosh_msgs_py.node.readiness import RECORDED
from slosh_msgs_py.stamps import to_time

PATIENCE = 40.0
SAMPLE, IMAGE = 0.005, 0.02  # s; how often the robot and the camera speak
GRAVITY = 9.81
MODEL = """
container: {shape: cylinder, radius: 0.05, fill_height: 0.07}
damping_ratio: 0.2
effects: [{name: vertical_acceleration}]
"""
"""So viscous that a state which is not known is forgotten within a second."""


class RobotNode:
    """ROS node of a test that sends inputs and receives the messages of the nodes.

    Attributes:
        node: by which it does so.
        estimates, comparisons: what has come.
        health: level and sentence of each node's last report.
        recorded: nodes whose settings the recorder has; without them its bag cannot be replayed.
        push: acceleration at a moment [s] along x [m/s²].
        surface: what the camera says; None: it says nothing.
        picture: what the camera shows, where a camera node looks at it.
        shift: by how much the clock of the input is ahead [s].
        camera_shift: by how much the camera's clock is ahead [s].
        time_ns: the time [ns], of which it tells by `/clock` when it is not the system's.
        gravity: what the inertial sensor reads of gravity [m/s²].
        frame: of accelerations and poses.
        lift: acceleration along z [m/s²].
        attitude: of the poses, x, y, z, w.
    """

    def __init__(self, name: str, kind: str, namespace: str = "/slosh") -> None:
        self.node = Node(name, namespace=namespace)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self.kind = kind
        self.push: Callable[[float], float] = lambda t: 0.0
        self.surface: FreeSurface | None = FreeSurface(msh=0.0001, msh_stddev=0.0001)
        self.shift, self.camera_shift, self.gravity = 0.0, 0.0, GRAVITY
        self.time_ns: Callable[[], int] = time.time_ns
        self.frame = "world"
        self.lift = 0.0
        self.attitude = (0.0, 0.0, 0.0, 1.0)
        self.estimates: list[SloshEstimate] = []
        self.comparisons: list[SloshComparison] = []
        self.health: dict[str, tuple[int, str]] = {}
        self.recorded: set[str] = set()
        types = {topics.ACCEL: AccelStamped, topics.IMU: Imu, topics.POSE: PoseStamped}
        self.inputs = {
            topic: self.node.create_publisher(kind, topic, qos.STREAM_OUT)
            for topic, kind in types.items()
        }
        self.picture: Image | CompressedImage | None = None
        self._clock: Any = None
        self._tells_time = False
        self._surfaces: Any = None
        self._pictures: Any = None
        self._due = dict.fromkeys(("sample", "image"), time.monotonic())

    def listen(self) -> None:
        """Subscribes to the topics of the nodes under test."""
        hear = self.node.create_subscription
        hear(SloshEstimate, topics.ESTIMATE, self.estimates.append, qos.STREAM_IN)
        hear(SloshComparison, topics.COMPARISON, self.comparisons.append, qos.STREAM_IN)
        hear(DiagnosticArray, topics.DIAGNOSTICS, self._take, qos.DIAGNOSTICS)

    def sees(self) -> None:
        """Creates a publisher of FreeSurface messages, in place of the camera node."""
        self._surfaces = self.node.create_publisher(
            FreeSurface, topics.FREE_SURFACE, qos.STREAM_OUT
        )

    def shows(self, picture: Image | CompressedImage) -> None:
        """Creates a publisher of camera images for the camera node under test."""
        self.picture, kind = picture, type(picture)
        topic = topics.IMAGE if kind is Image else topics.IMAGE_COMPRESSED
        self._pictures = self.node.create_publisher(kind, topic, qos.STREAM_OUT)

    def simulates(self, time_ns: Callable[[], int] | None) -> None:
        """Starts publishing simulated time from a function [ns], or stops it for None."""
        self._clock = self._clock or self.node.create_publisher(Clock, "/clock", 10)
        self._tells_time, self.time_ns = time_ns is not None, time_ns or self.time_ns

    def sample(self, ahead: float = 0.0, ax: float | None = None) -> None:
        """Publishes one input sample of the robot's acceleration.

        Args:
            ahead: of the clock [s].
            ax: acceleration [m/s²]; None: as `push` has it.
        """
        now = self.time_ns() * 1e-9
        push = self.push(now) if ax is None else ax
        message: Any
        if self.kind == topics.ACCEL:
            message = AccelStamped()
            message.header.frame_id = self.frame
            message.accel.linear.x, message.accel.linear.z = push, self.lift
        elif self.kind == topics.IMU:
            message = Imu()
            message.linear_acceleration.x = push
            message.linear_acceleration.z = self.gravity
        else:
            message = PoseStamped()
            message.header.frame_id = self.frame
            q = message.pose.orientation
            q.x, q.y, q.z, q.w = self.attitude
        message.header.stamp = to_time(self.time_ns() + round((ahead + self.shift) * 1e9))
        self.inputs[self.kind].publish(message)

    def until(self, condition: Callable[[], object], what: str, *, speak: bool = True) -> None:
        """Publishes sensor data until a condition is met; fails after a timeout."""
        deadline = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < deadline, f"waited in vain for {what}: {self.health}"
            if speak:
                self._speak()
            self._executor.spin_once(timeout_sec=0.001)

    def for_seconds(self, seconds: float) -> None:
        """Publishes sensor data for a number of seconds."""
        end = time.monotonic() + seconds
        self.until(lambda: time.monotonic() >= end, "the time")

    def call(self, service: Any, name: str, **fields: Any) -> Any:
        """Calls a service and returns its response; publishes data meanwhile."""
        client = self.node.create_client(service, name)
        self.until(client.service_is_ready, name)
        answer = client.call_async(service.Request(**fields))
        self.until(answer.done, f"an answer of {name}")
        self.node.destroy_client(client)
        return answer.result()

    def new_estimate(self) -> SloshEstimate:
        """Waits for the next estimate and returns it."""
        count = len(self.estimates)
        self.until(lambda: len(self.estimates) > count, "an estimate")
        return self.estimates[-1]

    def close(self) -> None:
        """Shuts down the executor and the node."""
        self._executor.shutdown()
        self.node.destroy_node()

    def _take(self, message: DiagnosticArray) -> None:
        for status in message.status:
            namespace, _, name = status.name.rpartition("/")
            if namespace == self.node.get_namespace():
                self.health[name] = (ord(status.level), status.message)
                told = [pair.value for pair in status.values if pair.key == RECORDED]
                self.recorded |= {node for text in told for node in text.split(", ")}

    def _speak(self) -> None:
        now = time.monotonic()
        if now >= self._due["sample"]:
            self._due["sample"] = max(self._due["sample"] + SAMPLE, now - 0.04)
            if self._tells_time:
                self._clock.publish(Clock(clock=to_time(self.time_ns())))
            self.sample()
        if now < self._due["image"]:
            return
        self._due["image"] = max(self._due["image"] + IMAGE, now - 0.04)
        stamp = self.time_ns() + round(self.camera_shift * 1e9)
        for publisher, message in ((self._surfaces, self.surface), (self._pictures, self.picture)):
            if publisher and message:
                message.header.stamp = to_time(stamp)
                publisher.publish(message)


def swing(amplitude: float) -> Callable[[float], float]:
    """Returns an acceleration [m/s²] near the liquid's natural frequency, by time [s]."""
    return lambda t: amplitude * math.sin(15.0 * t)


@contextmanager
def nodes_and_robot(
    folder: Path,
    domain: int,
    parameters: Mapping[str, Mapping[str, str]] | None = None,
    kind: str = topics.ACCEL,
    picture: Image | CompressedImage | None = None,
    namespace: str = "/slosh",
    attitude: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0),
) -> Iterator[tuple[NodeGroup, RobotNode]]:
    """Runs estimator, monitor, perhaps a camera node, and a simulated robot.

    Args:
        folder: the nodes' logs go there.
        domain: of DDS.
        parameters: of the nodes, by name.
        kind: of the input.
        picture: that the camera node looks at; None: the robot speaks in its place.
        namespace: of all of them.
        attitude: of the poses, from the first one on.
    """
    given = ["estimator", "monitor", *(["camera"] if picture else [])]
    own = {
        "estimator": {"model": str(folder / "model.yaml"), "input": kind},
        "camera": {"calibration": str(config_folder() / "camera.yaml")},
    }
    (folder / "model.yaml").write_text(MODEL)
    with ExitStack() as stack:
        if not rclpy.ok():
            rclpy.init()
            stack.callback(rclpy.shutdown)
        environment = node_environment(domain)
        group = stack.enter_context(NodeGroup(namespace, folder / "logs", environment))
        robot = RobotNode("robot", kind, namespace)
        robot.attitude = attitude
        stack.callback(robot.close)
        robot.listen()
        if picture:
            robot.shows(picture)
        else:
            robot.sees()
        for name in given:
            values = {**own.get(name, {}), **(parameters or {}).get(name, {})}
            group.start(NodeProcess(name, (), values))
        robot.until(lambda: robot.health.keys() >= set(given), "all nodes")
        robot.until(lambda: len(robot.comparisons) > 20 and robot.estimates, "comparisons")
        yield group, robot
        assert group.failed() is None
