"""Tests that exported tables contain every value of the messages exactly."""

import csv
import json
import math
import struct
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from rosbags.typesys import get_types_from_msg

from slosh_bag.bag_writer import BagWriter
from slosh_bag.definitions import Definitions
from slosh_bag.errors import SloshBagError
from slosh_bag.interchange import export, export_rows
from slosh_bag.interchange.export import export_targets, export_topics
from slosh_bag.interchange.export_fields import leaves
from slosh_bag.reader import BagReader

KIND, PART = "odd_msgs/msg/Everything", "odd_msgs/msg/Part"
DEFINITION = """std_msgs/Header header
bool yes
int8 i8
uint8 u8
int16 i16
uint16 u16
int32 i32
uint32 u32
int64 i64
uint64 u64
float32 f32
float64 f64
string text
Part part
float64[3] three
bool[2] two
float32[] singles
int64[] numbers
uint8[] data
string[] texts
Part[] parts
float64 log_ns
"""
FLAT = "odd_msgs/msg/Flat"
"""The same without lists of texts and of messages: read many at a time."""
STORE = Definitions()
STORE.typestore.register(
    {
        **get_types_from_msg(DEFINITION, KIND),
        **get_types_from_msg(DEFINITION.replace("string[] texts\nPart[] parts\n", ""), FLAT),
        **get_types_from_msg("float64 x\nint16[] n\n", PART),
    }
)
TYPES = STORE.typestore.types
DOUBLES = st.floats(width=64)
TEXTS = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=8)


def whole(bits: int, *, signed: bool):
    low = -(2 ** (bits - 1)) if signed else 0
    return st.integers(low, low + 2**bits - 1)


@st.composite
def parts(draw):
    numbers = draw(arrays(np.int16, st.integers(0, 3)))
    return TYPES[PART](x=draw(DOUBLES), n=numbers)


@st.composite
def everything(draw, kind: str):
    time = TYPES["builtin_interfaces/msg/Time"](draw(whole(32, signed=True)), 999_999_999)
    integers = {
        f"{'i' if signed else 'u'}{bits}": draw(whole(bits, signed=signed))
        for bits in (8, 16, 32, 64)
        for signed in (True, False)
    }
    lists = {}
    if kind == KIND:
        lists["texts"] = draw(st.lists(TEXTS, max_size=2))
        lists["parts"] = draw(st.lists(parts(), max_size=2))
    return TYPES[kind](
        header=TYPES["std_msgs/msg/Header"](time, draw(TEXTS)),
        yes=draw(st.booleans()),
        f32=draw(st.floats(width=32)),
        f64=draw(DOUBLES),
        text=draw(TEXTS),
        part=draw(parts()),
        three=draw(arrays(np.float64, 3)),
        two=draw(arrays(np.bool_, 2)),
        singles=draw(arrays(np.float32, st.integers(0, 4))),
        numbers=draw(arrays(np.int64, st.integers(0, 4))),
        data=draw(arrays(np.uint8, st.integers(0, 4))),
        log_ns=draw(DOUBLES),
        **lists,
        **integers,
    )


def write(folder: Path, messages, topic: str = "/odd", kind: str = KIND) -> BagReader:
    with BagWriter(folder, STORE) as writer:
        writer.add_topic(topic, kind)
        for k, message in enumerate(messages):
            data = bytes(STORE.typestore.serialize_cdr(message, kind))
            writer.write(topic, data, 2**60 + k, 2**61 + k)
    return BagReader(folder)


def same(one, other) -> bool:
    """Returns whether two values are equal; all NaN count as equal."""
    if isinstance(one, float):
        return (math.isnan(one) and math.isnan(other)) or struct.pack("d", one) == struct.pack(
            "d", other
        )
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(same(one[key], other[key]) for key in one)
    if isinstance(one, list):
        return len(one) == len(other) and all(map(same, one, other))
    return type(one) is type(other) and one == other


def part(value) -> dict:
    return {"x": value.x, "n": value.n.tolist()}


def expected(k: int, m, kind: str) -> dict:
    """Returns a message as a flat table row."""
    stamp = m.header.stamp.sec * 10**9 + m.header.stamp.nanosec
    base = ("yes", "i8", "u8", "i16", "u16", "i32", "u32", "i64", "u64", "f32", "f64", "text")
    lists = {"texts": m.texts, "parts": [part(p) for p in m.parts]} if kind == KIND else {}
    return {
        "log_ns_": 2**60 + k,
        "publish_ns": 2**61 + k,
        "stamp_ns": stamp,
        "header.stamp.sec": m.header.stamp.sec,
        "header.stamp.nanosec": m.header.stamp.nanosec,
        "header.frame_id": m.header.frame_id,
        **{name: getattr(m, name) for name in base},
        "part.x": m.part.x,
        "part.n": m.part.n.tolist(),
        **{f"three[{i}]": float(m.three[i]) for i in range(3)},
        **{f"two[{i}]": bool(m.two[i]) for i in range(2)},
        "singles": m.singles.tolist(),
        "numbers": m.numbers.tolist(),
        "data": m.data.tolist(),
        **lists,
        "log_ns": m.log_ns,
    }


def parsed(text: str, like):
    """Parses a CSV cell to the type of the expected value."""
    if isinstance(like, bool):
        return {"true": True, "false": False}[text]
    if isinstance(like, list):
        return json.loads(text)
    if isinstance(like, str) and like.lstrip("\t\r\n").startswith(("=", "+", "-", "@")):
        text = text.removeprefix("'")  # see test_no_text_is_a_formula
    return type(like)(text)


def exported(reader: BagReader, path: Path):
    targets = export_targets(reader.path, reader, [], path)
    return export_topics(reader, targets)


@pytest.mark.first(1)
@pytest.mark.parametrize("kind", [KIND, FLAT])
@settings(deadline=None, max_examples=25)
@given(data=st.data())
def test_csv_and_parquet_hold_every_value_to_the_bit(kind, data):
    # The same message twice: some are read together, some one by one.
    messages = data.draw(st.lists(everything(kind), min_size=1, max_size=4))
    messages += messages[:2]
    alike = data.draw(st.sampled_from([0, export_rows.FEWEST_ALIKE]))
    with TemporaryDirectory() as name, pytest.MonkeyPatch.context() as patch:
        patch.setattr(export_rows, "FEWEST_ALIKE", alike)
        folder = Path(name)
        reader = write(folder / "bag", messages, kind=kind)
        rows = [expected(k, message, kind) for k, message in enumerate(messages)]
        exported(reader, folder / "a.parquet")
        for want, got in zip(rows, pq.read_table(folder / "a.parquet").to_pylist(), strict=True):
            assert same(want, {**got, "data": list(got["data"])})
        exported(reader, folder / "a.csv")
        with (folder / "a.csv").open(newline="", encoding="utf-8") as file:
            for want, got in zip(rows, csv.DictReader(file), strict=True):
                assert list(want) == list(got)
                assert same(want, {name: parsed(got[name], value) for name, value in want.items()})


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_rows_come_in_the_order_of_their_times(tmp_path: Path, suffix: str, monkeypatch):
    monkeypatch.setattr(export, "BATCH_ROWS", 2)
    kind = "std_msgs/msg/String"
    with BagWriter(tmp_path / "bag", STORE) as writer:
        writer.add_topic("/words", kind)
        for time in (5, 6, 7, 1, 2, 8):
            message = TYPES[kind](str(time))
            writer.write("/words", bytes(STORE.typestore.serialize_cdr(message, kind)), time)
            writer.flush()
    exported(BagReader(tmp_path / "bag"), tmp_path / f"a.{suffix}")
    if suffix == "csv":
        with (tmp_path / "a.csv").open(newline="") as file:
            words = [row["data"] for row in csv.DictReader(file)]
    else:
        words = pq.read_table(tmp_path / "a.parquet").column("data").to_pylist()
    assert words == ["1", "2", "5", "6", "7", "8"]


def image(size: int):
    header = TYPES["std_msgs/msg/Header"](TYPES["builtin_interfaces/msg/Time"](1, 2), "camera")
    return TYPES["sensor_msgs/msg/Image"](
        header, 1, size, "mono8", 0, size, np.arange(size, dtype=np.uint8)
    )


def test_images_are_bytes_in_parquet_and_left_out_of_csv(tmp_path: Path):
    messages = [image(size) for size in (3, 200, 5000)]
    reader = write(tmp_path / "bag", messages, kind="sensor_msgs/msg/Image")
    exported(reader, tmp_path / "a.parquet")
    data = pq.read_table(tmp_path / "a.parquet").column("data").to_pylist()
    assert data == [message.data.tobytes() for message in messages]
    told = exported(reader, tmp_path / "a.csv")
    with (tmp_path / "a.csv").open(newline="") as file:
        cells = [row["data"] for row in csv.DictReader(file)]
    assert cells == ["[0, 1, 2]", json.dumps(list(range(200))), ""]
    (note,) = told.notes
    assert "1 cells of data are empty: more than 1024 bytes" in note


def test_a_folder_gets_a_file_for_each_topic(tmp_path: Path):
    with BagWriter(tmp_path / "bag", STORE) as writer:
        for topic in ("/a/b_c", "/a_b/c"):
            writer.add_topic(topic, "std_msgs/msg/String")
            message = TYPES["std_msgs/msg/String"](topic)
            data = STORE.typestore.serialize_cdr(message, "std_msgs/msg/String")
            writer.write(topic, bytes(data), 1)
        writer.add_topic("/silent", "std_msgs/msg/String")
    reader = BagReader(tmp_path / "bag")
    targets = export_targets(reader.path, reader, [], tmp_path / "out", "csv")
    told = export_topics(reader, targets)
    assert {path.name: rows for path, rows in told.rows.items()} == {
        "a.b_c.csv": 1, "a_b.c.csv": 1, "silent.csv": 0,
    }  # fmt: skip
    assert (tmp_path / "out" / "silent.csv").read_text() == "log_ns,publish_ns,data\n"
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == sorted(
        path.name for path in told.rows
    )


@pytest.mark.parametrize("text", ["\r", "a\rb", "\n", "\r\n", '"', ",", "", "ä", "nan"])
def test_no_text_breaks_a_row(tmp_path: Path, text: str):
    words = [TYPES["std_msgs/msg/String"](word) for word in ("before", text, "after")]
    exported(write(tmp_path / "bag", words, kind="std_msgs/msg/String"), tmp_path / "a.csv")
    with (tmp_path / "a.csv").open(newline="", encoding="utf-8") as file:
        assert [row["data"] for row in csv.DictReader(file)] == ["before", text, "after"]


@pytest.mark.parametrize(
    ("text", "cell"),
    [
        ('=HYPERLINK("http://x")', '\'=HYPERLINK("http://x")'),
        ("+cmd|' /C calc'!A0", "'+cmd|' /C calc'!A0"),
        ("-2+3", "'-2+3"),
        ("@SUM(1)", "'@SUM(1)"),
        ("\t=1", "'\t=1"),
        ("-2.5e3", "-2.5e3"),
        ("+7", "+7"),
        ("-", "-"),
        ("a=1", "a=1"),
    ],
)
def test_no_text_is_a_formula(tmp_path: Path, text: str, cell: str):
    bag = write(tmp_path / "bag", [TYPES["std_msgs/msg/String"](text)], kind="std_msgs/msg/String")
    paths = [tmp_path / "a.csv", tmp_path / "a.parquet"]
    told = [export_topics(bag, export_targets(bag.path, bag, [], path)).notes for path in paths]
    with paths[0].open(newline="", encoding="utf-8") as file:
        assert [row["data"] for row in csv.DictReader(file)] == [cell]
    assert pq.read_table(paths[1])["data"].to_pylist() == [text]
    assert [any("formula" in note for note in notes) for notes in told] == [cell != text, False]


@pytest.fixture
def strings(tmp_path: Path) -> BagReader:
    messages = [TYPES["std_msgs/msg/String"]("x")] * 3
    return write(tmp_path / "bag", messages, "/a/words", "std_msgs/msg/String")


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_a_damaged_bag_leaves_no_file(strings: BagReader, tmp_path: Path, suffix: str):
    with BagWriter(tmp_path / "damaged", STORE) as writer:
        writer.add_topic("/words", "std_msgs/msg/String")
        good = STORE.typestore.serialize_cdr(
            TYPES["std_msgs/msg/String"]("x"), "std_msgs/msg/String"
        )
        writer.write("/words", bytes(good), 1)
        writer.write("/words", b"\0\1\0\0\xff\xff\xff\x7f", 2)
    reader = BagReader(tmp_path / "damaged")
    with pytest.raises(SloshBagError, match="/words") as caught:
        exported(reader, tmp_path / "out" / f"a.{suffix}")
    assert "\n" not in str(caught.value)
    assert list((tmp_path / "out").iterdir()) == []


def test_without_pyarrow_csv_works_and_parquet_says_what_to_install(
    strings: BagReader, tmp_path: Path, monkeypatch
):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(SloshBagError, match="pip install pyarrow"):
        exported(strings, tmp_path / "a.parquet")
    assert exported(strings, tmp_path / "a.csv").rows == {tmp_path / "a.csv": 3}


def test_an_estimate_has_the_columns_that_the_documentation_names():
    STORE.hash("slosh_msgs/msg/SloshEstimate")
    names = [
        name
        for leaf in leaves(STORE.typestore, "slosh_msgs/msg/SloshEstimate")
        for name in leaf.columns
    ]
    assert {"linear.msh", "nonlinear.modal_position", "acceleration[2]"} <= set(names)
