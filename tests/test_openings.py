"""Tests that a replay with its page opens a recording once, with one reader."""

import os
from pathlib import Path

import pytest

from slosh_bag.mcap_files import shared_file
from slosh_bag.reader import BagReader
from slosh_bringup.live.report import make_live_report
from slosh_bringup.replay.task import Task, replay_task

BAG = Path(__file__).parents[1] / "bags" / "c3"
MOST = 4


@pytest.fixture
def counts(monkeypatch):
    """Returns how many readers were made and how often a recorded file was opened."""
    found = {"readers": 0, "openings": 0}
    made = BagReader.__init__
    path_open, system_open = Path.open, os.open

    def make(reader, path):
        found["readers"] += 1
        made(reader, path)

    def by_path(path, mode="r", *others, **named):
        if path.suffix == ".mcap" and path.is_relative_to(BAG) and type(path) is type(Path()):
            found["openings"] += 1
        return path_open(path, mode, *others, **named)

    def by_system(path, *others, **named):
        if str(path).endswith(".mcap") and Path(path).is_relative_to(BAG):
            found["openings"] += 1
        return system_open(path, *others, **named)

    monkeypatch.setattr(BagReader, "__init__", make)
    monkeypatch.setattr(Path, "open", by_path)
    monkeypatch.setattr(os, "open", by_system)
    return found


def test_a_replay_with_its_page_opens_a_bag_at_most_four_times(counts, tmp_path):
    replay_task(Task(BAG, "c3", output=tmp_path))
    assert counts["readers"] == 1
    assert 1 <= counts["openings"] <= MOST


def test_a_live_report_opens_a_bag_at_most_four_times(counts):
    make_live_report(BAG, "title")
    assert counts["readers"] == 1
    assert 1 <= counts["openings"] <= MOST


def test_streams_of_a_shared_file_have_positions_of_their_own(tmp_path):
    path = tmp_path / "a.mcap"
    path.write_bytes(bytes(range(100)))
    (shared,) = shared_file.shared_files([path])
    with shared.open("rb") as one, shared.open("rb") as other:
        assert one.read(3) == bytes([0, 1, 2])
        other.seek(-2, 2)
        assert other.read() == bytes([98, 99])
        assert one.read(2) == bytes([3, 4])
    path.unlink()
    with shared.open("rb") as again:
        assert len(again.read()) == 100
