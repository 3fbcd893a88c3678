"""Tests that no command destroys its inputs or the results of an earlier run."""

import ast
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from contextlib import nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest
import scipy.io

from slosh_bag.bag_writer import BagWriter
from slosh_base.files import is_unfinished
from slosh_bringup.cell.renderer import CupRenderer
from slosh_bringup.cli.main import all_commands, main
from slosh_bringup.processes import config_folder
from slosh_camera.calibrate.camera_file import read_calibration
from slosh_motion.tables.motion_table import MotionTable, write_motion_table
from slosh_testing.board_scene import chessboard_pictures
from slosh_testing.small_disk import small_disk

ROOT = Path(__file__).parents[1]
PATIENCE = 60.0
# A Header of stamp 0 with the frame "a".
HEADER, DATA = "std_msgs/msg/Header", bytes.fromhex("000100000000000000000000020000006100")
MANY_MESSAGES, MANY_ROWS, MANY_IMAGES = 200_000, 60_000, 40
NO_OUTPUT = (
    "migrate",
    "play",
    "plc",
    "store",
    "watch",
    "doctor",
    "explain",
    "mounting",
    "node",
    "call",
)


@pytest.fixture(scope="module")
def shop(tmp_path_factory):
    """Creates inputs for every command; those named many_* take about a second."""
    folder = tmp_path_factory.mktemp("shop")
    for name in ("model.yaml", "camera.yaml"):
        shutil.copy(config_folder() / name, folder / name)
    view = read_calibration(folder / "camera.yaml").view
    (folder / "images").mkdir()
    image = CupRenderer(view).render_colour(0.0, 0.006)
    for number in range(3):
        cv2.imwrite(str(folder / "images" / f"frame_{number}.png"), image)
    (folder / "boards").mkdir()
    for number, board in enumerate(chessboard_pictures()[:6]):
        cv2.imwrite(str(folder / "boards" / f"board_{number}.png"), board)
    (folder / "many_images").mkdir()
    for number in range(MANY_IMAGES):
        cv2.imwrite(str(folder / "many_images" / f"frame_{number}.jpg"), image)
    cv2.imwrite(str(folder / "still.png"), CupRenderer(view).render_colour(0.0, 0.0))
    make_motion(folder / "motion.csv", 1500)
    make_motion(folder / "many_rows.csv", MANY_ROWS)
    rows = [f"{0.05 * k},{0.01 * k},0,0" for k in range(41)]
    (folder / "path.csv").write_text("\n".join(["t,x,y,z", *rows]), encoding="utf-8")
    (folder / "smooth.csv").write_text("t,x,y,z\n0,0,0,0\n0.5,0.1,0,0\n1,0.2,0,0\n")
    make_bag(folder / "bag", 1000)
    make_bag(folder / "many_messages", MANY_MESSAGES)
    shutil.copytree(ROOT / "bags" / "l", folder / "recording")
    make_data_set(folder / "measured")
    main(["ingest", str(folder / "recording"), "--store", str(folder / "stored")])
    return folder


@pytest.fixture
def own(shop, tmp_path):
    """Copies the small inputs, for a command that may destroy them."""
    return shutil.copytree(shop, tmp_path / "own", ignore=shutil.ignore_patterns("many_*"))


def make_motion(path, count):
    t = np.arange(count) * 0.002
    push = 3.0 * np.sin(17.0 * t) * np.sin(np.pi * t / t[-1]) ** 2
    acceleration = np.column_stack([np.zeros(count), push, np.zeros(count)])
    msh = np.where(np.arange(count) % 8, np.nan, np.abs(2e-3 * push))
    write_motion_table(path, MotionTable(t, acceleration, msh=msh))


def make_bag(folder, count):
    with BagWriter(folder) as writer:
        writer.add_topic("/header", HEADER)
        for number in range(count):
            writer.write("/header", DATA, number)


def make_data_set(folder):
    (folder / "heights").mkdir(parents=True)
    (folder / "poses").mkdir()
    t = np.arange(2000) * 0.002
    for run in ("A", "B"):
        rows = np.column_stack([t, np.sin(t), *[0.0 * t] * 5, 1.0 + 0.0 * t])
        np.savetxt(folder / "poses" / f"{run}.csv", rows, delimiter=";")
        heights = {"slosh_times": t[::8], "slosh_heights": 1.0 + t[::8]}
        scipy.io.savemat(folder / "heights" / f"{run}.mat", heights)


def words_of(text, shop, **places):
    """Returns the words of a command line; SHOP and similar words become paths."""
    words = text.split()
    for name, path in {"SHOP": shop, **places}.items():
        words = [word.replace(name, str(path)) for word in words]
    return words


def contents(folder):
    """Returns the content of every file below a folder, by path."""
    return {path: path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


# --- an output that is an input ----------------------------------------------------------------

CALIBRATE = "calibrate SHOP/still.png --camera SHOP/camera.yaml"
INTRINSICS = "intrinsics SHOP/boards --board 8x5 --square 0.02"
DETECT = "detect SHOP/images --camera SHOP/camera.yaml --still SHOP/still.png --jobs 1"
REPLAY = "replay SHOP/recording --model SHOP/model.yaml"
INPUT_AS_OUTPUT = [
    ("modes SHOP/model.yaml -o OUT", "model.yaml"),
    ("simulate SHOP/model.yaml SHOP/motion.csv -o OUT", "model.yaml"),
    ("simulate SHOP/model.yaml SHOP/motion.csv -o OUT", "motion.csv"),
    ("predict SHOP/model.yaml SHOP/motion.csv -o OUT", "motion.csv"),
    ("predict SHOP/model.yaml SHOP/motion.csv --page OUT", "model.yaml"),
    ("plan SHOP/model.yaml SHOP/path.csv --limit 0.02 -o OUT", "path.csv"),
    ("shape SHOP/model.yaml SHOP/smooth.csv --filter zv -o OUT", "smooth.csv"),
    (f"{CALIBRATE} -o OUT", "still.png"),
    (f"{CALIBRATE} -o OUT", "camera.yaml"),
    (f"{CALIBRATE} -o NEW.yaml --picture OUT", "still.png"),
    (f"{INTRINSICS} -o OUT", "boards/board_0.png"),
    (f"{INTRINSICS} -o NEW.yaml --print-board OUT", "boards/board_1.png"),
    (f"{DETECT} -o OUT", "images/frame_0.png"),
    (f"{DETECT} -o OUT", "camera.yaml"),
    (f"{DETECT} -o OUT", "still.png"),
    ("detect SHOP/images/frame_1.png --camera SHOP/camera.yaml -o OUT", "images/frame_1.png"),
    (f"{DETECT} -o NEW.csv --video OUT", "images/frame_1.png"),
    (f"{DETECT} -o NEW.csv --strip OUT", "images/frame_1.png"),
    (f"{DETECT} -o NEW.csv --worst OUT 2", "images/frame_1.png"),
    (f"{REPLAY} --junit OUT", "model.yaml"),
    (f"{REPLAY} --junit OUT", "recording/metadata.yaml"),
    (f"{REPLAY} --check --junit OUT", "recording/l_0.mcap"),
    ("export SHOP/bag --topic header --overwrite -o OUT", "bag/bag_0.mcap"),
    ("export SHOP/recording --motion --overwrite -o OUT", "recording/l_0.mcap"),
]


def names_of(file, folder):
    """Yields different names of one file, each with the suffix that a command needs."""
    for suffix in ("", ".csv"):
        (folder / f"link{file.suffix}{suffix}").symlink_to(file)
        os.link(file, folder / f"hard{file.suffix}{suffix}")
    yield from (path.name for path in sorted(folder.iterdir()) if not path.is_dir())
    yield str(file)
    yield os.path.relpath(file, folder)


@pytest.mark.first(2)
@pytest.mark.parametrize(("line", "name"), INPUT_AS_OUTPUT)
def test_an_output_that_is_an_input_is_refused(own, tmp_path, monkeypatch, capsys, line, name):
    folder = tmp_path / "names"
    folder.mkdir()
    monkeypatch.chdir(folder)
    before = contents(own)
    for given in list(names_of(own / name, folder)):
        if line.startswith("export") and not given.endswith(".csv"):
            continue
        code = main(words_of(line, own, OUT=given, NEW=tmp_path / "new"))
        told = capsys.readouterr()
        assert (code, told.out) == (2, "")
        assert told.err.count("\n") == 1
        assert f"{given}: is the input" in told.err
    assert contents(own) == before
    assert not list(tmp_path.glob("new*"))


@pytest.mark.parametrize(
    ("line", "refused"),
    [
        ("replay SHOP/recording -o SHOP", "SHOP/recording: is the input"),
        ("replay SHOP/recording -o SHOP/recording", "is inside the input SHOP/recording"),
        (
            "replay SHOP/recording --model SHOP/full/recording.json -o SHOP/full",
            "SHOP/full/recording.json: is the input",
        ),
        ("export SHOP/bag -o SHOP/bag", "SHOP/bag: is the input"),
        ("export SHOP/bag -o SHOP/bag/new", "is inside the input SHOP/bag"),
        ("recover SHOP/bag -o SHOP/bag", "SHOP/bag: is the input"),
        ("recover SHOP/bag -o SHOP/bag/new", "is inside the input SHOP/bag"),
        ("recover SHOP/bag/bag_0.mcap -o SHOP/bag", "SHOP/bag: exists already"),
        ("import rosbag SHOP/bag -o SHOP", "SHOP/bag: exists already"),
        ("import rosbag SHOP/bag -o SHOP/bag", "is inside the input SHOP/bag"),
        ("import rosbag SHOP/bag/bag_0.mcap SHOP/bag -o SHOP", "SHOP/bag: exists already"),
        ("import antisloshing SHOP/measured -o SHOP/full", "SHOP/full/B: exists already"),
        ("discover SHOP/motion.csv --model SHOP/model.yaml -o SHOP", "SHOP: exists already"),
        ("identify SHOP/motion.csv --model SHOP/model.yaml -o SHOP", "SHOP: exists already"),
        ("new SHOP --radius 0.05 --fill-height 0.07", "SHOP: exists already"),
        ("discover SHOP/recording --from-bag -o SHOP/recording/new", "is inside the input"),
        ("discover --each SHOP/recording --from-bag -o SHOP", "SHOP: exists already"),
        (
            "plan SHOP/model.yaml SHOP/path.csv --limit 0.02 -o SHOP/new.csv --report SHOP",
            "SHOP: exists already",
        ),
    ],
)
def test_a_folder_of_results_that_would_meet_an_input_is_refused(own, capsys, line, refused):
    (own / "full" / "B").mkdir(parents=True, exist_ok=True)
    (own / "full" / "B" / "mine").write_text("mine")
    shutil.copy(own / "model.yaml", own / "full" / "recording.json")
    before = contents(own)
    assert main(words_of(line, own)) == 2
    told = capsys.readouterr()
    assert (told.out, told.err.count("\n")) == ("", 1)
    assert refused.replace("SHOP", str(own)) in told.err
    assert contents(own) == before
    assert not (own / "full" / "A").exists()


@pytest.mark.long
def test_replays_pages_do_not_replace_a_strangers(own, tmp_path, capsys):
    place = tmp_path / "place"
    place.mkdir()
    page = place / "recording.html"
    page.write_text("mine")
    line = words_of("replay SHOP/recording -o OUT", own, OUT=place)
    assert main(line) == 2
    assert f"{page}: is not from a replay" in capsys.readouterr().err
    assert contents(place) == {page: b"mine"}
    page.unlink()
    assert main(line) == main(line) == 0


# --- a disk that is full, and Ctrl-C -----------------------------------------------------------

FULL = -1


@dataclass(frozen=True)
class Case:
    """A command and the files that it writes.

    Attributes:
        line: with OUT for the output's folder.
        writes: the file that is written, or of a folder that must be new the folder itself.
        long: the same over data of whose results the writing takes a while; empty: it never does.
        limit: largest file that the system lets it write [bytes]; FULL: the disk itself is full.
        library: optional library that it needs; without it the case is skipped.
    """

    line: str
    writes: str
    long: str = ""
    limit: int = 100
    library: str = ""

    @property
    def others(self):
        """Earlier complete results of the same command, which must survive."""
        return {"detect": {"a.csv"}}.get(self.line.split()[0], set()) - {self.writes}


CASES = {
    "simulate": Case(
        "simulate SHOP/model.yaml SHOP/motion.csv -o OUT/a.csv", "a.csv",
        "simulate SHOP/model.yaml SHOP/many_rows.csv -o OUT/a.csv",
    ),
    "predict": Case("predict SHOP/model.yaml SHOP/motion.csv -o OUT/a.csv", "a.csv"),
    "predict --page": Case(
        "predict SHOP/model.yaml SHOP/motion.csv --page OUT/a.html", "a.html", limit=2_000
    ),
    "predict --plot": Case(
        "predict SHOP/model.yaml SHOP/motion.csv --plot OUT/a.png", "a.png", limit=2_000
    ),
    "calibrate --page": Case(
        "calibrate SHOP/still.png --model SHOP/model.yaml -o NEW.yaml --page OUT/a.html",
        "a.html",
        limit=2_000,
    ),
    "plan": Case("plan SHOP/model.yaml SHOP/path.csv --limit 0.02 -o OUT/a.csv", "a.csv"),
    "shape": Case("shape SHOP/model.yaml SHOP/smooth.csv --filter zv -o OUT/a.csv", "a.csv"),
    "plan --report": Case(
        "plan SHOP/model.yaml SHOP/path.csv --limit 0.02 -o OUT/a.csv --report OUT/new", "new"
    ),
    "intrinsics": Case(f"{INTRINSICS} -o OUT/a.yaml", "a.yaml"),
    "intrinsics --print-board": Case(
        "intrinsics --board 8x5 --square 0.02 --print-board OUT/a.pdf", "a.pdf"
    ),
    "calibrate": Case(f"{CALIBRATE} -o OUT/a.yaml", "a.yaml"),
    "calibrate --picture": Case(f"{CALIBRATE} -o OUT/a.yaml --picture OUT/a.png", "a.png"),
    "detect": Case(
        f"{DETECT} -o OUT/a.csv", "a.csv",
        "detect SHOP/many_images --camera SHOP/camera.yaml --jobs 1 -o OUT/a.csv",
    ),
    "detect --video mp4": Case(
        f"{DETECT} -o OUT/a.csv --video OUT/a.mp4", "a.mp4",
        "detect SHOP/many_images --camera SHOP/camera.yaml --jobs 1 -o OUT/a.csv "
        "--video OUT/a.mp4",
        limit=5_000,
    ),
    "detect --video avi": Case(f"{DETECT} -o OUT/a.csv --video OUT/a.avi", "a.avi", limit=20_000),
    "detect --video mkv": Case(f"{DETECT} -o OUT/a.csv --video OUT/a.mkv", "a.mkv", limit=5_000),
    "detect --strip": Case(f"{DETECT} -o OUT/a.csv --strip OUT/a.png", "a.png", limit=2_000),
    "detect --worst": Case(f"{DETECT} -o OUT/a.csv --worst OUT/a.jpg 2", "a.jpg", limit=2_000),
    "replay": Case(
        f"{REPLAY} -o OUT", "recording/recording_0.mcap", f"{REPLAY} -o OUT", limit=600_000
    ),
    "replay, the page": Case(f"{REPLAY} -o OUT", "recording.html", limit=FULL),
    "replay --junit": Case(f"{REPLAY} --check --junit OUT/a.xml", "a.xml", limit=FULL),
    "replay --write-manifest": Case(
        "replay OUT/recording --write-manifest", "manifest.yaml", limit=FULL
    ),
    "report": Case("report --validation SHOP/recording -o OUT/a.html", "a.html", limit=FULL),
    "report, a PDF": Case(
        "report --validation SHOP/recording -o OUT/a.pdf", "a.pdf", limit=FULL, library="fpdf"
    ),
    "export": Case(
        "export SHOP/bag --topic header --overwrite -o OUT/a.csv", "a.csv",
        "export SHOP/many_messages --topic header --overwrite -o OUT/a.csv",
    ),
    "export, gz": Case("export SHOP/bag --topic header --overwrite -o OUT/a.csv.gz", "a.csv.gz"),
    "export, parquet": Case(
        "export SHOP/bag --topic header --overwrite -o OUT/a.parquet", "a.parquet"
    ),
    "export, a folder": Case(
        "export SHOP/recording --overwrite --format csv -o OUT", "slosh.estimate.csv", limit=10_000
    ),
    "export --motion": Case("export SHOP/recording --motion --overwrite -o OUT/a.csv", "a.csv"),
    "import table": Case(
        "import table SHOP/motion.csv -o OUT/new", "new",
        "import table SHOP/many_rows.csv -o OUT/new", limit=3_000,
    ),
    "import rosbag": Case(
        "import rosbag SHOP/bag -o OUT/new", "new",
        "import rosbag SHOP/many_messages -o OUT/new", limit=1_000,
    ),
    "import antisloshing": Case(
        "import antisloshing SHOP/measured -o OUT/new", "new",
        "import antisloshing SHOP/measured -o OUT/new", limit=3_000,
    ),
    "recover": Case(
        "recover SHOP/bag -o OUT/new", "new", "recover SHOP/many_messages -o OUT/new", limit=1_000
    ),
    "new": Case("new OUT/new --radius 0.05 --fill-height 0.07", "new"),
    "certificates": Case(
        "certificates OUT --create cell-1.local --replace", "server.pem", limit=1_000,
        library="cryptography",
    ),
    "ingest": Case("ingest SHOP/recording --store OUT/new", "new"),
    "query --page": Case(
        "query --store SHOP/stored --page OUT/a.html", "a.html", limit=2_000, library="duckdb"
    ),
    "modes": Case("modes SHOP/model.yaml -o OUT/a.yaml", "a.yaml"),
    "motion": Case("motion quintic --speed 30 --stroke 0.1 -o OUT/a.csv", "a.csv"),
    "motion-map": Case(
        "motion-map SHOP/model.yaml --stroke 0.1 --speeds 20:22 --limit 0.01 -o OUT/new", "new"
    ),
    "identify": Case(
        "identify SHOP/motion.csv --model SHOP/model.yaml -o OUT/new", "new",
        "identify SHOP/motion.csv --model SHOP/model.yaml -o OUT/new",
    ),
    "discover": Case(
        "discover SHOP/motion.csv --model SHOP/model.yaml -o OUT/new", "new",
        "discover SHOP/motion.csv --model SHOP/model.yaml -o OUT/new",
    ),
}  # fmt: skip
FOLDERS = {name for name, case in CASES.items() if case.writes == "new"}


QUICK = {"simulate", "detect --video mp4", "replay", "export, parquet", "import table"}


def mostly_long(names, quick):
    """Returns the names as test parameters; all but the quick ones are marked as long."""
    long = pytest.mark.long
    return [pytest.param(name, marks=() if name in quick else long) for name in names]


def test_every_command_that_writes_is_tried():
    tried = {name.split()[0].strip(",") for name in CASES}
    live = {"demo", "cell"}  # in test_run_folders.py
    assert tried | live | set(NO_OUTPUT) == set(all_commands())


@pytest.fixture
def place(tmp_path):
    """Returns the folder for the results."""
    folder = tmp_path / "place"
    folder.mkdir()
    return folder


def fill(file):
    """Fills a disk until no space is left."""
    with file.open("wb", buffering=0) as ballast, suppress(OSError):
        while True:
            ballast.write(bytes(4096))


def start(words, limit=FULL):
    """Starts a command whose files cannot exceed a size limit, or the disk's space."""

    def limited():
        os.nice(5)  # who watches it is to see what it does
        if limit != FULL:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    return subprocess.Popen(
        [sys.executable, "-m", "slosh_bringup.cli", *words],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=limited,
    )  # fmt: skip


def results_of_before(name, shop, place):
    """Runs a command that replaces its results; returns all files that exist then."""
    if "manifest" in name:
        shutil.copytree(shop / "recording", place / "recording")
    if name not in FOLDERS:
        assert main(words_of(CASES[name].line, shop, OUT=place)) in (0, 1)
        assert (place / CASES[name].writes).stat().st_size > CASES[name].limit
    return contents(place)


@pytest.mark.long
@pytest.mark.parametrize("name", mostly_long(CASES, QUICK))
def test_a_full_disk_leaves_what_was_there(shop, place, name):
    case = CASES[name]
    if case.library:
        pytest.importorskip(case.library, reason=f"{case.library} is not installed (requirements)")
    with small_disk(place, "size=4m") if case.limit == FULL else nullcontext():
        results_of_before(name, shop, place)
        if case.limit == FULL:
            fill(place / "ballast")
        before = contents(place)
        process = start(words_of(case.line, shop, OUT=place), case.limit)
        _, told = process.communicate(timeout=PATIENCE)
        after = contents(place)
    assert after.keys() == before.keys()
    assert {path.name for path in before if after[path] != before[path]} <= case.others
    if name in FOLDERS:
        assert list(place.iterdir()) == []
    assert process.returncode == 2, told
    (complaint,) = complaints(told)
    assert str(place) in complaint


def complaints(told):
    lines = [line for line in told.splitlines() if line.startswith("slosh ")]
    return [line for line in lines if ": note: " not in line]


@pytest.mark.first(1)
@pytest.mark.parametrize(
    "name", mostly_long([name for name in CASES if CASES[name].long], {"simulate", "recover"})
)
def test_ctrl_c_leaves_what_was_there(shop, place, name):
    before = results_of_before(name, shop, place)
    process = start(words_of(CASES[name].long, shop, OUT=place))
    deadline = time.monotonic() + PATIENCE
    while not any(map(is_unfinished, place.rglob("*"))) and seem_untouched(before):
        assert process.poll() is None, "it was too fast"
        assert time.monotonic() < deadline
        time.sleep(0.001)
    process.send_signal(signal.SIGINT)
    out, told = process.communicate(timeout=PATIENCE)
    assert (process.returncode, out) == (1, "")
    assert told.endswith("slosh: stopped\n")
    assert contents(place) == before
    assert [path for path in place.rglob("*") if is_unfinished(path)] == []
    if name in FOLDERS - {"import antisloshing"}:  # one run may be whole
        assert list(place.iterdir()) == []


def seem_untouched(before):
    """Returns whether the earlier files have the sizes that they had."""
    return all(path.exists() and path.stat().st_size == len(old) for path, old in before.items())


# --- outputs that are no files -----------------------------------------------------------------


@pytest.mark.long
def test_a_table_goes_through_standard_output_and_a_pipe(shop, tmp_path):
    line = "simulate SHOP/model.yaml SHOP/motion.csv -o OUT --json"
    out, _ = start(words_of(line, shop, OUT="/dev/stdout")).communicate(timeout=PATIENCE)
    lines = out.splitlines()
    assert (lines[0], len(lines)) == ("t,msh,azimuth,sh_x,sh_y", 1501)
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    process = start(words_of(line, shop, OUT=pipe))
    assert pipe.read_text().splitlines() == lines
    assert process.wait(PATIENCE) == 1  # the liquid rises above the rim
    assert list(tmp_path.iterdir()) == [pipe]
    assert pipe.is_fifo()


# --- the one way to write ----------------------------------------------------------------------

WRITING = {
    "write_text", "write_bytes", "imwrite", "savefig", "savetxt", "savez", "tofile", "to_csv",
    "unlink", "rename", "rmtree", "copyfile", "copytree", "copy2", "truncate",
}  # fmt: skip
MOVING = {("os", "replace"), ("os", "remove"), ("shutil", "move"), ("shutil", "copy")}
ALLOWED = {
    "slosh_bag/black_box/event_bags.py": "removes the oldest of its own bags",
    "slosh_bag/interchange/foreign_storage.py": "a temporary copy of a database with its log",
    "slosh_bag/mcap_files/mcap_file.py": "makes files that are new, and removes its own",
    "slosh_bag/store/stored_bags.py": "removes old bags of a cell's runs",
    "slosh_bag/recorder.py": "the space that it reserves beside the bag's files",
    "slosh_bringup/finished_work.py": "removes its own notes",
    "slosh_bringup/processes.py": "a node's log, in the folder of its run",
    "slosh_bringup/cli/intrinsics.py": "savefig into memory",
    "slosh_bringup/simulate/chart.py": "savefig into a NewFile",
    "slosh_model/for_notebooks.py": "savefig into memory",
    "slosh_report/page/svg.py": "savefig into memory",
    "slosh_base/compiled/compile_cache.py": "compiled code, which is the cache's alone",
    "slosh_replay/journaled/replay.py": "recorded texts in a temporary folder",
    "slosh_msgs_py/node/dead_ports.py": "locks of what killed nodes have left",
    "slosh_msgs_py/node/shared_memory.py": "what killed nodes have left there",
}


def writes(tree):
    """Returns the lines of a module that write or remove files."""
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        name = getattr(node.func, "attr", getattr(node.func, "id", ""))
        method = isinstance(node.func, ast.Attribute)
        modes = [
            *node.args[0 if method else 1 :][:1],
            *(k.value for k in node.keywords if k.arg == "mode"),
        ]
        texts = [mode.value for mode in modes if isinstance(mode, ast.Constant)]
        opens = name == "open" and any(set("wax+") & set(str(text)) for text in texts)
        moves = method and (getattr(getattr(node.func, "value", None), "id", ""), name) in MOVING
        if opens or moves or (method and name in WRITING):
            yield node.lineno


def test_files_are_written_through_slosh_files_only():
    found = set()
    for path in ROOT.glob("*/slosh_*/slosh_*/**/*.py"):
        name = path.relative_to(ROOT).as_posix().split("/", 2)[2]
        if not name.startswith(("slosh_base/files/", "slosh_testing/")) and list(
            writes(ast.parse(path.read_text()))
        ):
            found.add(name)
    assert found == set(ALLOWED)


@pytest.mark.parametrize(
    ("code", "count"),
    [
        ("path.open('w')", 1), ("open(path, mode='ab')", 1), ("open(path)", 0),
        ("path.open('rb')", 0), ("path.write_text(text)", 1), ("write_text(path, text)", 0),
        ("shutil.rmtree(path)", 1), ("text.replace('w', 'x')", 0), ("new.open()", 0),
        ("cv2.imwrite(name, image)", 1), ("os.replace(a, b)", 1), ("array.copy()", 0),
        ("shutil.copy(a, b)", 1),
    ],
)  # fmt: skip
def test_what_writes_a_file_is_seen(code, count):
    assert len(list(writes(ast.parse(code)))) == count
