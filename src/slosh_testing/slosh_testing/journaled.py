"""Checks that the nodes of a recording give the same again, by the journals of what they took."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from slosh_replay.journaled.replay import replay_journals


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
