"""Receives the estimator's input over ROS and converts messages to samples."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Final

from slosh_base.files.nanoseconds import SECOND
from slosh_estimator.errors import SloshEstimatorError
from slosh_estimator.nodes.estimator_messages import imu_vectors
from slosh_motion.checks.constant_meaning import Doubt
from slosh_motion.errors import SloshMotionError
from slosh_motion.inputs.frames import FixedFrames, SensorTransform, TimedPose, Transform, Vector
from slosh_motion.inputs.gate import SampleVerdict
from slosh_motion.inputs.inputs import (
    APART,
    CHAINED_SINCE,
    MESSAGE_TYPES,
    MOUNTED,
    SINCE,
    TOPIC_NAMES,
    AnyInput,
    InputSettings,
)
from slosh_motion.inputs.joint_poses import JointPoses
from slosh_motion.inputs.pose_input import PoseInput
from slosh_motion.inputs.sampling import Sample
from slosh_motion.inputs.sensor_inputs import AccelInput, ImuInput
from slosh_motion.inputs.transform_poses import (
    POSED,
    PlacedAccel,
    PlacedAcceleration,
    TransformPoses,
)
from slosh_motion.inputs.velocity_input import OdometryPoses, Twist, VelocityInput
from slosh_msgs_py import qos, topics
from slosh_msgs_py.conversions import find_type
from slosh_msgs_py.node.guarded import GuardedNode
from slosh_msgs_py.node.rivals import Rivals
from slosh_msgs_py.node.speakers import SpeakerWatch, WithInfo
from slosh_msgs_py.stamped_numbers import StampedReader
from slosh_msgs_py.stamps import to_nanoseconds
from slosh_msgs_py.topics import Publishers

MIXED = 10
"""One publisher stamps no such share of its messages, one in so many, before the one ahead."""
PATIENCE = 2 * SECOND
"""So long fixed transforms are waited for, where somebody publishes them [ns]."""
TF_TYPE = topics.DRIVING["tf"].type
NUMBERS: Final = {"accel": 6, "imu": 37, "pose": 7, "twist": 6}
"""Inputs whose messages are received raw, with their count of numbers behind the header."""
Answer = Callable[..., None]
"""Takes the stamp of an input [ns] and the samples that it made known."""
Told = Callable[[int, str, Vector, Vector | None], None]
"""Takes a stamp [ns], a frame, an acceleration and an angular velocity, as a sensor says."""


class InputSubscription:
    """Subscribes to the topic of an input and converts its messages to samples.

    Args:
        node: the node.
        kind: of the input.
        settings: how it is read.
        now: the time [ns].
        answer: is called with each message's stamp and samples.
        mounted: is told the parameters that fixed transforms give, before the first sample.
        before: is told the stamp of each input before it is read [ns].
        told: is told what an imu or accel message says, before anything judges it.

    Attributes:
        source: what turns messages into samples.
        poses: what turns them into poses before; None: nothing needs to.
        rivalled: whether `rivals` found other publishers.
        contested: whether several publishers send on a topic that allows only one.
        count: messages so far, of use or not.

    Raises:
        SloshEstimatorError: the robot's description does not fit, or the messages' type is not
            installed.
    """

    def __init__(
        self,
        node: GuardedNode,
        kind: str,
        settings: InputSettings,
        now: Callable[[], int],
        answer: Answer,
        mounted: Callable[[Mapping[str, Any]], InputSettings],
        told: Told | None = None,
        before: Callable[[int], None] = lambda stamp_ns: None,
    ) -> None:
        self._node, self._kind, self._now, self._answer = node, kind, now, answer
        self._told = told
        self._settings, self._mounted, self._before = settings, mounted, before
        self._fixed, self._first = FixedFrames(), 0
        self._decided, self._unconnected = kind not in MOUNTED, ""
        self._world = settings.frames[0]
        self.source: AnyInput = settings.reader(kind)
        self.poses = settings.poses(kind)
        row = topics.DRIVING[kind]
        self.rivalled, self.count, self.contested = False, 0, False
        self._seen_twice = False
        self._is_shared = row.publishers is Publishers.MANY
        self._speakers = SpeakerWatch()
        self._rivals = Rivals(node, row.name, row.type)
        self._numbers = StampedReader(NUMBERS.get(kind, 0))
        takers: dict[str, Callable[[Any], None]] = {
            "accel": self._on_accel, "imu": self._on_imu, "pose": self._on_pose,
            "joints": self._on_joints, "tf": partial(self._on_transforms, fixed=False),
            "odometry": self._on_odometry, "twist": self._on_twist,
        }  # fmt: skip
        self._listen(row.name, takers[kind])
        if not self._decided:
            self._hear_fixed()
        if isinstance(self.poses, TransformPoses):
            kind_of = message_class(row.type)
            fixed = partial(self._on_transforms, fixed=True)
            node.create_subscription(kind_of, topics.TF_STATIC, fixed, qos.EVENT)

    def _hear_fixed(self) -> None:
        """Subscribes to fixed transforms, if their message package is installed."""
        try:
            kind = message_class(TF_TYPE)
        except SloshMotionError:
            self._decided = True
            return
        self._node.create_subscription(kind, topics.TF_STATIC, self._on_fixed, qos.EVENT)

    def _on_fixed(self, message: Any) -> None:
        links = [Transform.of_message(one) for one in message.transforms]
        self._fixed.take(links)
        if isinstance(self.poses, TransformPoses):
            self.poses.take(links, fixed=True)
        elif isinstance(self.poses, PlacedAccel):
            self._on_placed(self.poses.take_transforms(links, fixed=True))

    def _hear_moving(self) -> None:
        """Subscribes to moving transforms of the input's frame."""
        take: Callable[[Any], None] | None = None
        if isinstance(self.poses, TransformPoses):
            self.poses.take(self._fixed.links, fixed=True)
            take = partial(self._on_transforms, fixed=False)
        elif isinstance(self.poses, PlacedAccel):
            self.poses.take_transforms(self._fixed.links, fixed=True)
            take = self._on_placing
        if take is not None:
            self._node.create_subscription(message_class(TF_TYPE), topics.TF, take, qos.STREAM_IN)

    def _is_mounted(self, frame: str) -> bool:
        """Returns whether a frame's mounting is known; waits some time for transforms."""
        if self._decided:
            return True
        found = self._settings.mounted(self._kind, frame, self._fixed)
        now = self._node.steady_ns()
        self._first = self._first or now
        moving = self._node.count_publishers(topics.TF) > 0
        speaks = self._node.count_publishers(topics.TF_STATIC) > 0
        patient = now - self._first < PATIENCE
        apart = found is not None and APART in found
        if patient and ((found is None and speaks) or (apart and not moving)):
            return False
        self._decided = True
        if found is None or apart:
            found = self._settings.mounted(self._kind, frame, self._fixed, moving=moving)
        if found:
            how = self._mounted(found)
            if how.placed and how.transform == SensorTransform():
                self._told = None  # it moves on the container: what it feels is not compared
            self.source, self.poses = how.reader(self._kind), how.poses(self._kind)
            self._hear_moving()
        elif found is None and speaks:
            self._unconnected = frame
        return True

    def rivals(self) -> str:
        """Returns the names of extra publishers in one line; empty if there are none."""
        found = self._too_many() if self._is_shared else self._rivals.look()
        self.rivalled = bool(found)
        if self.contested and not found and not self._is_shared:
            name = self._node.resolve_topic_name(TOPIC_NAMES[self._kind])
            return f"a second publisher on {name}: stop one of them"
        return found

    def _too_many(self) -> str:
        """Names a second publisher of the same joints in one line; empty if there is none.

        What a motion has shown of it counts through rests, until there is none any more.
        """
        if not isinstance(self.poses, JointPoses):
            return ""
        name = self._node.resolve_topic_name(TOPIC_NAMES[self._kind])
        count, gate = self._node.count_publishers(name), self.source.gate
        mixed = gate.counts[SampleVerdict.DISORDERED] + gate.counts[SampleVerdict.REPEATED]
        if count <= self.poses.groups:
            self._seen_twice = False
            return ""
        self._seen_twice |= self.source.contested or MIXED * mixed > gate.used
        if not self._seen_twice:
            return ""
        return f"{count} publishers on {name} for {self.poses.groups} set of joints: stop one"

    def trouble(self) -> str:
        """Returns in one line why messages give no pose; empty if they do."""
        return self.poses.trouble() if self.poses is not None else ""

    def clock_doubt(self) -> Doubt | None:
        """Returns what the arrival of messages shows of their publishers' clocks."""
        return self.poses.clock_doubt() if self.poses is not None else None

    def facts(self) -> dict[str, str]:
        """Returns texts on the state of the input by name, for the diagnostics."""
        told = {} if self.poses is None else self.poses.facts()
        if self._unconnected:
            told["mounting"] = f"by parameters: no fixed transform connects {self._unconnected!r}"
        return told

    def _listen(self, topic: str, callback: Callable[[Any], None]) -> None:
        kind = message_class(MESSAGE_TYPES[self._kind])

        def shared(message: Any) -> None:
            self.count += 1
            callback(message)

        def heard(message: Any, info: Mapping[str, Any]) -> None:
            self.count += 1
            number = info.get("publication_sequence_number")
            arrival, matched = info["received_timestamp"], subscription.get_publisher_count()
            at_ns = arrival or self._node.now_ns()
            self.contested = bool(
                self._node.noted("contested", lambda: self._speakers.take(number, at_ns, matched))
            )
            callback(message)

        # Several publishers may speak of different joints or transforms.
        take = shared if self._is_shared else WithInfo(heard)
        subscription = self._node.create_subscription(
            kind, topic, take, qos.STREAM_IN, raw=self._kind in NUMBERS
        )

    def _on_accel(self, data: bytes) -> None:
        stamp, frame, (ax, ay, az, *_) = self._numbers.read(data)
        if not self._is_mounted(frame):
            return
        assert isinstance(self.source, AccelInput)
        if self.poses is None:
            self._before(stamp)
        if self._told is not None:
            self._told(stamp, frame, (ax, ay, az), None)
        if isinstance(self.poses, PlacedAccel) and frame == self.poses.frame:
            self._on_placed(self.poses.take(stamp, (ax, ay, az), self._now()))
            return
        self._answer(stamp, self.source.update(stamp, frame, ax, ay, az, self._now()))

    def _on_placing(self, message: Any) -> None:
        assert isinstance(self.poses, PlacedAccel)
        is_first = not self.poses.since_ns
        found = self.poses.hear(message, self._now())
        if is_first and self.poses.since_ns:  # what a replay must know
            self._mounted({SINCE: self.poses.since_ns})
        self._on_placed(found)

    def _on_placed(self, found: list[PlacedAcceleration]) -> None:
        """Converts accelerations at the container's origin, found by transforms, to samples."""
        assert isinstance(self.source, AccelInput)
        for stamp, vector, pose in found:
            self._before(stamp)
            sample = self.source.update(stamp, self._world, *vector, self._now(), pose)
            self._answer(stamp, sample)

    def _on_imu(self, data: bytes) -> None:
        stamp, frame, values = self._numbers.read(data)
        if not self._is_mounted(frame):
            return
        assert isinstance(self.source, ImuInput)
        force, rate = imu_vectors(values)
        self._before(stamp)
        if self._told is not None:
            self._told(stamp, frame, force, rate)
        self._answer(stamp, self.source.update(stamp, force, rate, self._now()))

    def _on_pose(self, data: bytes) -> None:
        stamp, frame, (x, y, z, *turn) = self._numbers.read(data)
        if not self._is_mounted(frame):
            return
        qx, qy, qz, qw = turn
        place, quaternion = (x, y, z), (qx, qy, qz, qw)
        if isinstance(self.poses, TransformPoses):
            self._on_chained(self.poses, [Transform(frame, POSED, stamp, place, quaternion)])
        else:
            self._on_poses([TimedPose(stamp, place, quaternion)], frame)

    def _on_chained(self, poses: TransformPoses, links: list[Transform]) -> None:
        """Computes container poses from a chain of transforms, and processes these poses."""
        before = poses.since_ns
        found = poses.take(links, at_ns=self._now())
        if poses.since_ns and poses.since_ns != before:  # what a replay must know
            self._mounted({CHAINED_SINCE: poses.since_ns})
        self._on_poses(found, self._world)

    def _on_odometry(self, message: Any) -> None:
        q, twist = message.pose.pose.orientation, message.twist.twist
        p = message.pose.pose.position
        v, w = twist.linear, twist.angular
        stamp = to_nanoseconds(message.header.stamp)
        linear, angular, turn = (v.x, v.y, v.z), (w.x, w.y, w.z), (q.x, q.y, q.z, q.w)
        self._on_velocity(Twist(stamp, linear, angular, turn, "", (p.x, p.y, p.z)))

    def _on_twist(self, data: bytes) -> None:
        stamp, frame, (vx, vy, vz, wx, wy, wz) = self._numbers.read(data)
        self._on_velocity(Twist(stamp, (vx, vy, vz), (wx, wy, wz), None, frame))

    def _on_velocity(self, twist: Twist) -> None:
        assert isinstance(self.source, VelocityInput | OdometryPoses)
        self._before(twist.stamp_ns)
        self._answer(twist.stamp_ns, *self.source.update_twist(twist, self._now()))

    def _on_joints(self, message: Any) -> None:
        assert isinstance(self.poses, JointPoses)
        self._on_poses(self.poses.hear(message, self._now()), self._world)

    def _on_transforms(self, message: Any, *, fixed: bool) -> None:
        assert isinstance(self.poses, TransformPoses)
        if fixed:
            self._on_poses(self.poses.hear(message, None, fixed=True), self._world)
        else:
            self._on_chained(self.poses, [Transform.of_message(one) for one in message.transforms])

    def _on_poses(self, poses: list[TimedPose], frame: str) -> None:
        assert isinstance(self.source, PoseInput)
        for stamp, position, quaternion in poses:
            self._before(stamp)
            found: list[Sample] = self.source.update(
                stamp, position, quaternion, self._now(), frame
            )
            self._answer(stamp, *found)


def message_class(name: str) -> Any:
    """Returns the class of a ROS message type.

    Raises:
        SloshEstimatorError: it is not installed.
    """
    try:
        return find_type(name)
    except (ImportError, AttributeError):
        package = name.partition("/")[0]
        raise SloshEstimatorError(
            f"messages of {name} are not installed here; install the ROS package {package} "
            f"(apt install ros-jazzy-{package.replace('_', '-')})"
        ) from None
