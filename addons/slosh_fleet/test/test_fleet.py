"""Tests the motion store: one row per motion, never twice, never incomplete."""

import dataclasses
import math
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slosh_bag.bag_writer import BagWriter
from slosh_bag.errors import SloshBagError
from slosh_bag.held_folder import HeldFolder
from slosh_fleet.ingest_command import ingest
from slosh_fleet.motions.motion_row import COLUMNS, MotionRow
from slosh_fleet.motions.motions import motions_of
from slosh_fleet.motions.query import MotionTable, query
from slosh_fleet.motions.store import NOTES, FleetStore
from slosh_model.mode_table import mode_table
from slosh_model.model_text import parse_model
from slosh_msgs.msg import Calm, FusedEstimate
from slosh_replay.recorded_run import RecordedRun
from slosh_testing.live_bag import LiveBag
from slosh_testing.observed_bag import BEGIN_NS, MODEL, observed

BAGS = Path(__file__).parents[3] / "bags"
DAY_NS = 86_400 * 10**9
needs_duckdb = pytest.mark.usefixtures("duckdb")


@pytest.fixture
def duckdb():
    return pytest.importorskip("duckdb", reason="DuckDB is not installed (requirements/fleet.txt)")


def row(number=0, **given):
    """Returns a stored motion of the day that is a number of days after 30 January."""
    numbers = {column.name: 0.01 for column in COLUMNS if column.type == "float"}
    whole = {column.name: 0 for column in COLUMNS if column.type == "int"}
    texts = {"cell": "line_1", "digest": f"{number:064x}", "bag": "/bags/a", "container": "cup"}
    own = {"model_digest": "m", "begin_ns": BEGIN_NS + number * DAY_NS}
    texts["opening"] = given.get("digest", texts["digest"])
    return MotionRow(**{**numbers, **whole, **texts, **own, **given})


def files(place):
    return sorted(str(path.relative_to(place)) for path in place.rglob("*") if path.is_file())


def test_a_recorded_motion_is_one_row():
    (found,) = motions_of(BAGS / "c3")
    assert found.cell == "slosh"
    assert found.container == "cylinder"
    assert found.month == "2026-11"
    assert found.bag == str(BAGS / "c3")
    starts = RecordedRun(BAGS / "c3").starts
    limit = next(one.parameters["measured_limit"] for one in starts if one.node == "monitor")
    assert found.measured_limit == limit
    assert found.events == 2
    assert 400 < found.images < 546
    assert found.measured_peak == pytest.approx(found.nonlinear_peak, rel=0.05)
    assert found.epsilon_nonlinear == pytest.approx(
        (found.nonlinear_peak - found.measured_peak) / found.measured_peak, abs=0.02
    )
    assert found.sigma_nonlinear < 3e-4 < found.sigma_linear
    first = mode_table(parse_model(MODEL), 1)[0]
    assert found.natural_frequency == pytest.approx(first.natural_frequency, rel=0.03)


def fused(**given):
    return FusedEstimate(modal_position=[0.0, 0.0], modal_velocity=[0.0, 0.0], **given)


def test_the_observers_findings_and_the_calm_time_are_in_the_row(tmp_path):
    factors = {"frequency_factor": 1.02, "frequency_stddev": 0.01, "damping_factor": 1.5}
    observed(
        tmp_path / "bag",
        [
            ("fused_estimate", fused(frequency_factor=0.5, trusted=True), 1.5),
            ("fused_estimate", fused(**factors, trusted=True, level=0.002), 3.0),
            ("fused_estimate", fused(frequency_factor=9.0, trusted=False), 3.1),
            ("calm", Calm(calm=True), 0.5),
            ("calm", Calm(calm=True), 1.2),
            ("calm", Calm(calm=False), 2.5),
            ("calm", Calm(calm=True), 4.0),
        ],
    )
    (found,) = motions_of(tmp_path / "bag")
    assert found.begin_ns == pytest.approx(BEGIN_NS + 1.0e9, abs=1e8)
    assert found.duration == pytest.approx(1.0, abs=0.11)
    assert found.acceleration == pytest.approx(3.0, abs=0.01)
    first = mode_table(parse_model(MODEL), 1)[0]
    assert found.natural_frequency == pytest.approx(1.02 * first.natural_frequency)
    assert found.natural_frequency_stddev == pytest.approx(0.0102 * first.natural_frequency)
    assert found.damping_ratio == pytest.approx(1.5 * first.damping_ratio)
    assert found.level == 0.002
    assert found.calm_time == pytest.approx(2.0, abs=0.11)
    assert (found.images, found.events) == (0, 0)
    assert math.isnan(found.measured_peak)


def test_a_motion_has_one_digest_in_each_of_its_bags(tmp_path):
    copy = shutil.copytree(BAGS / "l", tmp_path / "copy")
    (first,), (second,) = motions_of(BAGS / "l"), motions_of(copy)
    assert first.digest == second.digest
    assert str(dataclasses.replace(second, bag=first.bag)) == str(first)  # NaN is not equal
    (other,) = motions_of(BAGS / "l3")
    assert other.digest != first.digest


def test_bags_that_cannot_be_ingested_are_named(tmp_path):
    bag = tmp_path / "raw"
    with BagWriter(bag) as writer:
        writer.add_topic("/a", "std_msgs/msg/Header")
        writer.write("/a", bytes.fromhex("000100000000000000000000020000006100"), 1)
    with pytest.raises(SloshBagError, match="holds no estimates; `slosh replay"):
        motions_of(bag)
    held = HeldFolder(bag)
    with pytest.raises(SloshBagError, match="is being recorded"):
        motions_of(bag)
    held.release()
    with pytest.raises(SloshBagError, match="no such file or folder"):
        motions_of(tmp_path / "absent")


@needs_duckdb
def test_what_is_stored_comes_out_again(tmp_path):
    rows = [row(0), row(1, calm_time=math.nan), row(2, cell="line_2.b", events=3)]
    store = FleetStore(str(tmp_path / "store"))
    assert store.add(rows) == (3, 2, 0)
    assert [name.rpartition("/")[0] for name in files(tmp_path / "store")] == [
        "cell=line_1/month=2026-01", "cell=line_2.b/month=2026-02"
    ]  # fmt: skip
    names = [column.name for column in COLUMNS]
    found = query(store, f"SELECT {', '.join(names)}, begin FROM motions ORDER BY begin_ns")
    told = [dict(zip(found.names, values, strict=True)) for values in found.rows]
    for stored, back in zip(rows, told, strict=True):
        assert back.pop("begin") == stored.begin
        want = dataclasses.asdict(stored)
        assert back == {name: None if value != value else value for name, value in want.items()}


@needs_duckdb
def test_pandas_reads_the_folder_as_it_is(tmp_path):
    pandas = pytest.importorskip("pandas", reason="pandas is not installed")
    store = tmp_path / "store"
    (store / "ingested").mkdir(parents=True)
    (store / "ingested" / "0").write_text("1")  # a note of an earlier version
    for name in ("c", "c3"):
        ingest(BAGS / name, FleetStore(str(store)))
    found = pandas.read_parquet(store)
    assert len(found) == 2
    assert set(found["cell"]) == {"slosh"}


def test_a_motion_counts_once_whatever_bags_have_it(tmp_path):
    store = FleetStore(str(tmp_path))
    rows = [row(0), row(1)]
    store.add(rows)
    store.add([row(5, cell="b")])
    before = files(tmp_path)
    assert store.add(rows).new == 0
    assert store.add([dataclasses.replace(one, bag="/other") for one in rows]).new == 0
    assert files(tmp_path) == before
    store.add([row(0, bag="/bags/part")])  # a shorter bag with one of them
    assert query(store, "SELECT count(*), count(DISTINCT digest) FROM motions").rows == [(3, 3)]
    assert query(store, "SELECT bag FROM motions WHERE digest LIKE '%0000'").rows == [("/bags/a",)]


@needs_duckdb
def test_a_write_that_fails_leaves_nothing_and_can_be_repeated(tmp_path, monkeypatch):
    store = FleetStore(str(tmp_path / "store"))
    rows = [row(0), row(20)]  # two months, so two files
    calls = []

    def failing(path, data):
        calls.append(path)
        if len(calls) > 1:
            raise OSError(28, "No space left on device", str(path))
        path.write_bytes(data)

    with monkeypatch.context() as patch:
        patch.setattr("slosh_fleet.motions.store.write_bytes", failing)
        with pytest.raises(SloshBagError, match="No space left on device"):
            store.add(rows)
    assert len(files(tmp_path)) == 1
    assert sorted(path.name for path in (tmp_path / "store" / "cell=line_1").iterdir()) == [
        "month=2026-01"
    ]
    assert store.add(rows) == (2, 1, 1)
    assert query(store, "SELECT count(*) FROM motions").rows == [(2,)]


@needs_duckdb
def test_other_places_than_a_disk():
    store = FleetStore("memory://fleet")
    assert store.add([row(0), row(1)]).motions == 2
    assert store.add([row(0), row(1)]).new == 0
    assert query(store, "SELECT sum(images) FROM motions").rows == [(0,)]


@pytest.mark.parametrize("url", ["nowhere://a", "s3://a/b/c"])
def test_a_place_that_cannot_be_reached_is_named(url):
    try:
        FleetStore(url)
    except SloshBagError as error:
        assert str(error).startswith(f"{url}: ")
        assert "\n" not in str(error)


@needs_duckdb
@pytest.mark.parametrize("whole_first", [False, True])
def test_a_motion_of_a_cut_bag_and_of_the_whole_one_stands_once(tmp_path, whole_first):
    """The cut is in the midst of the motion; the longer one counts, in any order."""
    whole = BAGS / "l"
    cut = shutil.copytree(whole, tmp_path / "cut")
    (file,) = cut.glob("*.mcap")
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 3])
    (long,), (short,) = motions_of(whole), motions_of(cut)
    assert short.duration < 0.9 * long.duration
    assert (short.digest != long.digest, short.opening) == (True, long.opening)
    store = FleetStore(str(tmp_path / "store"))
    for bag in (whole, cut) if whole_first else (cut, whole):
        assert ingest(bag, store).new == (0 if whole_first and bag == cut else 1)
    # Nor is it twice where other programs read the folder.
    dataset = pytest.importorskip("pyarrow.dataset")
    assert dataset.dataset(store.url, partitioning="hive").to_table().num_rows == 1
    assert query(store, "SELECT duration, bag FROM motions").rows == [(long.duration, str(whole))]


@needs_duckdb
@pytest.mark.parametrize("cell", ["a=b", "a%3Db", "a b", "ä", "..", "month=2026-01"])
def test_a_cell_may_have_any_name(tmp_path, cell):
    store = FleetStore(str(tmp_path))
    store.add([row(0), row(1, cell=cell)])
    assert query(store, "SELECT cell FROM motions ORDER BY begin_ns").rows == [
        ("line_1",), (cell,)
    ]  # fmt: skip
    with MotionTable(store, loaded=["cell", "month"]) as table:
        assert table.query("SELECT count(*) FROM motions WHERE cell = ?", [cell]).rows == [(1,)]


@needs_duckdb
@pytest.mark.parametrize("loaded", [(), ("duration",)])
@pytest.mark.parametrize("damage", ["end", "data", "empty", "no parquet"])
def test_a_damaged_file_is_named_and_the_others_answer(tmp_path, damage, loaded):
    store = FleetStore(str(tmp_path))
    for number in range(3):
        store.add([row(number)])
    victim = tmp_path / files(tmp_path)[1]
    data = victim.read_bytes()
    footer = int.from_bytes(data[-8:-4], "little") + 8
    parts = {
        "end": data[:-400] + bytes(400), "data": bytes(len(data) - footer) + data[-footer:],
        "empty": b"", "no parquet": b"# notes of somebody",
    }  # fmt: skip
    victim.write_bytes(parts[damage])
    with MotionTable(store, loaded=loaded) as table:
        assert table.query("SELECT count(duration), sum(duration) FROM motions").rows == [
            (2, 0.02)
        ]
    (line,) = store.warnings
    assert line.startswith(f"{victim}: damaged, left out: ")
    assert "ingest the bags again" in line
    assert "\n" not in line


@needs_duckdb
def test_files_of_an_older_version_lack_columns(tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    store = FleetStore(str(tmp_path))
    store.add([row(0)])
    store.add([row(1)])
    old = tmp_path / files(tmp_path)[0]
    table = parquet.read_table(old, partitioning=None).drop_columns(["opening", "level"])
    parquet.write_table(table, old)
    with MotionTable(store, loaded=["level"]) as found:
        assert found.query("SELECT count(*), count(level) FROM motions").rows == [(2, 1)]
    assert store.warnings == []


@needs_duckdb
@pytest.mark.parametrize(
    ("sql", "told"),
    [
        ("SELECT * FROM range(100000000)", "more than 1000000 rows"),
        ("SELECT repeat('x', 100000000) FROM range(20)", "more than 500 MB"),
        ("SELECT string_agg(repeat('x', 60000000), '') FROM range(100)", "of memory; ask"),
    ],
)
def test_a_query_beyond_memory_is_one_line(tmp_path, monkeypatch, sql, told):
    monkeypatch.setattr("slosh_fleet.motions.query._MEMORY", 0.1)
    store = FleetStore(str(tmp_path))
    store.add([row(0)])
    with pytest.raises(SloshBagError, match=f"^query: .*{told}"):
        query(store, sql)


@needs_duckdb
@pytest.mark.parametrize(
    ("sql", "told"),
    [
        ("SELEC", "syntax error"),
        ("SELECT nothing FROM motions", "nothing"),
        ("", "the statement is empty"),
        ("SELECT * FROM read_csv('/etc/passwd')", "disabled by configuration"),
        ("COPY motions TO '/tmp/slosh_motions.csv'", "disabled by configuration"),
        ("SET enable_external_access = true", "locked"),
    ],
)
def test_a_query_that_is_wrong_or_reaches_out_is_refused(tmp_path, sql, told):
    store = FleetStore(str(tmp_path))
    store.add([row(0)])
    with pytest.raises(SloshBagError, match=told) as caught:
        query(store, sql)
    assert "\n" not in str(caught.value)


@needs_duckdb
@needs_duckdb
def test_a_query_that_does_not_end_is_ended(tmp_path, monkeypatch):
    store = FleetStore(str(tmp_path))
    store.add([row(0)])
    monkeypatch.setattr("slosh_fleet.motions.query.LONGEST", 0.2)
    never = "SELECT count(*) FROM range(1000000) a, range(1000000) b, range(1000000) c"
    with pytest.raises(SloshBagError, match=r"takes longer than 0\.2 s"):
        query(store, f"{never} WHERE a.range + b.range = c.range + 0.5")


def test_an_empty_store_says_what_to_do(tmp_path):
    with pytest.raises(SloshBagError, match="no motions are stored here; `slosh ingest BAG"):
        query(FleetStore(str(tmp_path / "absent")), "SELECT 1")


@needs_duckdb
def test_queries_take_values(tmp_path):
    store = FleetStore(str(tmp_path))
    store.add([row(0), row(1, container="it's")])
    with MotionTable(store, loaded=["container"]) as table:
        found = table.query("SELECT count(*) FROM motions WHERE container = ?", ["it's"])
    assert found.rows == [(1,)]


def test_without_duckdb_the_line_says_how_to_get_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "duckdb", None)
    with pytest.raises(SloshBagError, match=r"pip install -r requirements/fleet\.txt"):
        query(FleetStore(str(tmp_path)), "SELECT 1")


KILLED_AT = """
import os, signal, sys
from pathlib import Path
from slosh_fleet.ingest_command import ingest
from slosh_fleet.motions.store import NOTES, FleetStore

left, replace = int(sys.argv[3]), os.replace

def dying(*paths):
    global left
    if not left:
        os.kill(os.getpid(), signal.SIGKILL)
    left -= 1
    replace(*paths)

os.replace = dying
ingest(Path(sys.argv[1]), FleetStore(sys.argv[2]))
"""


@needs_duckdb
@pytest.mark.parametrize("written", [0, 1])
def test_an_ingest_that_is_killed_leaves_nothing_half_and_can_be_repeated(tmp_path, written):
    store = FleetStore(str(tmp_path / "store"))
    command = [sys.executable, "-c", KILLED_AT, str(BAGS / "l"), store.url, str(written)]
    assert subprocess.run(command, check=False).returncode == -signal.SIGKILL
    if written:
        assert query(store, "SELECT count(*) FROM motions").rows == [(1,)]
    else:
        with pytest.raises(SloshBagError, match="no motions are stored here"):
            store.dataset()
    assert ingest(BAGS / "l", store) == (1, 1 - written, False)
    assert ingest(BAGS / "l", store) == (1, 0, True)
    assert query(store, "SELECT count(*) FROM motions").rows == [(1,)]


def test_a_bag_is_read_again_only_when_it_has_changed(tmp_path, monkeypatch):
    bag = shutil.copytree(BAGS / "l", tmp_path / "bag")
    store = FleetStore(str(tmp_path / "store"))
    assert ingest(bag, store) == (1, 1, False)
    with monkeypatch.context() as patch:
        patch.setattr("slosh_fleet.ingest_command.motions_of", lambda _: pytest.fail("is read"))
        assert ingest(bag, store) == (1, 0, True)
    (file,) = bag.glob("*.mcap")
    os.utime(file, ns=(0, file.stat().st_mtime_ns + 1))
    assert ingest(bag, store) == (1, 0, False)
    # A machine that lost its power may have left an empty note.
    for note in (tmp_path / "store" / NOTES).iterdir():
        note.write_bytes(b"")
    assert ingest(bag, store) == (1, 0, False)


@needs_duckdb
@given(
    st.lists(
        st.tuples(st.sampled_from("ab"), st.lists(st.integers(0, 60), min_size=1, unique=True)),
        min_size=1, max_size=6,
    )
)  # fmt: skip
@settings(max_examples=15, deadline=None)
def test_each_motion_counts_once_however_bags_overlap(bags):
    with tempfile.TemporaryDirectory() as place:
        store = FleetStore(place)
        for name, (cell, days) in enumerate(bags):
            digests = [f"{cell}{day:063x}" for day in days]
            store.add(
                [row(day, cell=cell, digest=digest, bag=f"/bags/{name}")
                 for day, digest in zip(days, digests, strict=True)]
            )  # fmt: skip
        wanted = {(cell, day) for cell, days in bags for day in days}
        found = query(store, "SELECT cell, begin_ns FROM motions").rows
        days = [(cell, (begin - BEGIN_NS) // DAY_NS) for cell, begin in found]
    assert sorted(days) == sorted(wanted)


def test_a_container_is_one_trend_before_and_after_an_upgrade():
    """The model's text in old bags has no version."""
    from slosh_base.files.file_version import MODEL
    from slosh_fleet.motions.motions import _liquid
    from slosh_model import format_model
    from slosh_model.model import Model
    from slosh_model.shapes.cylinder import Cylinder
    from slosh_motion.recorded.settings import NodeStart

    text = format_model(Model(Cylinder(0.05, 0.07)))
    line = f"version: {MODEL.current}\n"
    assert text.startswith(line)
    found = {
        _liquid([NodeStart("estimator", 0, 1, "", "", {}, {"model": one})]).digest
        for one in (text, text.removeprefix(line))
    }
    assert len(found) == 1
    other = text.replace("0.07", "0.08")
    assert (
        _liquid([NodeStart("estimator", 0, 1, "", "", {}, {"model": other})]).digest not in found
    )


def test_motions_come_from_remapped_topics(tmp_path):
    live = LiveBag()
    live.remap = {"accel": "/arm/accel", "estimate": "/robot/wave", "free_surface": "/eye/level"}
    (row,) = motions_of(live.write(tmp_path / "own", 1.0))
    assert (row.cell, row.nonlinear_peak > 0.0) == ("slosh", True)
