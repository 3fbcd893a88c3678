"""Checks that the nodes of a recording give the same again, by the journals of what they took."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from slosh_bringup.replay.by_journal import checked_by_journal
from slosh_replay.journaled.replay import replay_journals
from slosh_replay.recorded_run import RecordedRun
from slosh_replay.replay import ReplayResult, replay_bag


def replayed_by_journal(bag: Path, cell: str | None = None) -> ReplayResult:
    """Replays a bag as `slosh replay --check` does, all nodes by their journals."""
    run = RecordedRun(bag)
    return checked_by_journal(replay_bag(run, cell=cell), run, cell)


def assert_same_by_journal(bag: Path, nodes: Collection[str] = ("estimator",)) -> None:
    """Asserts that each of the nodes is replayed whole, and each of its messages bit for bit."""
    found = replay_journals(bag)
    assert {one.node for one in found.processes} >= set(nodes)
    for one in found.processes:
        assert not one.lacking, (one.node, one.lacking)
    for name, compared in found.verified.items():
        assert compared.identical == compared.recorded, (name, compared.lines())
        assert not compared.missing, (name, compared.lines())
    assert any(compared.identical for compared in found.verified.values())
