"""Parameters of nodes that plan or judge motions of a robot's joints; see `robot_file`."""

from __future__ import annotations

from typing import Final

from slosh_msgs_py.node.parameters import ParameterSpec

TOOL_AND_GROUP: Final = (
    ParameterSpec("tool_frame", "", "link of the robot that holds the container"),
    ParameterSpec(
        "srdf", "", "MoveIt's semantic robot description (SRDF), for group; empty if unused"
    ),
    ParameterSpec(
        "group", "",
        "joint group of the SRDF that is planned; other joints that carry the container stay at "
        "the position given for them, or at 0; empty: all joints are planned",
    ),
)  # fmt: skip
JOINT_LIMITS: Final = ParameterSpec(
    "joint_limits", "", "MoveIt's joint_limits.yaml, to override URDF limits; empty if unused"
)
