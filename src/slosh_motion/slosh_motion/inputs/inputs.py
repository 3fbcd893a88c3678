"""Settings of the estimator's input, and the readers for each type of input message."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from slosh_model.model import TILT, Model
from slosh_motion.inputs.frames import Base, FixedFrames, SensorTransform
from slosh_motion.inputs.gate import GateSettings
from slosh_motion.inputs.joint_poses import JointPoses
from slosh_motion.inputs.pose_input import PoseInput
from slosh_motion.inputs.robot import Robot
from slosh_motion.inputs.sampling import Modes
from slosh_motion.inputs.sensor_inputs import AccelInput, ImuInput
from slosh_motion.inputs.transform_poses import POSED, PlacedAccel, TransformPoses
from slosh_motion.inputs.velocity_input import OdometryPoses, VelocityInput
from slosh_motion.mounting.verdict import Expected
from slosh_msgs_py.topics import DRIVING

ACCEL, IMU, POSE = "accel", "imu", "pose"
JOINTS, ODOMETRY, TWIST, TRANSFORMS = "joints", "odometry", "twist", "tf"
MESSAGE_TYPES: Mapping[str, str] = {kind: row.type for kind, row in DRIVING.items()}
"""Kinds of input and the type of their messages; the first that is there is taken."""
TOPIC_NAMES: Mapping[str, str] = {kind: row.name for kind, row in DRIVING.items()}
"""Kinds of input and the topic that they come on."""
POSES = (POSE, JOINTS, TRANSFORMS)
"""Kinds whose messages become poses."""
ROBOT = "urdf"
"""Under this name the text of the robot's description is kept with the settings."""
CHAINED = "pose_chained"
"""Under this name the settings say that the frame of poses moves in the world."""
PLACED = "accel_placed"
"""Under this name the settings hold the frame of accelerations that transforms place, moving."""
SINCE = "accel_placed_since"
"""Under this name the settings hold the stamp of the first moving transform used for that [ns]."""
CHAINED_SINCE = "pose_chained_since"
"""The same of poses in a frame that moves."""
APART = "accel_apart"
"""Under this name the settings say that nothing tells how the frame of accelerations turns."""
LEAST_ARM = 1e-3
"""A lever arm up to this length is none [m]."""
BASE = "pose_base"
"""Under this name the settings hold the frame of poses, and where it stands in the world."""
POSE_WINDOW = 0.0
"""A window that is chosen."""

MOUNTED = (ACCEL, IMU, POSE)
"""Kinds whose frame may be anywhere on the robot."""
BY_TWIST, BY_POSE = "twist", "pose"
"""What is read of Odometry messages."""
VELOCITIES = (ODOMETRY, TWIST)
"""Kinds whose messages tell velocities."""
WINDOWED = (*POSES, *VELOCITIES)
"""Kinds that are differentiated in a sliding window: their estimates come later than they do."""
ADDED = f"the effect {TILT} is added to the model: the poses contain the container's tilt"
NOUNS = {
    POSE: "poses", JOINTS: "joint states", TRANSFORMS: "transforms", ODOMETRY: "odometry messages",
    TWIST: "velocities", ACCEL: "accelerations", IMU: "imu messages",
}  # fmt: skip
"""Kinds of input and what comes, in the plural."""
AnyInput = AccelInput | ImuInput | PoseInput
PoseSource = JointPoses | TransformPoses | PlacedAccel


class InputSettings(NamedTuple):
    """Settings of the estimator's input: message type, frames, mounting and limits.

    Attributes:
        kind: one of MESSAGE_TYPES; None: the first of them that is there.
        gate: limits of the gate.
        transform: container ← sensor, or the frame whose pose is published.
        pose_window: length of the differentiating window [s]; 0.0: chosen. A whole number counts
            poses, as nodes of old recorded it; they did not judge the rate of an input either.
        frames: frames of accelerations that are taken: along the world's axes, along the
            container's. The first is that of poses, too.
        modes: of the model, which the input must carry; none: not known.
        checks: whether doubts about the input are told and flagged; None: as in recordings from
            before there were checks: frames and mountings of accelerations and poses, and the
            doubts, are as they were then.
        any_world: whether poses in any frame are taken: where nobody could set its name.
        urdf: text of the robot's description, for joints.
        tool_frame: link of the robot that is the container, or carries it.
        smoothing: half of the differentiating window [s], which chooses the polynomial's degree,
            too; 0.0: as pose_window.
        base: another frame of poses, where it stands in the world; None: there is none.
        chained: whether the frame of poses moves in the world, as transforms say.
        placed: frame of accelerations that transforms place, moving; empty: none.
        since_ns: stamp of the first moving transform that is used for that [ns]; 0: of all.
        apart: see `AccelInput`.
        odometry: what is read of Odometry messages, their BY_TWIST or BY_POSE.
        whole: whether the input is a motion that begins at rest, as a table's does.
    """

    kind: str | None = None
    gate: GateSettings = GateSettings(confirms=False)
    transform: SensorTransform = SensorTransform()
    pose_window: float = POSE_WINDOW
    frames: tuple[str, str] = ("world", "container")
    modes: Modes = ()
    checks: bool | None = True
    any_world: bool = False
    urdf: str = ""
    tool_frame: str = ""
    smoothing: float = 0.0
    base: Base | None = None
    chained: bool = False
    placed: str = ""
    since_ns: int = 0
    apart: bool = False
    odometry: str = BY_TWIST
    whole: bool = False

    @classmethod
    def from_parameters(cls, parameters: Mapping[str, Any]) -> InputSettings:
        """Creates the settings from the parameters of an estimator node.

        Args:
            parameters: by name; those of a node of old have no `max_jump`: it set nothing aside.

        Raises:
            KeyError: one is missing.
            TypeError, ValueError: one cannot be.
        """
        roll, pitch, yaw = parameters["sensor_rotation"]
        x, y, z = parameters["sensor_to_origin"]
        gate = GateSettings(
            parameters["max_gap"],
            parameters["max_age"],
            parameters.get("max_jump", math.inf),
            confirms="max_jump" in parameters,
        )
        return cls(
            parameters["input"],
            gate,
            SensorTransform(roll, pitch, yaw, (x, y, z)),
            parameters["pose_window"],
            (parameters["world_frame"], parameters["container_frame"]),
            checks=parameters.get("check_input"),
            tool_frame=parameters.get("tool_frame", ""),
            smoothing=parameters.get("smoothing", 0.0),
            base=_base(parameters.get(BASE)),
            chained=parameters.get(CHAINED, False),
            placed=parameters.get(PLACED, ""),
            since_ns=parameters.get(SINCE, parameters.get(CHAINED_SINCE, 0)),
            apart=parameters.get(APART, False),
            odometry=parameters.get(ODOMETRY, BY_TWIST),
        )

    def mounted(
        self, kind: str, frame: str, fixed: FixedFrames, *, moving: bool = False
    ) -> dict[str, Any] | None:
        """Returns the mounting that fixed transforms give for an input frame; None if unknown.

        Args:
            moving: whether there are frames that move, in which poses or sensors may be.

        Returns:
            None: nothing connects the frame. Empty: the parameters say how it is mounted, or the
            frame needs no mounting.
        """
        world, container = self.frames
        if frame.lstrip("/") in ("", world, container) or self.transform != SensorTransform():
            return {}
        if kind == POSE:
            pose = fixed.pose(world, frame)
            if pose is None:
                return {CHAINED: True} if moving else None
            return {BASE: [frame, *pose[0], *pose[1]]}
        mount = fixed.mounting(container, frame) if kind in (ACCEL, IMU) else SensorTransform()
        if kind == ACCEL:
            return self._placed(frame, fixed, mount, moving=moving)
        if mount is None:
            return None
        turn = [mount.roll, mount.pitch, mount.yaw]
        return {"sensor_rotation": turn, "sensor_to_origin": list(mount.to_origin)}

    def _placed(
        self, frame: str, fixed: FixedFrames, mount: SensorTransform | None, *, moving: bool
    ) -> dict[str, Any] | None:
        """Returns the mounting of an acceleration sensor from transforms; see `mounted`.

        A frame that stands still in the world gives its axes alone. In any other one a sensor is
        mounted, and what lies between it and the container accelerates, too, where it turns.
        """
        world = fixed.mounting(self.frames[0], frame)
        if mount is None and world is not None:
            mount = replace(world, to_origin=(0.0, 0.0, 0.0))
        arm = mount is None or math.hypot(*mount.to_origin) > LEAST_ARM
        if mount is None:
            return {PLACED: frame} if moving else None
        found = {
            "sensor_rotation": [mount.roll, mount.pitch, mount.yaw],
            "sensor_to_origin": list(mount.to_origin),
        }
        if moving and arm:
            return found | {PLACED: frame}
        return found | {"world_frame": frame} | ({APART: True} if arm else {})

    def with_mounting(self, parameters: Mapping[str, Any]) -> InputSettings:
        """Returns the settings with the mounting parameters that `mounted` returned."""
        if CHAINED in parameters:
            return self._replace(chained=True)
        placed = parameters.get(PLACED, "")
        if placed and "sensor_rotation" not in parameters:
            return self._replace(placed=placed)
        if BASE in parameters:
            return self._replace(base=_base(parameters[BASE]))
        roll, pitch, yaw = parameters["sensor_rotation"]
        x, y, z = parameters["sensor_to_origin"]
        world = parameters.get("world_frame", self.frames[0])
        transform = SensorTransform(roll, pitch, yaw, (x, y, z))
        apart = APART in parameters
        frames = world, self.frames[1]
        return self._replace(transform=transform, frames=frames, apart=apart, placed=placed)

    def expected(self, kind: str, frame: str) -> tuple[Expected, bool]:
        """Returns a sensor's configured mounting, and whether its axes are those of the world.

        Returns:
            and whether its axes are the world's.
        """
        world, container = self.frames
        # A frame that fixed transforms place on the container took the name of the world's.
        in_world = kind == ACCEL and frame == world and not any(self.transform.to_origin)
        arm = not in_world and (kind == IMU or frame != container)
        rotation, place = np.array(self.transform.matrix), np.array(self.transform.to_origin)
        return Expected(rotation, place, kind == IMU, arm), in_world

    def felt(self, kind: str, model: Model) -> Model:
        """Returns the model that an input drives; the only rule for live runs and replays.

        Where the input tells the container's attitude, gravity acts along its tilted floor.
        """
        return model.with_gravity_tilt() if kind in WINDOWED or self.placed else model

    def poses(self, kind: str) -> PoseSource | None:
        """Returns the converter of a message type to poses; None if the type needs no converter.

        Raises:
            SloshMotionError: the robot's description does not fit.
        """
        world, container = self.frames
        if kind == TRANSFORMS:
            return TransformPoses(world, container)
        if kind == POSE and self.chained:
            return TransformPoses(world, POSED, self.since_ns)
        if kind == ACCEL and self.placed:
            gate = replace(self.gate, chosen=False)
            arm = PoseInput(gate, 0.0, None, world, True, False, "transforms")
            arm.sampling.carry(self.modes)
            return PlacedAccel(world, container, self.placed, arm, self.since_ns)
        if kind == JOINTS:
            return JointPoses(Robot(self.urdf, self.tool_frame or container, world))
        return None

    def reader(self, kind: str) -> AnyInput:
        """Returns the reader that converts messages of a type to input samples."""
        found = self._reader(kind)
        if isinstance(self.pose_window, int):
            found.sampling.mute()
        if self.whole:
            found.assume_rest()
        found.sampling.carry(self.modes)
        return found

    def _reader(self, kind: str) -> AnyInput:
        if kind == IMU:
            return ImuInput(self.gate, self.transform, self.checks)
        old = self.checks is None
        mount = SensorTransform() if old else self.transform
        if kind == ACCEL:
            mount = SensorTransform() if self.placed else mount
            return AccelInput(self.gate, self.frames, mount, self.checks, apart=self.apart)
        by_pose = kind == ODOMETRY and self.odometry == BY_POSE
        if kind in VELOCITIES and not by_pose:
            return VelocityInput(
                self.gate, self.pose_window, mount, self.frames, self.checks, NOUNS[kind],
                self.smoothing,
            )  # fmt: skip
        world = None if old else self.frames[0]
        reader = OdometryPoses if by_pose else PoseInput
        return reader(
            self.gate, self.pose_window, mount, world, self.any_world or kind != POSE,
            self.checks, NOUNS[kind], self.smoothing, self.base,
        )  # fmt: skip


def _base(told: Sequence[Any] | None) -> Base | None:
    """Returns the pose of a robot's base from a node's settings; None if not set."""
    if told is None:
        return None
    frame, px, py, pz, x, y, z, w = told
    return Base(str(frame), ((px, py, pz), (x, y, z, w)))


class WantedInput(NamedTuple):
    """The user's choice of input for a recording, which overrides the recorded settings.

    Attributes:
        kind: one of MESSAGE_TYPES; None: as recorded.
        urdf: text of the robot's description; empty: as recorded.
        tool_frame: link of the robot; empty: as recorded.
    """

    kind: str | None = None
    urdf: str = ""
    tool_frame: str = ""

    def over(self, recorded: InputSettings) -> InputSettings:
        """Returns the recorded settings, overridden by the user's choice."""
        return recorded._replace(
            kind=self.kind or recorded.kind,
            urdf=self.urdf or recorded.urdf,
            tool_frame=self.tool_frame or recorded.tool_frame,
        )
