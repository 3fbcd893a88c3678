"""Replays the estimator and the monitor over recordings with identical results."""

from slosh_replay.replay.replay_bag import replay_bag
from slosh_replay.replay.replay_table import replay_table
from slosh_replay.replay.result import ReplayResult

__all__ = ["ReplayResult", "replay_bag", "replay_table"]
