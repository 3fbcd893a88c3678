"""Table of a cell's topics, services and actions; all other topic lists are derived from it.

Names are relative to the cell's namespace; a name with a slash in front belongs to the whole
graph. A new topic is one row of TOPICS, and a constant where code names it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from enum import Enum
from functools import cache
from typing import Final, NamedTuple

from slosh_msgs_py.errors import SloshMessageError

NAMESPACE: Final = "/slosh"
"""The default namespace of a cell."""

ACCEL: Final = "accel"
IMU: Final = "imu"
POSE: Final = "pose"
TWIST: Final = "twist"
JOINT_STATES: Final = "/joint_states"
ODOMETRY: Final = "/odom"
FORCE: Final = "force"
"""What a force sensor under the container measures."""
LEVEL: Final = "level"
"""Distance from a level sensor down to the liquid."""
LEVEL_POINT: Final = "level_point"
"""Height of the liquid at a place in the container's frame."""
IMAGE: Final = "camera/image_raw"
IMAGE_COMPRESSED: Final = "camera/image_raw/compressed"
CAMERA_INFO: Final = "camera/camera_info"
FREE_SURFACE: Final = "free_surface"
ESTIMATE: Final = "estimate"
EXPECTED_READING: Final = "expected_reading"
"""Of models with effects on the measurement, beside each estimate."""
ESTIMATOR_STATE: Final = "estimator_state"
"""What the estimator's next answers depend on, some times a second."""
CONTAINER: Final = "container"
"""What the gripper holds; latched."""
TRAY_ESTIMATE: Final = "tray_estimate"
"""Of a cell with several containers, beside the first one's estimates."""
SENSED_SURFACE: Final = "sensed_surface"
"""What force and level sensors tell of the surface, beside a camera."""
FUSED_ESTIMATE: Final = "fused_estimate"
"""The liquid's state by model and measured heights together."""
OBSERVER_STATE: Final = "observer_state"
CALM: Final = "calm"
IS_CALM: Final = "is_calm"
"""The same as `calm`, as a plain Bool."""
COMPARISON: Final = "comparison"
LIMIT_EVENT: Final = "limit_event"
SETTINGS: Final = "settings"
JOURNAL: Final = "journal"
"""What each node has taken, in order."""
PLANNED_TRAJECTORY: Final = "planned_trajectory"
"""What the robot is about to do, by whoever planned it."""
DESIRED_TWIST: Final = "desired_twist"
"""Commands of a teleoperation, a jog or a servo for the governor,"""
DESIRED_POSE: Final = "desired_pose"
"""or targets,"""
DESIRED_JOINTS: Final = "desired_joints"
DESIRED_JOINT_TRAJECTORY: Final = "desired_joint_trajectory"
DESIRED_JOINT_VALUES: Final = "desired_joint_values"
"""or targets of the joints; what the governor passes on:"""
SAFE_JOINTS: Final = "safe_joints"
SAFE_JOINT_TRAJECTORY: Final = "safe_joint_trajectory"
SAFE_JOINT_VALUES: Final = "safe_joint_values"
SAFE_TWIST: Final = "safe_twist"
GOVERNED_MOTION: Final = "governed_motion"
"""The same with all that is known of it."""
STOP_TRAJECTORY: Final = "stop_trajectory"
"""The motion of an emergency stop; latched,"""
STOP_JOINT_TRAJECTORY: Final = "stop_joint_trajectory"
"""and that of the joints, where the robot is known."""
MARKERS: Final = "markers"
"""The surface for RViz and Foxglove, by the optional node `markers`."""
PREDICTION: Final = "prediction"
PREDICTION_OUTCOME: Final = "prediction_outcome"
TRUTH: Final = "cell/truth"
"""Exact heights, by the simulated cell alone."""
SUMMARY: Final = "cell/summary"
"""What the simulated cell has published, by topic, as JSON; latched."""
WALL_HEIGHTS: Final = "wall_heights"
"""In bags that are made of motion tables."""
DIAGNOSTICS: Final = "/diagnostics"
CLOCK: Final = "/clock"
TF: Final = "/tf"
TF_STATIC: Final = "/tf_static"
ROBOT_DESCRIPTION: Final = "/robot_description"

WAIT_UNTIL_CALM: Final = "wait_until_calm"
"""The action: ends when the liquid is calm."""
EMERGENCY_STOP: Final = "emergency_stop"
RELEASE_STOP: Final = "release_stop"
PREDICT: Final = "predict"
PLAN: Final = "plan"
PLAN_MOTION: Final = "plan_motion"
"""The action: what `plan` does, with feedback and an end at any time."""
FOLLOW_TRAJECTORY: Final = "follow_joint_trajectory"
"""The relay's action: a joint trajectory, sent to the controller at a safe pace."""
CHANGE_CONTAINER: Final = "change_container"
LOAD_MODEL: Final = "load_model"
RESET: Final = "reset"
MONITOR_RESET: Final = f"monitor/{RESET}"
KEEP: Final = "recorder/keep"
"""Of a recorder that records events: writes a bag of now."""


class TopicRole(Enum):
    """Publisher and purpose of a topic."""

    INPUT = "the robot, its planner or its camera: inputs of the cell's nodes"
    ANSWER = "the cell's nodes: their results"
    SETTING = "the cell's nodes: their settings"
    SIMULATION = "the simulated cell, in addition to the inputs"
    TABLE = "no node; only in bags made from motion tables"
    SHARED = "the whole graph"


class Publishers(Enum):
    """Number of nodes of one cell that may publish a topic at the same time."""

    ONE = 1
    MANY = 2


class Topic(NamedTuple):
    """A topic of a cell: name, type, publisher and use.

    Attributes:
        name: relative to the cell's namespace, or absolute.
        type: of its messages.
        role: who publishes it.
        publishers: how many may do so at the same time.
        remappable: whether `remap` of a cell file may give it another name.
        latched: whether late subscribers receive earlier messages (transient local).
        recorded: whether the recorder records it by default.
        page: whether the operator's page reads it.
        drives: value of the estimator's parameter `input` with which it drives the models; empty:
            it does not.
        commands: value of the governor's parameter `command` with which it reads commands here;
            empty: it does not.
    """

    name: str
    type: str
    role: TopicRole
    publishers: Publishers = Publishers.ONE
    remappable: bool = False
    latched: bool = False
    recorded: bool = True
    page: bool = False
    drives: str = ""
    commands: str = ""

    @property
    def is_absolute(self) -> bool:
        """Whether the topic name is absolute, i.e. independent of the cell's namespace."""
        return self.name.startswith("/")


class Service(NamedTuple):
    """A service or an action of a cell: name, type, and whether it may be renamed.

    Attributes:
        name: relative to the cell's namespace.
        type: its type.
        remappable: whether `remap` of a cell file may give it another name.
    """

    name: str
    type: str
    remappable: bool = False


_INPUT, _ANSWER, _SHARED = TopicRole.INPUT, TopicRole.ANSWER, TopicRole.SHARED
_MANY = Publishers.MANY
_JOINT_COMMANDS = (
    (DESIRED_JOINTS, SAFE_JOINTS, "sensor_msgs/msg/JointState"),
    (
        DESIRED_JOINT_TRAJECTORY, SAFE_JOINT_TRAJECTORY, "trajectory_msgs/msg/JointTrajectory"
    ),
    (DESIRED_JOINT_VALUES, SAFE_JOINT_VALUES, "std_msgs/msg/Float64MultiArray"),
)  # fmt: skip
"""Commands of joints, what is passed on of them, and the type of both."""

TOPICS: tuple[Topic, ...] = (
    Topic(ACCEL, "geometry_msgs/msg/AccelStamped", _INPUT, remappable=True, drives="accel"),
    Topic(IMU, "sensor_msgs/msg/Imu", _INPUT, remappable=True, drives="imu"),
    Topic(POSE, "geometry_msgs/msg/PoseStamped", _INPUT, remappable=True, drives="pose"),
    Topic(
        JOINT_STATES, "sensor_msgs/msg/JointState", _INPUT, _MANY, remappable=True, drives="joints"
    ),
    Topic(ODOMETRY, "nav_msgs/msg/Odometry", _INPUT, remappable=True, drives="odometry"),
    Topic(TWIST, "geometry_msgs/msg/TwistStamped", _INPUT, remappable=True, drives="twist"),
    Topic(FORCE, "geometry_msgs/msg/WrenchStamped", _INPUT, remappable=True),
    Topic(LEVEL, "sensor_msgs/msg/Range", _INPUT, remappable=True),
    Topic(LEVEL_POINT, "geometry_msgs/msg/PointStamped", _INPUT, remappable=True),
    Topic(IMAGE, "sensor_msgs/msg/Image", _INPUT, remappable=True),
    Topic(IMAGE_COMPRESSED, "sensor_msgs/msg/CompressedImage", _INPUT, remappable=True),
    Topic(CAMERA_INFO, "sensor_msgs/msg/CameraInfo", _INPUT, remappable=True),
    Topic(PLANNED_TRAJECTORY, "trajectory_msgs/msg/MultiDOFJointTrajectory", _INPUT, _MANY),
    Topic(
        DESIRED_TWIST, "geometry_msgs/msg/TwistStamped", _INPUT, remappable=True, commands="twist"
    ),
    Topic(DESIRED_POSE, "geometry_msgs/msg/PoseStamped", _INPUT, remappable=True, commands="pose"),
    *(
        Topic(desired, kind, _INPUT, remappable=True, commands=desired.removeprefix("desired_"))
        for desired, _, kind in _JOINT_COMMANDS
    ),
    *(Topic(safe, kind, _ANSWER, remappable=True) for _, safe, kind in _JOINT_COMMANDS),
    Topic(SAFE_TWIST, "geometry_msgs/msg/TwistStamped", _ANSWER, remappable=True),
    Topic(GOVERNED_MOTION, "slosh_msgs/msg/GovernedMotion", _ANSWER),
    Topic(
        STOP_TRAJECTORY, "trajectory_msgs/msg/MultiDOFJointTrajectory", _ANSWER,
        remappable=True, latched=True,
    ),
    Topic(
        STOP_JOINT_TRAJECTORY, "trajectory_msgs/msg/JointTrajectory", _ANSWER,
        remappable=True, latched=True,
    ),
    Topic(FREE_SURFACE, "slosh_msgs/msg/FreeSurface", _ANSWER, remappable=True, page=True),
    Topic(ESTIMATE, "slosh_msgs/msg/SloshEstimate", _ANSWER, remappable=True, page=True),
    Topic(EXPECTED_READING, "slosh_msgs/msg/ExpectedReading", _ANSWER, remappable=True),
    Topic(ESTIMATOR_STATE, "slosh_msgs/msg/EstimatorState", _ANSWER),
    Topic(CONTAINER, "slosh_msgs/msg/ContainerChange", _ANSWER, latched=True),
    Topic(TRAY_ESTIMATE, "slosh_msgs/msg/TrayEstimate", _ANSWER, remappable=True),
    Topic(SENSED_SURFACE, "slosh_msgs/msg/FreeSurface", _ANSWER, remappable=True),
    Topic(FUSED_ESTIMATE, "slosh_msgs/msg/FusedEstimate", _ANSWER, remappable=True, page=True),
    Topic(OBSERVER_STATE, "slosh_msgs/msg/ObserverState", _ANSWER),
    Topic(CALM, "slosh_msgs/msg/Calm", _ANSWER, remappable=True, latched=True, page=True),
    Topic(IS_CALM, "std_msgs/msg/Bool", _ANSWER, remappable=True, latched=True),
    Topic(COMPARISON, "slosh_msgs/msg/SloshComparison", _ANSWER, remappable=True, page=True),
    Topic(
        LIMIT_EVENT, "slosh_msgs/msg/LimitEvent", _ANSWER,
        remappable=True, latched=True, page=True,
    ),
    Topic(MARKERS, "visualization_msgs/msg/MarkerArray", _ANSWER, recorded=False),
    Topic(PREDICTION, "slosh_msgs/msg/MotionPrediction", _ANSWER, remappable=True, latched=True),
    Topic(
        PREDICTION_OUTCOME, "slosh_msgs/msg/PredictionOutcome", _ANSWER,
        remappable=True, latched=True,
    ),
    Topic(
        SETTINGS, "slosh_msgs/msg/NodeSettings", TopicRole.SETTING, _MANY, latched=True, page=True
    ),
    Topic(JOURNAL, "slosh_msgs/msg/Journal", TopicRole.SETTING, _MANY, latched=True),
    Topic(TRUTH, "slosh_msgs/msg/FreeSurface", TopicRole.SIMULATION),
    Topic(SUMMARY, "std_msgs/msg/String", TopicRole.SIMULATION, latched=True),
    Topic(WALL_HEIGHTS, "sensor_msgs/msg/PointCloud2", TopicRole.TABLE, recorded=False),
    Topic(
        DIAGNOSTICS, "diagnostic_msgs/msg/DiagnosticArray", _SHARED, _MANY,
        remappable=True, page=True,
    ),
    Topic(CLOCK, "rosgraph_msgs/msg/Clock", _SHARED),
    Topic(TF, "tf2_msgs/msg/TFMessage", _INPUT, _MANY, remappable=True, drives="tf"),
    Topic(TF_STATIC, "tf2_msgs/msg/TFMessage", _INPUT, _MANY, remappable=True, latched=True),
    Topic(ROBOT_DESCRIPTION, "std_msgs/msg/String", _INPUT, remappable=True, latched=True),
)  # fmt: skip
SERVICES: tuple[Service, ...] = (
    Service(CHANGE_CONTAINER, "slosh_msgs/srv/ChangeContainer", remappable=True),
    Service(LOAD_MODEL, "slosh_msgs/srv/LoadModel", remappable=True),
    Service(RESET, "std_srvs/srv/Trigger", remappable=True),
    Service(MONITOR_RESET, "std_srvs/srv/Trigger", remappable=True),
    Service(KEEP, "std_srvs/srv/Trigger", remappable=True),
    Service(EMERGENCY_STOP, "std_srvs/srv/Trigger"),
    Service(RELEASE_STOP, "std_srvs/srv/Trigger"),
    Service(PREDICT, "slosh_msgs/srv/PredictSlosh"),
    Service(PLAN, "slosh_msgs/srv/PlanMotion"),
)
ACTIONS: tuple[Service, ...] = (
    Service(PLAN_MOTION, "slosh_msgs/action/PlanMotion"),
    Service(WAIT_UNTIL_CALM, "slosh_msgs/action/WaitUntilCalm"),
    Service(FOLLOW_TRAJECTORY, "control_msgs/action/FollowJointTrajectory"),
)
DRIVING: Mapping[str, Topic] = {row.drives: row for row in TOPICS if row.drives}
"""Topics that can drive the models, by the value of the estimator's parameter `input`."""
COMMANDING: Mapping[str, Topic] = {row.commands: row for row in TOPICS if row.commands}
"""Topics of commands, by the value of the governor's parameter `command`."""


PER_CONTAINER = (FREE_SURFACE, COMPARISON, IMAGE, IMAGE_COMPRESSED, CAMERA_INFO)
"""Topics that each container of a tray with a camera of its own has; see `of_container`."""


def of_container(name: str, container: str) -> str:
    """Converts a topic name of the tray's first container to that of a named container.

    >>> of_container("camera/image_raw", "right")
    'camera_right/image_raw'

    Args:
        name: of the first container's topic, one of PER_CONTAINER.
        container: name of the other one; empty: the first.

    Raises:
        SloshMessageError: no topic can carry that name.
    """
    if not re.fullmatch(r"\w*", container, re.ASCII):
        raise SloshMessageError(
            f"camera of container {container!r:.60}: topics carry the container's name: rename it "
            "in tray.yaml to letters, digits and '_'"
        )
    first, slash, rest = name.partition("/")
    return f"{first}_{container}{slash}{rest}" if container else name


def _of_some_container(name: str) -> str:
    """Returns a regular expression that matches a topic's name for each container."""
    first, slash, rest = name.partition("/")
    other = r"(?:_\w+)?" if name in PER_CONTAINER else ""
    return f"{re.escape(first)}{other}{re.escape(slash + rest)}"


@cache
def row_of(name: str) -> Topic | None:
    """Returns the table row of a relative topic name, of any container; None if there is none."""
    fitting = (
        row
        for row in TOPICS
        if not row.is_absolute and re.fullmatch(_of_some_container(row.name), name)
    )
    return next(fitting, None)


class CellName(NamedTuple):
    """A full topic name and the entry of the project's topic table to which it belongs.

    Attributes:
        namespace: of the cell; empty: the root.
        name: in the cell.
        topic: its row; None: another topic in a folder of the cell, such as a point cloud of its
            camera.
    """

    namespace: str
    name: str
    topic: Topic | None

    @property
    def is_input(self) -> bool:
        """Whether the topic is published by the robot, its planner or its camera."""
        if self.topic is not None:
            return self.topic.role is TopicRole.INPUT
        folder = self.name.partition("/")[0]
        return any(
            row.role is TopicRole.INPUT
            and "/" in row.name
            and re.fullmatch(_of_some_container(row.name).partition("/")[0], folder)
            for row in TOPICS
        )


def is_input(topic: str, message_type: str = "") -> bool:
    """Whether a topic is published by the robot, its planner or its camera.

    Args:
        topic: its full name.
        message_type: its type; empty: not known.
    """
    if any(row.name == topic and row.role is TopicRole.INPUT for row in TOPICS):
        return True
    found = cell_name(topic, message_type)
    return found is not None and found.is_input


def cell_name(topic: str, message_type: str = "") -> CellName | None:
    """Resolves a full topic name to one of the cell's own topics, in any namespace.

    Args:
        topic: the full name.
        message_type: of the topic; empty: not known. A topic of another type than that of its row
            is none of the cell's own.

    Returns:
        None: it is no topic of a cell.
    """
    names = [row.name for row in TOPICS if not row.is_absolute]
    found = re.fullmatch(f"(.*?)/({'|'.join(map(_of_some_container, names))})", topic)
    row = row_of(found[2]) if found is not None else None
    if found is not None and row is not None:
        return CellName(found[1], found[2], row) if message_type in ("", row.type) else None
    folders = sorted({name.partition("/")[0] for name in names if "/" in name})
    found = re.fullmatch(f"(.*?)/((?:{'|'.join(map(re.escape, folders))})/.+)", topic)
    return CellName(found[1], found[2], None) if found is not None else None
