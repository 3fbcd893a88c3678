"""Replays recordings: runs estimator and monitor again and compares the results."""

from typing import TYPE_CHECKING

from slosh_base.files.lazy_names import lazy_names

if TYPE_CHECKING:
    from slosh_replay.replay.replay_bag import replay_bag
    from slosh_replay.replay.result import ReplayResult

__all__ = ["ReplayResult", "replay_bag"]

__getattr__ = lazy_names(
    __name__, {"ReplayResult": "replay.result", "replay_bag": "replay.replay_bag"}
)
