"""What this add-on brings to the core: see slosh_base.addons."""

from __future__ import annotations

from slosh_base.addons import AddOn, CellNode
from slosh_msgs_py.topics import COMMANDING, GOVERNED_MOTION

ADDON = AddOn(
    nodes={
        "governor": "slosh_governor.nodes.governor_node",
        "relay": "slosh_governor.nodes.relay_node",
    },
    cell_nodes={
        "govern": CellNode(
            "governor",
            "limit commands",
            choices=tuple(COMMANDING),
            parameter="command",
            takes=("model", "urdf", "tool_frame"),
            begins=True,
        )
    },
    replay_rows={"governor": "slosh_governor.replay_row"},
    figures={GOVERNED_MOTION: "slosh_governor.figure"},
    demo_options=("slosh_governor.demo_option",),
    compiled=("slosh_governor.core",),
)
