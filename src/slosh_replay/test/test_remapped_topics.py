"""Tests that topics under a robot's own names are found by the nodes' recorded settings."""

import pytest

from slosh_bag.bag_writer import BagWriter
from slosh_bag.definitions import Definitions
from slosh_bag.errors import SloshBagError
from slosh_bag.playing.play_plan import PlayRequest, make_plan
from slosh_bag.reader import BagReader
from slosh_motion.recorded.sources import CellTopics, find_sources
from slosh_replay.replay import replay_bag
from slosh_replay.tables.bag_table import read_bag_table
from slosh_testing.live_bag import LiveBag

ACCEL = "/arm/tcp_acceleration"
ALL = {"accel": ACCEL, "estimate": "/robot/wave", "free_surface": "/eye/level"}


def remapped(folder, remap, **others):
    live = LiveBag()
    live.remap = dict(remap)
    for name, value in others.items():
        setattr(live, name, value)
    return live.write(folder, 1.0)


@pytest.mark.parametrize("remap", [{"accel": ACCEL}, ALL], ids=["input", "all"])
def test_a_recording_of_remapped_topics_is_replayed_bit_for_bit(tmp_path, remap):
    plain = replay_bag(remapped(tmp_path / "plain", {}))
    result = replay_bag(remapped(tmp_path / "own", remap))
    assert result.verification.exact
    assert result.verification.identical == plain.verification.identical > 1000
    assert [row.sigma for row in result.accuracy] == [row.sigma for row in plain.accuracy]


def test_tables_come_from_remapped_topics(tmp_path):
    path = remapped(tmp_path / "own", ALL)
    table = read_bag_table(path)
    assert table.table.acceleration.max() > 3.0


def test_each_of_two_cells_has_its_own_remapped_topics(tmp_path):
    first, second = LiveBag(), LiveBag()
    first.remap = {"accel": "/arm_a/accel", "estimate": "/z/estimate"}
    second.namespace, second.remap = "/cell_b", {"accel": "/arm_b/accel"}
    path = first.write(tmp_path / "two", 1.0, beside=[second])
    reader = BagReader(path)
    assert CellTopics(reader).cells == ("/cell_b", "/slosh")
    found = {cell: find_sources(path, reader, cell=cell) for cell in ("/slosh", "/cell_b")}
    assert (found["/slosh"].input, found["/slosh"].estimate) == ("/arm_a/accel", "/z/estimate")
    assert found["/cell_b"].input == "/arm_b/accel"
    assert found["/cell_b"].estimate == "/cell_b/estimate"
    for cell in found:
        assert replay_bag(path, cell=cell).verification.exact


def test_a_topic_that_was_renamed_after_the_recording_is_found_by_its_name(tmp_path):
    live = LiveBag()
    live.remap = {"accel": ACCEL}
    entries = live.entries(1.0)
    definitions = Definitions()
    with BagWriter(tmp_path / "own", definitions) as writer:
        for log_ns, topic, kind, data in sorted(entries, key=lambda entry: entry[0]):
            name = topic.replace(ACCEL, "/slosh/accel")
            writer.add_topic(name, kind)
            writer.write(name, data, log_ns)
    assert replay_bag(tmp_path / "own").verification.exact


def test_a_missing_remapped_input_is_named_as_the_robot_names_it(tmp_path):
    others = ("estimate", "free_surface", "settings")
    path = remapped(tmp_path / "own", {"accel": ACCEL}, topics=others)
    with pytest.raises(SloshBagError, match=f"no message of accel .the estimator read {ACCEL}"):
        replay_bag(path)


def test_played_inputs_are_those_that_the_nodes_told(tmp_path):
    path = remapped(tmp_path / "own", ALL)
    reader = BagReader(path)
    cells = [CellTopics(reader, cell) for cell in CellTopics(reader).cells]
    told = frozenset(cell.told("accel") for cell in cells)
    assert told == {ACCEL}
    plan = make_plan(PlayRequest(path, inputs=True, told_inputs=told))
    assert set(plan.topics) == {ACCEL}
