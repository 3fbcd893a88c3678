"""How a replay by journals runs the governor again."""

from __future__ import annotations

from slosh_governor.nodes.governor_node import GovernorNode
from slosh_model.tray import TRAY
from slosh_msgs_py.topics import GOVERNED_MOTION
from slosh_replay.journaled.replay import Row, types_of

ROW = Row(
    GovernorNode,
    {"later": True},
    types_of(GOVERNED_MOTION),
    {"model": "model", TRAY: "model", "urdf": "urdf", "joint_limits": "joint_limits"},
)
