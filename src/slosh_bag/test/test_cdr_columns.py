"""Tests columns of many messages against rosbags and rclpy, bit by bit."""

import dataclasses
import math
import re
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.interfaces import Nodetype

from slosh_bag.columns.cdr_columns import columns, write_messages
from slosh_bag.columns.cdr_layout import layout_of
from slosh_bag.definitions import Definitions
from slosh_bag.errors import SloshBagError
from slosh_bag.mcap_files.chunks import MessageBlock

DEFINITIONS = Definitions()
STORE = DEFINITIONS.typestore
TYPES = [
    "slosh_msgs/msg/SloshEstimate",
    "slosh_msgs/msg/FreeSurface",
    "slosh_msgs/msg/SloshComparison",
    "slosh_msgs/msg/LimitEvent",
    "geometry_msgs/msg/AccelStamped",
    "geometry_msgs/msg/PoseStamped",
    "sensor_msgs/msg/Imu",
    "sensor_msgs/msg/CameraInfo",
    "sensor_msgs/msg/JointState",
    "diagnostic_msgs/msg/DiagnosticArray",
    "std_msgs/msg/Empty",
    "std_msgs/msg/ByteMultiArray",
]
for _name in TYPES:
    DEFINITIONS.hash(_name)

DTYPES = {"bool": "?", "byte": "i1", "char": "u1"}
TEXTS = ["", "a", "container", "Größe", "夜\u0000夜", "x" * 40]
SEEDS = st.integers(0, 2**63)


class Maker:
    """Generates messages with random bits, including all kinds of NaN."""

    def __init__(self, seed):
        self.random = np.random.default_rng(seed)

    def numbers(self, dtype, count):
        if dtype == "?":
            return self.random.integers(0, 2, count).astype(bool)
        array = np.frombuffer(self.random.bytes(count * np.dtype(dtype).itemsize), dtype)
        if np.dtype(dtype).kind == "f" and self.random.random() < 0.3:
            array = np.full(count, np.nan, dtype)
        return array

    def value(self, description):
        kind, what = description
        if kind == Nodetype.NAME:
            return self.message(what)
        if kind == Nodetype.BASE:
            if what[0] == "string":
                return TEXTS[self.random.integers(len(TEXTS))]
            array = self.numbers(DTYPES.get(what[0], what[0]), 1)
            if array.dtype == np.float32 and np.isnan(array).any():
                # A signalling NaN does not survive becoming a Python float.
                array = (array.view("u4") | 0x00400000).view("f4")
            return array[0].item()
        inner, count = what
        count = count if kind == Nodetype.ARRAY else int(self.random.integers(4))
        if inner[0] == Nodetype.BASE and inner[1][0] != "string":
            return self.numbers(DTYPES.get(inner[1][0], inner[1][0]), count)
        return [self.value(inner) for _ in range(count)]

    def message(self, name):
        fields = STORE.fielddefs[name][1]
        return STORE.types[name](**{field: self.value(kind) for field, kind in fields})


def serialised(name, message, little=True):
    return bytes(STORE.serialize_cdr(message, name, little_endian=little))


def block_of(name, data):
    """Returns a block whose messages lie at irregular positions in a buffer."""
    gaps = [b"\xa5" * (1 + index % 5) for index in range(len(data))]
    starts, at = [], 0
    for gap, part in zip(gaps, data, strict=True):
        starts.append(at + len(gap))
        at += len(gap) + len(part)
    buffer = b"".join(gap + part for gap, part in zip(gaps, data, strict=True))
    log = np.arange(len(data), dtype=np.int64)
    lengths = np.array([len(part) for part in data], np.int64)
    start = np.array(starts, np.int64)
    return MessageBlock("/t", name, log, log, start, lengths, np.frombuffer(buffer, np.uint8))


def flat(value, name=""):
    """Returns every scalar of a message by its dotted name."""
    if dataclasses.is_dataclass(value):
        for field, _ in STORE.fielddefs[value.__msgtype__][1]:
            yield from flat(getattr(value, field), f"{name}.{field}" if name else field)
    elif isinstance(value, list | np.ndarray):
        for index, element in enumerate(value):
            yield from flat(element, f"{name}[{index}]")
    else:
        yield name, value


def bits(value, column):
    """Returns a value's bits in the column's type, so that NaN can be compared."""
    if column.dtype == object:
        return value
    return quiet(np.asarray(value).astype(column.dtype, casting="unsafe")).tobytes()


def quiet(array):
    """Converts signalling NaN of float32 to quiet NaN, as a conversion to Python float does."""
    if array.dtype == np.float32:
        array = np.where(np.isnan(array), (array.view("u4") | 0x00400000).view("f4"), array)
    return array


def assert_same(found, decoded):
    found = {name: quiet(column) for name, column in found.items()}
    for row, message in enumerate(decoded):
        expected = dict(flat(message))
        for name, value in expected.items():
            got = found[name][row]
            column = found[name]
            assert (got if column.dtype == object else got.tobytes()) == bits(value, column), name
        for name in found.keys() - expected.keys():
            absent = found[name][row]
            assert absent is np.ma.masked or math.isnan(absent), name


@pytest.mark.first(8)
@pytest.mark.parametrize("name", TYPES)
@pytest.mark.parametrize("little", [True, False], ids=["little", "big"])
def test_columns_have_the_bits_that_rosbags_reads(name, little):
    @settings(max_examples=15, deadline=None, derandomize=True)
    @given(SEEDS, st.integers(1, 5), st.integers(1, 3))
    def check(seed, count, repeats):
        maker = Maker(seed)
        data = [serialised(name, maker.message(name), little) for _ in range(count)] * repeats
        decoded = [STORE.deserialize_cdr(part, name) for part in data]
        assert_same(columns(block_of(name, data), STORE), decoded)

    check()


@pytest.mark.parametrize("name", TYPES)
def test_written_messages_have_the_bytes_that_rosbags_writes(name):
    @settings(max_examples=15, deadline=None, derandomize=True)
    @given(SEEDS)
    def check(seed):
        maker = Maker(seed)
        template = serialised(name, maker.message(name))
        layout = layout_of(STORE, name, template)
        rows = np.tile(np.frombuffer(template, np.uint8), (3, 1))
        for leaf in layout.leaves.values():
            if leaf.kind not in ("string", "bool"):
                size = leaf.dtype.itemsize * (1 if leaf.count is None else leaf.count)
                noise = np.frombuffer(maker.random.bytes(3 * size), np.uint8)
                rows[:, leaf.offset : leaf.offset + size] = noise.reshape(3, size)
        block = block_of(name, [row.tobytes() for row in rows])
        read = {k: v for k, v in columns(block, STORE).items() if v.dtype != object}
        if read:
            assert np.array_equal(write_messages(layout, template, read), rows)
        again = [STORE.deserialize_cdr(row.tobytes(), name) for row in rows]
        assert_same(columns(block, STORE), again)

    check()


def estimates(lengths, stamp=5):
    """Returns estimates whose modal states have the given lengths."""
    kind = STORE.types["slosh_msgs/msg/ModelEstimate"]
    header = STORE.types["std_msgs/msg/Header"]
    time = STORE.types["builtin_interfaces/msg/Time"]
    made = []
    for count in lengths:
        state = np.arange(1.0, 1 + count)
        model = kind("L" * count, 1.5, 0.0, 0.0, 0.0, state, np.zeros(0))
        made.append(
            STORE.types["slosh_msgs/msg/SloshEstimate"](
                header=header(stamp=time(sec=stamp, nanosec=0), frame_id="c"),
                linear=model, nonlinear=model, acceleration=np.arange(3.0), jerk=0.0, yaw=0.0,
                surface_height=0.0, height_along_wall=0.0, contact_radius=0.0,
                distance_to_rim=0.0, distance_along_wall=0.0, flags=count, samples_used=0,
                samples_dropped=0,
            )
        )  # fmt: skip
    return [serialised("slosh_msgs/msg/SloshEstimate", message) for message in made]


ESTIMATE = "slosh_msgs/msg/SloshEstimate"


def test_wanted_columns_alone_and_arrays_whole():
    block = block_of(ESTIMATE, estimates([2, 2, 2]))
    found = columns(block, STORE, ["linear.modal_position", "acceleration[2]", "linear.model"])
    assert list(found) == ["linear.modal_position", "acceleration[2]", "linear.model"]
    assert found["linear.modal_position"].tolist() == [[1.0, 2.0]] * 3
    assert found["acceleration[2]"].tolist() == [2.0] * 3
    assert found["linear.model"].tolist() == ["LL"] * 3


def test_a_column_that_no_message_has_is_there_all_the_same():
    block = block_of(ESTIMATE, estimates([0, 0]))
    found = columns(block, STORE, ["linear.modal_position[4]", "flags"])
    assert np.isnan(found["linear.modal_position[4]"]).all()
    assert found["flags"].tolist() == [0, 0]


def test_missing_whole_numbers_are_masked_not_zero():
    name = "diagnostic_msgs/msg/DiagnosticArray"
    status = STORE.types["diagnostic_msgs/msg/DiagnosticStatus"]
    header = STORE.types["std_msgs/msg/Header"]
    time = STORE.types["builtin_interfaces/msg/Time"]

    def array(count):
        one = status(level=2, name="n", message="", hardware_id="", values=[])
        stamp = header(stamp=time(sec=0, nanosec=0), frame_id="")
        return serialised(name, STORE.types[name](header=stamp, status=[one] * count))

    level = columns(block_of(name, [array(1), array(2)]), STORE)["status[1].level"]
    assert level.tolist() == [None, 2]


@pytest.mark.parametrize(
    ("name", "match"),
    [
        (
            "linear.nowhere",
            "has no field 'linear.nowhere'; slosh_msgs/msg/ModelEstimate has model",
        ),
        ("header", "is no column"),
        ("jerk[0]", "jerk is one value"),
        ("jerk.x", "has no field"),
        ("acceleration[x]", "has no field"),
        ("acceleration[1", "has no field"),
        ("", "has no field"),
    ],
)
def test_a_column_that_the_type_cannot_have_is_refused(name, match):
    with pytest.raises(SloshBagError, match=re.escape(match)):
        columns(block_of(ESTIMATE, estimates([1])), STORE, [name])


@settings(max_examples=300, deadline=None, derandomize=True)
@given(st.sampled_from(TYPES), SEEDS)
def test_damaged_messages_are_refused_where_rosbags_refuses_them(name, seed):
    maker = Maker(seed)
    whole = bytearray(serialised(name, maker.message(name)))
    place = int(maker.random.integers(len(whole)))
    if maker.random.random() < 0.5:
        whole[place] ^= int(maker.random.integers(1, 256))
    else:
        del whole[place:]
    try:
        decoded = STORE.deserialize_cdr(bytes(whole), name)
    except Exception:  # whatever it is
        with pytest.raises(SloshBagError) as caught:
            columns(block_of(name, [bytes(whole)]), STORE)
        assert "\n" not in str(caught.value)
    else:
        assert_same(columns(block_of(name, [bytes(whole)]), STORE), [decoded])


def test_one_wrong_message_among_many_is_named():
    data = estimates([2] * 6)
    data[4] = data[4][:-9]
    with pytest.raises(SloshBagError, match=r"/t at 4 ns: no slosh_msgs/msg/SloshEstimate"):
        columns(block_of(ESTIMATE, data), STORE)


@pytest.mark.parametrize(
    ("values", "match"),
    [
        ({"flags": np.array([70000])}, "'flags': values that are no uint16"),
        ({"flags": np.array([-1])}, "'flags': values that are no uint16"),
        ({"flags": np.array([1.0])}, "'flags': values that are no uint16"),
        ({"jerk": np.array(["1"])}, "'jerk': values that are no float64"),
        ({"jerk": np.zeros((1, 3))}, "shape"),
        ({"acceleration": np.zeros(1)}, "shape"),
        ({"linear.model": np.array(["x"])}, "has no number 'linear.model'"),
        ({"linear.modal_position[2]": np.zeros(1)}, "has no number"),
        ({"jerk": np.zeros(1), "yaw": np.zeros(2)}, "rows"),
    ],
)
def test_what_does_not_fit_a_field_is_not_written(values, match):
    (template,) = estimates([2])
    layout = layout_of(STORE, ESTIMATE, template)
    with pytest.raises(SloshBagError, match=match):
        write_messages(layout, template, values)


def test_a_template_of_another_layout_is_refused():
    layout = layout_of(STORE, ESTIMATE, estimates([2])[0])
    with pytest.raises(SloshBagError, match="template"):
        write_messages(layout, estimates([1])[0], {"jerk": np.zeros(1)})


def test_a_sequence_that_says_to_be_endless_is_refused_at_once():
    data = bytearray(estimates([0])[0])
    layout = layout_of(STORE, ESTIMATE, bytes(data))
    for at in layout.fixed[2:].tolist():
        broken = bytearray(data)
        struct.pack_into("<I", broken, at & ~3, 0xFFFFFFF0)
        with pytest.raises(SloshBagError):
            columns(block_of(ESTIMATE, [bytes(broken)]), STORE)
