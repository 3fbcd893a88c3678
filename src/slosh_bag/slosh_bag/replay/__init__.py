"""Deterministic replay: the estimator's and the monitor's cores over recordings."""

from slosh_bag.replay.bag import replay_bag
from slosh_bag.replay.result import ReplayResult
from slosh_bag.replay.table import replay_table

__all__ = ["ReplayResult", "replay_bag", "replay_table"]
