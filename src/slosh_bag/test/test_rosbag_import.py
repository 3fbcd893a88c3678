"""Tests that other programs' bags are imported exactly, with notes about the rest."""

import math
import sqlite3
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.writer import Writer as McapWriter
from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag1 import Reader as Ros1Reader
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from slosh_bag.errors import SloshBagError
from slosh_bag.interchange.rosbag_import import find_rosbags, import_rosbag
from slosh_bag.reader import BagReader

ROS1 = get_typestore(Stores.ROS1_NOETIC)
ROS2 = get_typestore(Stores.ROS2_HUMBLE)
MIXED = "Header header\nfloat64 value\nstring[] names\nuint64 big\ntime when\nbool[3] three\n"
ROS1.register(get_types_from_msg(MIXED, "odd_msgs/msg/Mixed"))
ACCEL, MIXED_TYPE = "geometry_msgs/msg/AccelStamped", "odd_msgs/msg/Mixed"
VALUES = [0.1, -0.0, math.nan, math.inf, 5e-324, 1.7976931348623157e308]


def header(store, k: int, **more):
    time = store.types["builtin_interfaces/msg/Time"](sec=7, nanosec=k)
    return store.types["std_msgs/msg/Header"](stamp=time, frame_id="world", **more)


def accel(store, k: int, x: float, **more):
    vector = store.types["geometry_msgs/msg/Vector3"]
    both = store.types["geometry_msgs/msg/Accel"](vector(x, 0.0, 0.0), vector(0.0, 0.0, 0.0))
    return store.types[ACCEL](header(store, k, **more), both)


def mixed(k: int, value: float):
    return ROS1.types[MIXED_TYPE](
        header=header(ROS1, k, seq=k),
        value=value,
        names=["ä", ""],
        big=2**64 - 1 - k,
        when=ROS1.types["builtin_interfaces/msg/Time"](sec=3, nanosec=4),
        three=np.array([True, False, True]),
    )


@pytest.fixture
def ros1(tmp_path: Path) -> Path:
    path = tmp_path / "old.bag"
    writer = Ros1Writer(path)
    writer.set_compression(Ros1Writer.CompressionFormat.BZ2)
    with writer:
        moved = writer.add_connection("/arm/accel", ACCEL, typestore=ROS1)
        other = writer.add_connection("mixed", MIXED_TYPE, typestore=ROS1, latching=1)
        writer.add_connection("/silent", "std_msgs/msg/String", typestore=ROS1)
        broken = writer.add_connection(
            "/broken", "bad_msgs/msg/Bad", msgdef="float99 x\n", md5sum="0" * 32
        )
        for k, x in enumerate(VALUES):
            data = ROS1.serialize_ros1(accel(ROS1, k, x, seq=k), ACCEL)
            writer.write(moved, 10**18 + k, data)
            writer.write(other, 10**18 + k, ROS1.serialize_ros1(mixed(k, x), MIXED_TYPE))
            writer.write(broken, 10**18 + k, b"1234")
    return path


def write_ros2(folder: Path, plugin=StoragePlugin.SQLITE3, compression=None, version=8) -> Path:
    qos = Qos(
        QosHistory.KEEP_LAST, 5, QosReliability.BEST_EFFORT, QosDurability.TRANSIENT_LOCAL,
        QosTime(0, 0), QosTime(0, 0), QosLiveliness.AUTOMATIC, QosTime(0, 0), False,
    )  # fmt: skip
    writer = Ros2Writer(folder, version=version, storage_plugin=plugin)
    if compression:
        writer.set_compression(compression, CompressionFormat.ZSTD)
    writer.set_custom_data("clocks", "unrelated")
    with writer:
        topic = writer.add_connection(
            "/arm/accel", ACCEL, typestore=ROS2, offered_qos_profiles=[qos]
        )
        for k, x in enumerate(VALUES):
            writer.write(topic, 10**18 + k, ROS2.serialize_cdr(accel(ROS2, k, x), ACCEL))
    return folder


def bits(value: float) -> bytes:
    return np.float64(value).tobytes()


def accelerations(bag: Path, topic: str) -> list[bytes]:
    reader = BagReader(bag)
    return [bits(reader.decode(m).accel.linear.x) for m in reader.messages([topic])]


def test_ros1_values_come_bit_for_bit(ros1: Path, tmp_path: Path):
    told = import_rosbag(ros1, tmp_path / "new", rename={"/arm/accel": "/slosh/accel"})
    assert told.counts == {"/slosh/accel": 6, "/mixed": 6, "/silent": 0}
    assert accelerations(told.bag, "/slosh/accel") == [bits(x) for x in VALUES]
    reader = BagReader(told.bag)
    messages = list(reader.messages(["/mixed"]))
    assert [message.log_ns for message in messages] == [10**18 + k for k in range(6)]
    for k, message in enumerate(reader.decode(m) for m in messages):
        assert bits(message.value) == bits(VALUES[k])
        assert (message.names, message.big) == (["ä", ""], 2**64 - 1 - k)
        assert (message.when.sec, message.when.nanosec) == (3, 4)
        assert message.three.tolist() == [True, False, True]
        assert (message.header.stamp.nanosec, message.header.frame_id) == (k, "world")
        assert not hasattr(message.header, "seq")


def test_what_cannot_be_converted_costs_its_topic_alone(ros1: Path, tmp_path: Path):
    (note,) = import_rosbag(ros1, tmp_path / "new").notes
    assert note.startswith("/broken: left out: the definition of bad_msgs/msg/Bad")
    with pytest.raises(SloshBagError, match="no topic that can be converted; /broken: left out"):
        import_rosbag(ros1, tmp_path / "none", topics=["/broken"])
    with pytest.raises(SloshBagError, match="holds no message that can be converted"):
        import_rosbag(ros1, tmp_path / "none", topics=["silent"])
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize(
    ("plugin", "compression"),
    [
        (StoragePlugin.SQLITE3, None),
        (StoragePlugin.SQLITE3, CompressionMode.FILE),
        (StoragePlugin.SQLITE3, CompressionMode.MESSAGE),
        (StoragePlugin.MCAP, None),
    ],
)
def test_rosbag2_values_come_bit_for_bit(tmp_path: Path, plugin, compression):
    source = write_ros2(tmp_path / "rosbag2", plugin, compression)
    told = import_rosbag(source, tmp_path / "new")
    assert accelerations(told.bag, "/arm/accel") == [bits(x) for x in VALUES]
    assert BagReader(told.bag).metadata()["clocks"] == "unrelated"
    information = yaml.safe_load((told.bag / "metadata.yaml").read_text())
    (topic,) = information["rosbag2_bagfile_information"]["topics_with_message_count"]
    (qos,) = topic["topic_metadata"]["offered_qos_profiles"]
    assert (qos["reliability"], qos["durability"], qos["depth"]) == (
        "best_effort", "transient_local", 5,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("text", "fields", "y", "notes"),
    [
        (
            "float64 z\nfloat64 x\nint16 extra\n",
            {"z": 3.0, "x": 1.0, "extra": 9},
            0.0,
            (
                "/point: converted to the definition of geometry_msgs/msg/Point here, without "
                "extra; with new y",
            ),
        ),
        ("float64 z\nfloat64 y\nfloat64 x\n", {"z": 3.0, "y": 2.0, "x": 1.0}, 2.0, None),
    ],
    ids=["other fields", "another order"],
)
def test_a_known_type_of_another_definition_is_converted(tmp_path: Path, text, fields, y, notes):
    store, kind = get_typestore(Stores.EMPTY), "geometry_msgs/msg/Point"
    store.register(get_types_from_msg(text, "geometry_msgs/Point"))
    path = tmp_path / "changed.bag"
    with Ros1Writer(path) as writer:
        topic = writer.add_connection("/point", kind, typestore=store)
        writer.write(topic, 5, store.serialize_ros1(store.types[kind](**fields), kind))
    told = import_rosbag(path, tmp_path / "new")
    reader = BagReader(told.bag)
    (message,) = [reader.decode(m) for m in reader.messages()]
    assert (message.x, message.y, message.z) == (1.0, y, 3.0)
    assert notes is None or told.notes == notes


def test_installed_types_come_without_a_definition_in_the_file(tmp_path: Path):
    """SQLite files written by rosbag2 before ROS 2 Iron contain no message definitions."""
    folder = write_ros2(tmp_path / "rosbag2")
    (file,) = folder.glob("*.db3")
    with sqlite3.connect(file) as database:
        database.execute("DELETE FROM message_definitions")
    told = import_rosbag(folder, tmp_path / "new")
    assert accelerations(told.bag, "/arm/accel") == [bits(x) for x in VALUES]


def test_names_are_checked(ros1: Path, tmp_path: Path):
    for wanted, expected in (
        ({"topics": ["/arm/acel"]}, "no topic '/arm/acel'; its topics: /arm/accel,"),
        ({"rename": {"/arm/acel": "/x"}}, "no topic '/arm/acel'; its topics: /arm/accel,"),
        ({"rename": {"/arm/accel": "x y"}}, "'x y' is not a topic name"),
        ({"rename": {"/arm/accel": "/silent"}}, "/arm/accel and /silent would both become"),
    ):
        with pytest.raises(SloshBagError, match=expected) as caught:
            import_rosbag(ros1, tmp_path / "new", **wanted)
        assert "\n" not in str(caught.value)
    assert not (tmp_path / "new").exists()


def test_what_is_no_bag_is_named(tmp_path: Path):
    (tmp_path / "empty").mkdir()
    (tmp_path / "text.bag").write_text("hello")
    (tmp_path / "text.db3").write_text("hello")
    (tmp_path / "text.txt").write_text("hello")
    folder = write_ros2(tmp_path / "rosbag2")
    (folder / "metadata.yaml").write_text("{")
    for path, expected in (
        (tmp_path / "nothing", "no such file"),
        (tmp_path / "empty", "holds no metadata.yaml"),
        (tmp_path / "text.txt", "is not one of .bag"),
        (tmp_path / "text.bag", "is not a ROS 1 bag"),
        (tmp_path / "text.db3", "is not an SQLite file: it is a text file"),
        (folder, "cannot be read: Could not load YAML"),
    ):
        with pytest.raises(SloshBagError, match=expected) as caught:
            import_rosbag(find_rosbags(path)[0], tmp_path / "new")
        assert "\n" not in str(caught.value)
        assert str(caught.value).startswith(str(path))


def total(told) -> int:
    return sum(told.counts.values())


def test_what_sqlites_log_holds_is_taken_in(tmp_path: Path):
    """A killed recorder leaves messages in the -wal file that are not in the .db3 file yet."""
    whole = next(write_ros2(tmp_path / "rosbag2").glob("*.db3"))
    count = total(import_rosbag(whole, tmp_path / "whole"))
    folder, live = tmp_path / "killed", sqlite3.connect(whole)
    folder.mkdir()
    live.execute("pragma journal_mode=wal")
    live.execute("pragma wal_autocheckpoint=0")
    rows = live.execute("select topic_id, timestamp + 1, data from messages").fetchall()
    live.executemany("insert into messages (topic_id, timestamp, data) values (?, ?, ?)", rows)
    live.commit()
    for end in ("", "-wal"):
        (folder / f"a.db3{end}").write_bytes(Path(f"{whole}{end}").read_bytes())
    live.close()
    before = [file.read_bytes() for file in sorted(folder.iterdir())]
    told = import_rosbag(folder / "a.db3", tmp_path / "new")
    assert total(told) == 2 * count
    assert told.lost == ()
    assert any("data in a.db3-wal are included" in note for note in told.notes)
    assert [file.read_bytes() for file in sorted(folder.iterdir())] == before


def edited(folder: Path, change) -> Path:
    path = folder / "metadata.yaml"
    document = yaml.safe_load(path.read_text())
    change(document["rosbag2_bagfile_information"])
    path.write_text(yaml.safe_dump(document))
    return folder


def other_qos(information) -> None:
    for topic in information["topics_with_message_count"]:
        noted = {"reliability": "best_effort", "durability": "volatile", "history": "keep_last"}
        topic["topic_metadata"]["offered_qos_profiles"] = [noted]  # without the other keys


def no_storage(information) -> None:
    information["storage_identifier"] = ""


def no_topics(information) -> None:
    information["topics_with_message_count"] = []


@pytest.mark.parametrize("plugin", [StoragePlugin.SQLITE3, StoragePlugin.MCAP])
@pytest.mark.parametrize("change", [other_qos, no_storage, no_topics])
def test_messages_come_whatever_metadata_says_of_them(tmp_path: Path, plugin, change):
    """Covers edited QoS (rosbag2#656), a re-indexed bag (rosbag2#2175) and missing topics."""
    folder = write_ros2(tmp_path / "rosbag2", plugin)
    count = total(import_rosbag(folder, tmp_path / "before"))
    told = import_rosbag(edited(folder, change), tmp_path / "after")
    assert (total(told), told.lost) == (count, ())


def test_fewer_messages_than_the_bag_counts_are_told(tmp_path: Path):
    folder = write_ros2(tmp_path / "rosbag2")
    (folder / "rosbag2_1.db3").write_bytes(next(folder.glob("*.db3")).read_bytes())

    def more(information) -> None:
        information["topics_with_message_count"][0]["message_count"] += 1000

    told = import_rosbag(edited(folder, more), tmp_path / "new")
    short, beside = told.lost
    (topic, count), *_ = told.counts.items()
    assert short == f"{topic}: {count} of {count + 1000} messages imported"
    assert "does not list them: rosbag2_1.db3" in beside


def test_ros1_messages_in_an_mcap_file_come_bit_for_bit(ros1: Path, tmp_path: Path):
    """In files written by `mcap convert`, profile, schema and messages are those of ROS 1."""
    with Ros1Reader(ros1) as reader, (tmp_path / "a.mcap").open("wb") as stream:
        writer = McapWriter(stream)
        writer.start("ros1")
        channels = {}
        for each in reader.connections:
            name = each.msgtype.replace("/msg/", "/")
            schema = writer.register_schema(name, "ros1msg", each.msgdef.data.encode())
            channels[each.id] = writer.register_channel(each.topic, "ros1", schema)
        for connection, stamp, data in reader.messages():
            writer.add_message(channels[connection.id], stamp, bytes(data), stamp)
        writer.finish()
    told = [
        import_rosbag(path, tmp_path / name)
        for path, name in ((ros1, "one"), (tmp_path / "a.mcap", "two"))
    ]
    assert told[0].counts == told[1].counts
    assert total(told[1]) > 0
    one, two = (
        [message.data for message in BagReader(tmp_path / name).messages()]
        for name in ("one", "two")
    )
    assert one == two


def test_messages_of_other_encodings_are_left_out_in_one_line(tmp_path: Path):
    with (tmp_path / "a.mcap").open("wb") as stream:
        writer = McapWriter(stream)
        writer.start("")
        schema = writer.register_schema("lab.Pose", "protobuf", b"\xff")
        channel = writer.register_channel("/pose", "protobuf", schema)
        writer.add_message(channel, 1, b"x", 1)
        writer.finish()
    with pytest.raises(SloshBagError, match="/pose: left out: messages in 'protobuf': only"):
        import_rosbag(tmp_path / "a.mcap", tmp_path / "new")


def test_a_folder_of_ros1_bags_is_all_of_them(ros1: Path, tmp_path: Path):
    (tmp_path / "second.bag").write_bytes(ros1.read_bytes())
    assert find_rosbags(tmp_path) == [ros1, tmp_path / "second.bag"]


@settings(max_examples=25, deadline=None)
@given(share=st.floats(0.0, 0.999), flip=st.integers(1, 255), cut=st.booleans())
def test_a_damaged_file_gives_a_bag_or_one_line(tmp_path_factory, share, flip, cut):
    folder = tmp_path_factory.mktemp("damaged")
    path = folder / "damaged.bag"
    with Ros1Writer(path) as writer:
        topic = writer.add_connection("/arm/accel", ACCEL, typestore=ROS1)
        for k, x in enumerate(VALUES):
            writer.write(topic, k + 1, ROS1.serialize_ros1(accel(ROS1, k, x, seq=k), ACCEL))
    content = bytearray(path.read_bytes())
    place = int(share * len(content))
    content[place] ^= flip
    path.write_bytes(content[:place] if cut else content)
    try:
        import_rosbag(path, folder / "new")
    except SloshBagError as error:
        assert "\n" not in str(error)
        assert not (folder / "new").exists()
    else:
        list(BagReader(folder / "new").messages())


def test_the_reader_says_what_to_do_with_a_foreign_bag(ros1: Path, tmp_path: Path):
    folder = write_ros2(tmp_path / "rosbag2")
    for path in (ros1, folder, *folder.glob("*.db3")):
        with pytest.raises(SloshBagError, match=r"convert it with slosh import rosbag"):
            BagReader(path)
