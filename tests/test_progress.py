"""Tests progress output: a bar of any width on a terminal, plain lines elsewhere."""

import fcntl
import json
import os
import pty
import re
import struct
import subprocess
import sys
import termios
from pathlib import Path

import cv2
import numpy as np
import pytest
from tqdm.utils import disp_len

from slosh_bag.bag_writer import BagWriter
from slosh_bringup.cell.renderer import CupRenderer
from slosh_bringup.cli import progress as module
from slosh_bringup.cli.main import main
from slosh_bringup.cli.progress import IN_SECONDS, Progress, Unit, progress_bar
from slosh_bringup.processes import config_folder
from slosh_camera.calibrate.camera_file import read_calibration
from slosh_motion.tables.motion_table import MotionTable, write_motion_table

ROOT = Path(__file__).parents[1]
CAMERA = config_folder() / "camera.yaml"
PATIENCE = 100.0
HEADER, DATA = "std_msgs/msg/Header", bytes.fromhex("000100000000000000000000020000006100")
SECOND = 1_000_000_000
LONGEST_LOG = 12
"""Lines of progress that a command of some seconds may leave in a log: fewer than one per 10 %."""


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    """Creates inputs on which commands work for about two seconds."""
    folder = tmp_path_factory.mktemp("inputs")
    with BagWriter(folder / "played") as writer:
        writer.add_topic("/header", HEADER)
        for number in range(161):
            writer.write("/header", DATA, SECOND + number * 10_000_000)
    with BagWriter(folder / "bag") as writer:
        writer.add_topic("/header", HEADER)
        for number in range(300_000):
            writer.write("/header", DATA, number)
    (folder / "images").mkdir()
    image = CupRenderer(read_calibration(CAMERA).view).render_colour(0.0, 0.006)
    for number in range(60):
        cv2.imwrite(str(folder / "images" / f"frame_{number}.jpg"), image)
    t = np.arange(60_000) * 0.002
    write_motion_table(folder / "run.csv", MotionTable(t, np.zeros((len(t), 3))))
    return folder


# The command; what its progress says; the end of each line, with the unit.
COMMANDS = {
    "play": ("play IN/played --wait 0", "play played", r"\d+\.\d/1\.6 s"),
    "detect": (
        f"detect IN/images --camera {CAMERA} --jobs 1 -o OUT/a.csv", "detect", r"\d+/60 images"
    ),
    "import": ("import table IN/run.csv -o OUT/new", "run.csv", r"\d+/60000 rows"),
    "export": (
        "export IN/bag --topic header -o OUT/a.csv", "export", r"\d+/300000 messages"
    ),
    "recover": ("recover IN/bag -o OUT/new", "recover", r"\d+\.\d/\d+\.\d MB"),
    "replay": (f"replay {ROOT / 'bags'} --jobs 1", "replay", r"\d/9 bags"),
}  # fmt: skip
QUICK, LONG = ("play", "import"), pytest.mark.long
commands = pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in QUICK else LONG) for name in COMMANDS]
)
# What it does takes seconds by the clock; the others show nothing where a machine is fast.
ALWAYS = "play"


def command_of(name, inputs, output):
    line, title, unit = COMMANDS[name]
    words = line.replace("IN", str(inputs)).replace("OUT", str(output)).split()
    return [sys.executable, "-m", "slosh_bringup.cli", *words], title, unit


def on_terminal(command, columns, term="xterm"):
    """Runs a command on a pseudo-terminal; returns its output."""
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
    environment = {**os.environ, "TERM": term}
    process = subprocess.Popen(
        command, stdin=theirs, stdout=theirs, stderr=theirs, env=environment
    )
    os.close(theirs)
    seen = b""
    try:
        while chunk := os.read(ours, 65536):
            seen += chunk
    except OSError:  # the other end is closed
        pass
    os.close(ours)
    assert process.wait(PATIENCE) == 0, seen.decode()
    return seen.decode()


def in_pipe(command):
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=PATIENCE, check=False,
        env={**os.environ, "TERM": "xterm"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done


def frames(seen, title):
    """Returns the successive states of the progress bar in a terminal's output."""
    return [frame.rstrip() for frame in re.split(r"[\r\n]+", seen) if frame.startswith(title[:6])]


@pytest.mark.first(1)
@commands
def test_in_a_pipe_it_is_a_few_whole_lines(inputs, tmp_path, domain, name):
    command, title, unit = command_of(name, inputs, tmp_path)
    done = in_pipe(command)
    assert "\r" not in done.stderr
    assert "█" not in done.stderr
    lines = [line for line in done.stderr.splitlines() if line.startswith(title)]
    assert (name == ALWAYS) <= len(lines) <= LONGEST_LOG
    assert all(re.fullmatch(rf"{title}: \d+%, {unit}", line) for line in lines), lines
    assert all(line.startswith(f"{title}: 100%, ") for line in lines[-1:])
    assert title + ":" not in done.stdout


@pytest.mark.first(1)
@pytest.mark.parametrize("columns", [100, 40])
@commands
def test_on_a_terminal_bar_and_unit_are_whole(inputs, tmp_path, domain, name, columns):
    command, title, unit = command_of(name, inputs, tmp_path)
    seen = frames(on_terminal(command, columns), title)
    drawn = [frame for frame in seen if "[" not in frame]  # the player's own words begin with it
    assert name != ALWAYS or len(drawn) > 2
    shape = rf"{title[:6]}.*: +\d+%(\|.+\|)? {unit}"
    assert all(re.fullmatch(shape, frame) for frame in drawn), drawn
    assert all(disp_len(frame) < columns for frame in drawn)
    assert all(re.match(rf"{title[:6]}.*: 100%", frame) for frame in drawn[-1:])
    assert columns < 100 or all("█" * 30 in frame for frame in drawn[-1:])


@pytest.mark.first(1)
@pytest.mark.parametrize("name", ["detect", "recover", "replay"])
def test_json_is_all_of_standard_output(inputs, tmp_path, capfd, name):
    (_, _, _, *words), _, _ = command_of(name, inputs, tmp_path)
    assert main([*words, "--json"]) == 0
    assert json.loads(capfd.readouterr().out)


# --- when lines come, by a clock of the test's own ---------------------------------------------


class Clock:
    now = 0.0

    def monotonic(self):
        return self.now


@pytest.fixture
def clock(monkeypatch):
    clock = Clock()
    monkeypatch.setattr(module, "time", clock)
    return clock


@pytest.fixture
def told(capsys):
    """Returns all plain lines of an output."""
    return lambda: capsys.readouterr().err.splitlines()


def test_ten_seconds_and_ten_percent_pass_between_two_lines(clock, told):
    with Progress("work", 3600.0, IN_SECONDS, delay=0.0) as progress:
        for tick in range(36_001):
            clock.now = 0.1 * tick
            progress.reach(clock.now)
    lines = told()
    assert len(lines) == 11
    assert lines[0] == "work: 0%, 0.0/3600.0 s"
    assert lines[-1] == "work: 100%, 3600.0/3600.0 s"


@pytest.mark.parametrize(
    ("step", "lines"),
    [(0.3, ["work: 40%, 4/10 rows", "work: 100%, 10/10 rows"]), (0.09, [])],
)
def test_one_that_takes_a_second_begins_to_tell_then(clock, told, step, lines):
    with Progress("work", 10.0, Unit("rows")) as progress:
        for tick in range(11):
            clock.now = step * tick
            progress.reach(float(tick))
    assert told() == lines


def test_what_fails_or_is_stopped_is_not_told_as_done(told):
    def fail():
        with progress_bar("motion", 10.0) as tell:
            tell(3.0, "")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    with progress_bar("motion", 10.0) as tell:
        tell(3.0, "")
        tell(3.1, "stopping")
    with progress_bar("motion", 10.0) as tell:
        tell(9.0, "")
    begun = "motion: 0%, 0.0/10.0 s"
    assert told() == [
        begun, begun, "motion: 31%, 3.1/10.0 s", begun, "motion: 100%, 10.0/10.0 s"
    ]  # fmt: skip
