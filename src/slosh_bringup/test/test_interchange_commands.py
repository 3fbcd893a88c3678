"""Tests `slosh import` and `slosh export` of tables and of other programs' bags."""

import csv
import json
import re
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from slosh_bag.definitions import find_interfaces
from slosh_bag.reader import BagReader
from slosh_bringup.cli.main import main
from slosh_bringup.processes import config_folder
from slosh_motion.tables.motion_table import MotionTable, read_motion_table, write_motion_table
from slosh_testing.commands import complaint

MODEL = str(config_folder() / "model.yaml")


def run(*words: object) -> None:
    assert main([str(word) for word in words]) == 0


def heights(path: Path) -> np.ndarray:
    return np.genfromtxt(path, delimiter=",", names=True)["msh"]


@pytest.fixture
def table(tmp_path: Path) -> Path:
    """A motion with modelled liquid heights at the times of camera images."""
    t = np.arange(1500) / 500
    ay = 3.0 * np.sin(9.0 * t) * np.sin(np.pi * t / 3.0) ** 2
    motion = MotionTable(t, np.column_stack([0.3 * ay, ay, 0.1 * ay]))
    path = tmp_path / "run.csv"
    write_motion_table(path, motion)
    run("simulate", MODEL, path, "-o", tmp_path / "model.csv")
    seen = np.where(np.arange(1500) % 8, np.nan, heights(tmp_path / "model.csv"))
    write_motion_table(path, MotionTable(t, motion.acceleration, msh=seen))
    return path


@pytest.fixture
def bag(table: Path, tmp_path: Path) -> Path:
    run("import", "table", table, "-o", tmp_path / "bags")
    return tmp_path / "bags" / "run"


def test_a_table_comes_back_as_the_same_file(table: Path, bag: Path, tmp_path: Path, capsys):
    run("export", bag, "--motion", "-o", tmp_path / "back.csv")
    assert (tmp_path / "back.csv").read_bytes() == table.read_bytes()
    assert (
        "1500 rows from /slosh/accel, heights from /slosh/free_surface" in capsys.readouterr().out
    )


def test_replay_and_simulate_agree_on_a_bag_and_its_table(bag: Path, tmp_path: Path, capsys):
    run("export", bag, "--motion", "-o", tmp_path / "back.csv")
    run("simulate", MODEL, tmp_path / "back.csv", "-o", tmp_path / "again.csv")
    assert np.array_equal(heights(tmp_path / "again.csv"), heights(tmp_path / "model.csv"))
    capsys.readouterr()
    run("replay", bag, "--model", MODEL, "--json")
    text = capsys.readouterr().out
    # The measured heights are simulate's: replay's own differ from them by rounding alone.
    errors = {row["name"]: row["rms"] for row in rows_of(json.loads(text))}
    assert errors["3D-NL"] < 1e-9
    assert errors["3D-L"] > 1e-4


def rows_of(document):
    """Returns all objects with a name and an rms anywhere in a JSON document."""
    found = []
    if isinstance(document, dict):
        if "name" in document and "rms" in document:
            found.append(document)
        document = list(document.values())
    if isinstance(document, list):
        for entry in document:
            found += rows_of(entry)
    return found


def test_topics_are_listed(bag: Path, capsys):
    capsys.readouterr()
    run("export", bag, "--list", "--json")
    entries = json.loads(capsys.readouterr().out)
    assert [(entry["topic"], entry["messages"]) for entry in entries] == [
        ("/slosh/accel", 1500),
        ("/slosh/free_surface", 188),
    ]
    run("export", bag, "--list")
    assert "geometry_msgs/msg/AccelStamped" in capsys.readouterr().out


def test_a_topic_becomes_a_table(bag: Path, table: Path, tmp_path: Path):
    run("export", bag, "--topic", "accel", "-o", tmp_path / "accel.csv")
    with (tmp_path / "accel.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    want = read_motion_table(table).acceleration
    got = [[float(row[f"accel.linear.{axis}"]) for axis in "xyz"] for row in rows]
    assert np.array_equal(got, want)
    assert rows[1]["stamp_ns"] == str(10**9 + 2_000_000)


def test_what_export_cannot_do_is_one_line(bag: Path, tmp_path: Path, capsys):
    (tmp_path / "there.csv").write_text("precious")
    before = set(tmp_path.iterdir())
    out = tmp_path / "out.csv"
    for words, expected in (
        (
            ["--topic", "acel", "-o", out],
            "no topic 'acel'; its topics: /slosh/accel, /slosh/free",
        ),
        (["-o", out], "one file cannot hold 2 topics; give a folder, or one of /slosh/accel"),
        ([], "-o is missing: give"),
        (
            ["--motion", "-o", tmp_path / "m.parquet"],
            "a motion table must be named .csv or .csv.gz",
        ),
        (["--motion", "-o", tmp_path / "there.csv"], "there.csv: exists already"),
        (["--motion", "--measured", "truth", "-o", out], "no topic 'truth'"),
        (["--motion", "--input", "pose", "-o", out], "holds no message of pose"),
        (["--topic", "accel", "-o", tmp_path / "there.csv" / "x.csv"], "there.csv"),
        (["-o", tmp_path / "e.xls"], "e.xls: a table must end in .csv, .csv.gz, .parquet;"),
    ):
        assert expected in complaint(capsys, "export", bag, *words)
    assert "no such file" in complaint(capsys, "export", tmp_path / "none", "--list")
    assert (tmp_path / "there.csv").read_text() == "precious"
    assert set(tmp_path.iterdir()) == before


def test_what_import_cannot_do_is_one_line(table: Path, bag: Path, tmp_path: Path, capsys):
    (tmp_path / "junk.bag").write_bytes(bytes(range(255, 0, -1)))
    (cut,) = (tmp_path / "bags" / "run").glob("*.mcap")
    (tmp_path / "cut.mcap").write_bytes(cut.read_bytes()[:2000])
    for words, expected in (
        (["rosbag", tmp_path / "junk.bag", "-o", tmp_path / "b"], "junk.bag: is not a ROS 1 bag"),
        (["rosbag", tmp_path / "cut.mcap", "-o", tmp_path / "b"], "`slosh recover` writes"),
        (["table", table, "-o", tmp_path / "bags"], "run: exists already"),
        (["table", tmp_path / "no.csv", "-o", tmp_path / "b"], "no.csv: cannot be read"),
        (["table", table, table.parent / "x" / "run.csv", "-o", tmp_path / "b"], "also become"),
        (["rosbag", tmp_path / "no.bag", "-o", tmp_path / "b"], "no.bag: no such file"),
        (["rosbag", table, "-o", tmp_path / "b"], "run.csv: is not one of .bag"),
        (["rosbag", bag, "-o", tmp_path / "b", "--rename", "/a"], "is not OLD=NEW"),
        (["rosbag", bag, "-o", tmp_path / "b", "--topics", "/a"], "no topic '/a'"),
    ):
        assert expected in complaint(capsys, "import", *words)
    assert not (tmp_path / "b").exists()


def test_an_impossible_table_is_refused_and_a_doubtful_one_told(tmp_path: Path, capsys):
    for name, size in (("huge", 1e18), ("millimetres", 2000.0), ("right", 2.0)):
        rows = [f"{0.01 * k:.2f},{size * np.sin(0.1 * k):.9g},0,0" for k in range(190)]
        (tmp_path / f"{name}.csv").write_text("\n".join(["t,ax,ay,az", *rows]) + "\n")
    line = complaint(capsys, "import", "table", tmp_path / "huge.csv", "-o", tmp_path / "b")
    assert re.search(r"huge\.csv: line 112: an acceleration of 1e\+18 m/s² is not possible", line)
    assert not (tmp_path / "b").exists()
    words = ["import", "table", str(tmp_path / "millimetres.csv"), "-o", str(tmp_path / "b")]
    assert main(words) == 1
    assert "is it in mm/s²? It must be m/s²" in capsys.readouterr().err
    run("import", "table", tmp_path / "right.csv", "-o", tmp_path / "b")
    assert "warning" not in capsys.readouterr().err


def ros1_bag(path: Path, table: MotionTable) -> None:
    """Writes a motion and its heights as a ROS 1 bag."""
    store = get_typestore(Stores.ROS1_NOETIC)
    folder = find_interfaces("slosh_msgs")
    assert folder is not None
    surface_type, imu_type = "slosh_msgs/msg/FreeSurface", "sensor_msgs/msg/Imu"
    store.register(get_types_from_msg((folder / "FreeSurface.msg").read_text(), surface_type))
    types = store.types
    vector, turn = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Quaternion"]
    nine, none = np.zeros(9), np.empty(0, dtype=np.float32)
    fields = [name for name, _ in store.fielddefs[surface_type][1]]
    unknown = dict.fromkeys(fields, np.nan) | {
        "profile_azimuth": none, "profile_height": none, "peak_side": 0, "flags": 0,
    }  # fmt: skip
    with Writer(path) as writer:
        imu = writer.add_connection("/imu/data", imu_type, typestore=store)
        surface = writer.add_connection("/camera/surface", surface_type, typestore=store)
        assert table.msh is not None
        for k, (t, a, msh) in enumerate(zip(table.t, table.acceleration, table.msh, strict=True)):
            stamp = 10**9 + round(t * 1e9)
            time = types["builtin_interfaces/msg/Time"](*divmod(stamp, 10**9))
            header = types["std_msgs/msg/Header"](seq=k, stamp=time, frame_id="imu")
            force = vector(a[0], a[1], a[2] + 9.81)
            message = types[imu_type](
                header, turn(0.0, 0.0, 0.0, 1.0), nine, vector(0.0, 0.0, 0.0), nine, force, nine
            )
            writer.write(imu, stamp, store.serialize_ros1(message, imu_type))
            if not np.isnan(msh):
                seen = types[surface_type](**{**unknown, "header": header, "msh": msh})
                writer.write(surface, stamp, store.serialize_ros1(seen, surface_type))


def test_a_ros1_bag_is_imported_and_replayed(table: Path, tmp_path: Path, capsys):
    ros1_bag(tmp_path / "robot.bag", read_motion_table(table))
    line = complaint(capsys, "export", tmp_path / "robot.bag", "--list")
    assert re.search(r"a ROS 1 bag.*convert it with slosh import rosbag", line)
    run(
        "import", "rosbag", tmp_path / "robot.bag", "-o", tmp_path / "bags",
        "--rename", "/imu/data=/slosh/imu", "surface=/slosh/free_surface",
    )  # fmt: skip
    assert "/slosh/imu: 1500" in capsys.readouterr().out
    assert BagReader(tmp_path / "bags" / "robot").topics()["/slosh/free_surface"].count == 188
    run("replay", tmp_path / "bags" / "robot", "--model", MODEL, "--json")
    errors = {row["name"]: row["rms"] for row in rows_of(json.loads(capsys.readouterr().out))}
    assert errors["3D-NL"] < 5e-5  # the gravity of the sensor is rounded


def test_a_shortfall_of_an_import_is_told_and_exit_1(table: Path, tmp_path: Path, capsys):
    """The bag's metadata.yaml lists two files, of which only one exists."""
    run("import", "table", table, "-o", tmp_path / "whole")
    bag = tmp_path / "whole" / "run"
    noted = (bag / "metadata.yaml").read_text()
    (bag / "metadata.yaml").write_text(noted.replace("message_count: 1500", "message_count: 2000"))
    words = ["import", "rosbag", str(bag), "-o", str(tmp_path / "new")]
    capsys.readouterr()
    assert main(words) == 1
    captured = capsys.readouterr()
    assert "/slosh/accel: 1500 of 2000 messages imported" in captured.err
    assert "/slosh/accel: 1500" in captured.out
