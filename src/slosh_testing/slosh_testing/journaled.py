"""Checks that the nodes of a recording give the same again, by the journals of what they took."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from slosh_replay.journaled.replay import replay_journals


def assert_same_by_journal(bag: Path, nodes: Collection[str] = ("estimator",)) -> None:
    """Asserts that each of the nodes is replayed whole, and each of its messages bit for bit."""
    found = replay_journals(bag)
    assert {one.node for one in found} >= set(nodes)
    for one in found:
        assert not one.lacking, (one.node, one.lacking)
        for topic, match in one.matches.items():
            assert match.different + match.missing == 0, (one.node, topic, match)
    assert any(match.identical for one in found for match in one.matches.values())
