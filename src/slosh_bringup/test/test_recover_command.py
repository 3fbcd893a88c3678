"""`slosh recover` on the command line."""

import json

import pytest

from slosh_bag.bag_writer import BagWriter
from slosh_bag.definitions import Definitions
from slosh_bag.reader import BagReader
from slosh_bringup.cli.main import main

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


@pytest.mark.parametrize("what", ["nothing", "existing"])
def test_wrong_input_is_one_line_and_exit_code_2(cut, tmp_path, capsys, what):
    words = {
        "nothing": ["recover", str(tmp_path / "none"), "-o", str(tmp_path / "new")],
        "existing": ["recover", str(cut), "-o", str(cut)],
    }[what]
    assert main(words) == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if "slosh" in line]
    assert len(lines) == 1
    assert lines[0].startswith("slosh recover: ")
