"""Parameters of the governor node."""

from __future__ import annotations

from slosh_governor.core import ModelDoubt
from slosh_governor.core.commands import MOST_FREQUENCY
from slosh_governor.core.parameters import POSITION, VELOCITY
from slosh_governor.tuning import TUNING
from slosh_msgs_py import topics
from slosh_msgs_py.node.parameters import ParameterSpec
from slosh_plan.nodes.robot_parameters import JOINT_LIMITS
from slosh_plan.planning.limits import ACCELERATION, JERK

PARAMETERS = (
    ParameterSpec(
        "model", "", "model file of the container and its liquid (model.yaml), or tray.yaml"
    ),
    ParameterSpec("limit", 0.02, "limit of the wave height [m]; 0: the rim alone", (0.0, 1.0)),
    ParameterSpec(
        "rim_distance", 0.0,
        "least distance of the liquid to the rim [m]; 0: the rim itself", (0.0, 1.0),
    ),
    ParameterSpec(
        "max_acceleration", ACCELERATION,
        "limit of the container's acceleration [m/s²]", (0.01, 100.0)
    ),
    ParameterSpec("max_jerk", JERK, "limit of the container's jerk [m/s³]", (0.1, 10_000.0)),
    ParameterSpec(
        "rate", TUNING.rate, "rate of the steps and of the output [Hz]", (20.0, 1000.0)
    ),
    ParameterSpec(
        "timeout", TUNING.timeout,
        "age after which a command is no longer followed [s]", (0.01, 10.0),
    ),
    ParameterSpec(
        "frequency_error", ModelDoubt().frequency,
        "error of the natural frequency that is allowed for, relative", (0.0, MOST_FREQUENCY),
    ),
    ParameterSpec(
        "damping_factor", ModelDoubt().damping,
        "factor by which the liquid's damping may be larger or smaller than the model's",
        (1.0, 10.0),
    ),
    ParameterSpec(
        "starts_at_rest", False,
        "whether the liquid is at rest when the node starts; else it is unknown, and not safe "
        "until the largest wave has decayed or the observer has seen it",
    ),
    ParameterSpec(
        "friction", 1.0,
        "share of the available friction that loosely standing containers may use", (0.01, 1.0),
    ),
    ParameterSpec(
        "tipping", 1.0, "share of the base's radius that the centre of pressure of loosely "
        "standing containers may use", (0.01, 1.0),
    ),
    ParameterSpec(
        "command", "twist", "type of the commands to follow", choices=tuple(topics.COMMANDING)
    ),
    ParameterSpec("world_frame", "world", "frame of the commands and of all output"),
    ParameterSpec(
        "urdf", "",
        "URDF file of the robot, for commands of joints, or so that its joints keep their limits "
        "with other commands, too; its root has the axes of world_frame",
    ),
    ParameterSpec("tool_frame", "", "link of the robot that is the container or tray"),
    JOINT_LIMITS,
    ParameterSpec(
        "max_joint_acceleration", 10.0,
        "acceleration limit of joints whose files give none [rad/s² or m/s²]",
        (0.01, 1000.0),
    ),
    ParameterSpec(
        "max_joint_jerk", 200.0,
        "jerk limit of joints whose files give none [rad/s³ or m/s³]",
        (0.1, 100_000.0),
    ),
    ParameterSpec(
        "values", POSITION, "meaning of the numbers of joint_values",
        choices=(POSITION, VELOCITY),
    ),
)  # fmt: skip
