"""Records, reads, imports and replays MCAP bags of a slosh cell."""

from typing import TYPE_CHECKING

from slosh_files.lazy_names import lazy_names

if TYPE_CHECKING:
    from slosh_bag.motion_table import MotionTable, read_motion_table, write_motion_table
    from slosh_bag.reader import BagReader
    from slosh_bag.replay.replay_bag import replay_bag
    from slosh_bag.replay.result import ReplayResult

__all__ = [
    "BagReader",
    "MotionTable",
    "ReplayResult",
    "read_motion_table",
    "replay_bag",
    "write_motion_table",
]

__getattr__ = lazy_names(
    __name__,
    {
        "BagReader": "reader",
        "MotionTable": "motion_table",
        "ReplayResult": "replay.result",
        "read_motion_table": "motion_table",
        "replay_bag": "replay.replay_bag",
        "write_motion_table": "motion_table",
    },
)
