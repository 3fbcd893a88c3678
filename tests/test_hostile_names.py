"""Tests names of files, bags and topics that try to inject lines, markup or paths.

Whoever hands over a recording names it. Every command is given such names for all that it reads
and writes; what it prints is plain lines, what it writes stays where it was told to.
"""

import csv
import io
import json
import shutil
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import pytest
import yaml

from slosh_bag.bag_writer import BagWriter
from slosh_base.files.plain_text import LONGEST, PlainStream
from slosh_bringup.cell.renderer import CupRenderer
from slosh_bringup.cli.main import main
from slosh_bringup.processes import config_folder
from slosh_camera.calibrate.camera_file import read_calibration
from slosh_motion.tables.motion_table import MotionTable, write_motion_table
from slosh_testing.reports import CONTROL, EVIL, Page, has_forged_line

BAGS = Path(__file__).parents[1] / "bags"
HEADER, DATA = "std_msgs/msg/Header", bytes.fromhex("000100000000000000000000020000006100")
STRANGE = ("/../../../up", "/a/../b", "/a.b", "/a/b", f"/{EVIL}", "/x\0y")
NAMES = ["a.b", "a.%2e%2e.b", "a%2eb", "%2e%2e.%2e%2e.%2e%2e.up", "x%00y"]
LONG = pytest.mark.long


class Shop(NamedTuple):
    """Input files of the commands, all with injecting names, and the folder for outputs."""

    inputs: Path
    outputs: Path

    def words(self, line: str) -> list[str]:
        """Returns the words of a command; `IN…` and `OUT…` become paths with injecting names."""
        folders = {"IN": self.inputs, "OUT": self.outputs}
        return [
            next((str(at / f"{EVIL}{word[len(name):]}") for name, at in folders.items()
                  if word.startswith(name)), word)
            for word in line.split()
        ]  # fmt: skip


@pytest.fixture(scope="module")
def shop(tmp_path_factory: pytest.TempPathFactory) -> Shop:
    """Creates the input files, several folders deep so that `../../..` would be noticed."""
    made = Shop(*(tmp_path_factory.mktemp("shop") / "a" / "b" / name for name in (EVIL, "out")))
    for folder in made:
        folder.mkdir(parents=True)

    def named(ending: str) -> Path:
        return made.inputs / f"{EVIL}{ending}"

    for name in ("model.yaml", "camera.yaml"):
        shutil.copy(config_folder() / name, named(f"-{name}"))
    for number, rate in enumerate((17.0, 17.5)):
        t = np.arange(1500) * 0.002
        push = 1.0 * np.sin(rate * t) * np.sin(np.pi * t / t[-1]) ** 2
        motion = np.column_stack([np.zeros_like(t), push, np.zeros_like(t)])
        msh = np.where(np.arange(1500) % 8, np.nan, np.abs(2e-3 * push))
        write_motion_table(named(f"{number}.csv"), MotionTable(t, motion, msh=msh))
    shutil.copy(config_folder() / "still.png", made.inputs / "still.png")
    rows = [f"{0.05 * k},{0.01 * k},0,0" for k in range(41)]
    named("-path.csv").write_text("\n".join(["t,x,y,z", *rows]))
    named("-smooth.csv").write_text("t,x,y,z\n0,0,0,0\n0.5,0.1,0,0\n1,0.2,0,0\n")
    cup = CupRenderer(read_calibration(config_folder() / "camera.yaml").view)
    named("-images").mkdir()
    for number, height in enumerate((0.0, 0.006, 0.0)):
        image = cv2.imencode(".png", cup.render_colour(0.0, height))[1].tobytes()
        (named("-images") / f"{EVIL}{number}.png").write_bytes(image)
    shutil.copy(named("-images") / f"{EVIL}0.png", named("-still.png"))
    shutil.copytree(BAGS / "l", named("-bag"))
    for ending, topics in (("-topics", STRANGE), ("-long", (f"/{'y' * 100_000}",))):
        with BagWriter(named(ending)) as writer:
            for topic in topics:
                writer.add_topic(topic, HEADER)
                writer.write(topic, DATA, 5)
    return made


def said_by(words: list[str]) -> tuple[int, str]:
    """Runs a command; returns exit code and output as the process `slosh` prints it."""
    said = io.StringIO()
    with redirect_stdout(PlainStream(said)), redirect_stderr(PlainStream(said)):
        code = main(words)
    return code, said.getvalue()


@pytest.mark.first(4)
@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("simulate IN-model.yaml IN0.csv -o OUT-s.csv --plot OUT-s.png", 0),
        ("predict IN-model.yaml IN0.csv IN1.csv -o OUT-predicted.csv", 0),
        ("predict IN-model.yaml IN0.csv --plot OUT-p.svg --page OUT-p.html", 0),
        ("shape IN-model.yaml IN-smooth.csv --filter zv -o OUT-shaped.csv", 0),
        ("calibrate IN-still.png --camera IN-camera.yaml -o OUT.yaml --picture OUT-c.png", 0),
        ("detect IN-images --camera IN-camera.yaml --jobs 1 -o OUT-d.csv --worst OUT-w.png 2", 0),
        ("replay IN-bag --model IN-model.yaml -o OUT-replay", 0),
        ("export IN-bag --motion -o OUT-motion.csv", 0),
        ("export IN-topics --list", 0),
        ("export IN-long --list", 0),
        ("export IN-long --format csv -o OUT-long", 2),
        ("export IN-bag --topic IN -o OUT-nothing.csv", 2),
        ("import table IN0.csv -o OUT-imported", 0),
        ("import rosbag IN-topics -o OUT-imported-topics", 0),
        ("recover IN-topics -o OUT-recovered", 0),
        ("recover IN-bag --split -o OUT-nothing", 2),
        ("new OUT-new --radius 0.05 --fill-height 0.07", 0),
        ("cell --config IN-nothing.yaml", 2),
        ("watch IN-nothing", 2),
        pytest.param(
            "plan IN-model.yaml IN-path.csv --limit 0.02 -o OUT-p.csv --report OUT-plan", 0,
            marks=LONG,
        ),
        pytest.param(
            "discover IN0.csv IN1.csv --model IN-model.yaml --jobs 1 -o OUT-found", 0, marks=LONG
        ),
        pytest.param("identify IN0.csv IN1.csv --model IN-model.yaml -o OUT-i", 0, marks=LONG),
    ],
)  # fmt: skip
def test_a_name_writes_no_line_and_no_page_of_its_own(shop: Shop, line: str, code: int) -> None:
    found, said = said_by(shop.words(line))
    assert found == code, said
    assert not CONTROL & set(said)
    assert not has_forged_line(said)
    assert max(map(len, said.splitlines())) < 1.1 * LONGEST
    for path in shop.outputs.rglob("*"):
        check_file(path)


def check_file(path: Path) -> None:
    """Checks that a result file is well-formed although it quotes injecting names."""
    if path.suffix == ".html":
        page = Page()
        page.feed(path.read_text())
        assert not page.hacked
        assert not set("\x1b\x07\u202e") & set(page.text)
    elif path.suffix == ".json":
        json.loads(path.read_text())
    elif path.suffix == ".yaml":
        assert yaml.safe_load(path.read_text())
    elif path.suffix == ".csv":
        text = path.read_text()
        assert not CONTROL & set(text)
        assert len({len(row) for row in csv.reader(text.splitlines())}) == 1


def test_a_topic_is_never_a_path(shop: Shop, tmp_path: Path) -> None:
    out = tmp_path / "a" / "b" / "tables"
    code, said = said_by(["export", *shop.words("IN-topics"), "--format", "csv", "-o", str(out)])
    assert code == 0, said
    assert {path.parent for path in tmp_path.rglob("*") if path.is_file()} == {out}
    names = {path.name for path in out.iterdir()}
    assert names > {f"{name}.csv" for name in NAMES}
    assert len(names) == len(STRANGE)


def test_a_source_named_by_dots_is_never_a_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a" / "bag" / "sub").mkdir(parents=True)
    for file in (BAGS / "l").iterdir():
        shutil.copy(file, tmp_path / "a" / "bag")
    monkeypatch.chdir(tmp_path / "a" / "bag" / "sub")
    for number, command in enumerate(("import rosbag", "replay")):
        out = tmp_path / "out" / str(number)
        code, said = said_by([*command.split(), "..", "-o", str(out)])
        assert code == 0, said
        assert (out / "bag" / "metadata.yaml").is_file()
    assert {path.name for path in tmp_path.iterdir()} == {"a", "out"}


@pytest.mark.parametrize("name", ["../../up", f"../{EVIL}", EVIL, ".."])
def test_a_group_is_never_a_path(shop: Shop, name: str) -> None:
    words = shop.words("discover IN0.csv IN1.csv --model IN-model.yaml -o OUT-group")
    code, said = said_by([*words, "--group", f"{name}=*"])
    assert code == 2
    assert "must be NAME=PATTERN" in said
    assert len(said.splitlines()) == 1
