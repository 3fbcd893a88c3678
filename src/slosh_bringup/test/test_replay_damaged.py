"""Tests that damaged bags replay with equal results, with a warning, or with a clear error."""

import json
import random
import shutil

import numpy as np
import pytest

from slosh_bag.bag_writer import BagWriter
from slosh_bag.definitions import Definitions
from slosh_bag.reader import BagReader
from slosh_bringup.cli.main import main
from slosh_model.model import Model
from slosh_model.model_text import format_model
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.simulate import Inputs, simulate
from slosh_motion.tables.motion_table import MotionTable
from slosh_replay.tables.table_bag import write_table_bag

MODEL = Model(Cylinder(0.05, 0.07)).spatial()


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    """A bag with a motion, measured heights and a model, in several chunks."""
    t = np.arange(0.0, 1.2, 0.002)
    swell = np.sin(np.pi * t / 1.2) ** 2
    acceleration = swell[:, None] * np.column_stack(
        [4.0 * np.sin(13.0 * t), 3.0 * np.cos(11.0 * t), 0.0 * t]
    )
    response, _ = simulate(MODEL, Inputs(t, acceleration))
    base = tmp_path_factory.mktemp("whole")
    one = base / "one_chunk"
    write_table_bag(one / "t.csv", MotionTable(t, acceleration, msh=response.msh), one)
    reader = BagReader(one)
    with BagWriter(base / "bag", custom=reader.metadata()) as writer:
        for topic, info in reader.topics().items():
            writer.add_topic(topic, info.message_type)
        for number, message in enumerate(reader.messages()):
            writer.write(message.topic, message.data, message.log_ns, message.publish_ns)
            if number % 150 == 149:
                writer.flush()
    (base / "model.yaml").write_text(format_model(MODEL))
    return base / "bag"


def replayed(folder, model, capsys):
    words = ["replay", str(folder), "--model", str(model), "--json", "--jobs", "1"]
    code = main(words)
    told = capsys.readouterr()
    lines = told.err.splitlines()
    assert all(line.startswith("slosh replay: ") for line in lines), lines
    if code == 2:
        assert len(lines) == 1, lines
        assert str(folder) in lines[0]
        return None, lines
    assert code == 0
    return json.loads(told.out), lines


def damaged(content, rng):
    """Truncates a file, or changes one byte, often near its beginning or end."""
    places = (
        rng.randrange(len(content)),
        rng.randrange(400),
        len(content) - rng.randrange(1, 900),
    )
    place = rng.choice(places) % len(content)
    if rng.random() < 0.4:
        return content[:place], f"cut at {place}"
    changed = bytearray(content)
    changed[place] ^= rng.randrange(1, 256)
    return bytes(changed), f"{place} changed"


@pytest.mark.parametrize("cases", [range(15), range(15, 60)], ids=["few", "many"])
@pytest.mark.first(1)
def test_damaged_bags_are_replayed_or_refused(bag, tmp_path, capsys, cases):
    whole, lines = replayed(bag, bag.parent / "model.yaml", capsys)
    assert whole is not None
    folder = tmp_path / "bag"
    shutil.copytree(bag, folder)
    (file,) = folder.glob("*.mcap")
    content = file.read_bytes()
    outcomes = []
    for case in cases:
        damage, what = damaged(content, random.Random(case))
        file.write_bytes(damage)
        found, told = replayed(folder, bag.parent / "model.yaml", capsys)
        if found is None:
            outcomes.append("refused")
            continue
        new = [line for line in told if line not in lines]
        outcomes.append("warned" if new else "same")
        assert new or found == whole, f"{case}: {what}"
    assert set(outcomes) >= {"refused", "warned"}


# `slosh recover` on the command line.


HEADER = "std_msgs/msg/Header"


@pytest.fixture
def cut(tmp_path):
    store = Definitions().typestore
    stamp = store.types["builtin_interfaces/msg/Time"](sec=1, nanosec=7)
    data = bytes(store.serialize_cdr(store.types[HEADER](stamp=stamp, frame_id="a"), HEADER))
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/header", HEADER)
        for number in range(30):
            writer.write("/header", data, number)
            if number % 10 == 9:
                writer.flush()
    file = tmp_path / "bag" / "bag_0.mcap"
    content = file.read_bytes()
    file.write_bytes(content[: len(content) * 30 // 100])
    return tmp_path / "bag"


def test_it_writes_a_bag_and_tells_what_is_lost(cut, tmp_path, capsys):
    assert main(["recover", str(cut), "-o", str(tmp_path / "new"), "--json"]) == 0
    told = capsys.readouterr()
    result = json.loads(told.out)
    messages = list(BagReader(tmp_path / "new").messages())
    assert result["messages"] == {"/header": len(messages)}
    assert 0 < len(messages) < 30
    assert result["notes"]
    assert f"slosh recover: {result['notes'][0]}" in told.err


def test_for_people_it_lists_the_topics(cut, tmp_path, capsys):
    assert main(["recover", str(cut), "-o", str(tmp_path / "new")]) == 0
    first, last = capsys.readouterr().out.strip().split("\n")
    assert first.split()[0] == "/header"
    assert last == str(tmp_path / "new")
