"""Tests that no node remains and the bag is complete, however a run is ended."""

import contextlib
import fcntl
import os
import pty
import re
import select
import shutil
import signal
import subprocess
import sys
import termios
import time
from pathlib import Path

import pytest

from slosh_bag.reader import BagReader
from slosh_testing.live_processes import (
    PATIENCE,
    alive,
    children,
    live_process,
    node_name,
    recorded,
)
from slosh_testing.small_disk import small_disk

REPORT = {"report.html", "result.json"}
EACH = [
    signal.SIGTERM,
    pytest.param(signal.SIGINT, marks=pytest.mark.long),
    pytest.param(signal.SIGHUP, marks=pytest.mark.long),
]


def assert_finished(bag):
    """Asserts that the recorder has finished the bag."""
    reader = BagReader(bag)
    assert sum(1 for _ in reader.messages(["/slosh/estimate"])) > 100
    assert reader.warnings == []


def assert_gone(nodes):
    assert not [name for name, pid in nodes.items() if alive(pid)]


def reports(folder):
    """Returns the files of a report, complete or not."""
    others = ("bag", "logs", "settings.yaml")
    return {path.name for path in folder.iterdir() if path.name not in others}


@pytest.fixture
def demo(tmp_path):
    """Starts a demonstration that would run for minutes; yields it and its folder."""
    folder = tmp_path / "out" / "latest"
    words = ("demo", "--motion", "l", "--repeat", "100", "-o", str(folder.parent))
    with live_process(*words, output=tmp_path / "words") as running:
        running.wait_for_nodes(5)
        running.wait_until_ready()
        running.wait_for_recording(folder / "bag")
        yield running, folder


@pytest.mark.long
@pytest.mark.parametrize("number", EACH)
def test_a_signal_ends_all_nodes_and_gives_the_report(demo, number):
    running, folder = demo
    nodes = running.nodes()
    running.process.send_signal(number)
    running.process.send_signal(number)  # as systemd and shells may
    assert running.end() == 0, running.said
    assert_gone(nodes)
    assert_finished(folder / "bag")
    assert reports(folder) == REPORT
    assert (folder / "report.html").read_text().rstrip().endswith("</html>")
    assert "limit events" in running.said
    assert "Traceback" not in running.said


@pytest.mark.long
def test_a_run_whose_folder_was_deleted_tells_what_is_lost(demo):
    running, folder = demo
    run = folder.resolve()
    shutil.rmtree(run)
    running.process.send_signal(signal.SIGINT)
    assert running.end() == 1, running.said
    assert re.search(r"lost messages +\d{3,}", running.said), running.said
    assert "the bag was deleted" in running.said
    assert "Traceback" not in running.said
    assert reports(run) == REPORT
    assert int(BagReader(run / "bag").metadata()["messages_lost"]) > 100


@pytest.mark.long
def test_a_run_whose_disk_is_full_at_its_end_tells_what_is_lost(tmp_path):
    disk = tmp_path / "disk"
    disk.mkdir()
    words = ("demo", "--motion", "l", "--repeat", "100", "-o", str(disk / "out"))
    with (
        small_disk(disk, "size=48m"),
        live_process(*words, output=tmp_path / "words") as running,
    ):
        running.wait_until_ready()
        running.wait_for_recording(disk / "out" / "latest" / "bag")
        with contextlib.suppress(OSError), (disk / "ballast").open("wb", buffering=0) as ballast:
            while True:
                ballast.write(bytes(1_000_000))
        running.wait_for(lambda: "nothing has been written" in running.said, "the full disk")
        running.process.send_signal(signal.SIGINT)
        assert running.end() == 1, running.said
    assert re.search(r"lost messages +\d", running.said), running.said
    assert "No space left on device" in running.said
    assert "no report: " in running.said
    assert "Traceback" not in running.said


@pytest.mark.long
def test_a_second_signal_ends_the_report_at_once(demo):
    running, folder = demo
    running.process.send_signal(signal.SIGTERM)
    running.wait_for(lambda: "writing the report" in running.said, "the report")
    assert_gone(running.nodes())
    running.process.send_signal(signal.SIGTERM)
    assert running.end() == 1
    assert_finished(folder / "bag")
    assert reports(folder) == set()
    assert "report skipped" in running.said
    assert "Traceback" not in running.said


@pytest.mark.long
def test_a_signal_while_the_report_is_written_lets_it_finish(tmp_path):
    folder = tmp_path / "out" / "latest"
    words = ("demo", "--motion", "l", "-o", str(folder.parent))
    with live_process(*words, output=tmp_path / "words") as running:
        nodes = running.wait_for_nodes(5)
        running.wait_for(lambda: not any(map(alive, nodes.values())), "the nodes' end")
        running.process.send_signal(signal.SIGTERM)
        assert running.end() == 0, running.said
        assert reports(folder) == REPORT


@pytest.mark.parametrize("number", EACH)
def test_a_signal_during_the_start_leaves_no_node_and_gives_a_report(tmp_path, number):
    folder = tmp_path / "out" / "latest"
    with live_process("demo", "-o", str(folder.parent), output=tmp_path / "words") as running:
        running.wait_for_nodes(1)
        running.process.send_signal(number)
        assert running.end() == 1
        assert_gone(running.nodes())
        assert reports(folder) == REPORT
        assert f"the run was stopped ({number.name}) before all nodes were" in running.said
        assert "Traceback" not in running.said


@pytest.mark.long  # the quick one is that of NodeGroup, with nodes that do nothing
def test_the_nodes_of_a_killed_command_end_and_the_recorder_last(demo):
    running, folder = demo
    nodes = dict(running.nodes())
    recorder = nodes.pop("recorder")
    running.process.kill()
    deadline = time.monotonic() + PATIENCE
    while alive(recorder):
        assert time.monotonic() < deadline, f"still there: {[n for n in nodes if alive(nodes[n])]}"
        time.sleep(0.005)
    assert_gone(nodes)
    assert_finished(folder / "bag")
    for log in (folder / "logs").glob("*.log"):
        assert "parent process exited" in log.read_text(), log.name


def first_nodes(process):
    """Waits until a command has started a node; returns process ids by name."""
    deadline = time.monotonic() + PATIENCE
    while not (found := {node_name(pid): pid for pid in children(process.pid)}):
        assert time.monotonic() < deadline, "no node is started"
        time.sleep(0.005)
    return found


def command_for_minutes(folder):
    command = [sys.executable, "-m", "slosh_bringup.cli", "demo", "--motion", "l"]
    return [*command, "--repeat", "100", "-o", str(folder.parent)]


def read_until_recording(descriptor, bag):
    """Reads a command's output, so that it never blocks, until the recording begins."""
    deadline = time.monotonic() + PATIENCE
    while recorded(bag) < 400_000:
        assert time.monotonic() < deadline, "nothing is recorded"
        if select.select([descriptor], [], [], 0.02)[0]:
            os.read(descriptor, 65536)


@contextlib.contextmanager
def on_a_terminal(folder):
    """Runs a command on its own pseudo-terminal; yields its process and the other end."""
    keyboard, screen = pty.openpty()
    process = subprocess.Popen(
        command_for_minutes(folder),
        stdin=screen, stdout=screen, stderr=screen,
        start_new_session=True,
        preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
    )  # fmt: skip
    os.close(screen)
    try:
        yield process, keyboard
    finally:
        process.kill()
        process.wait()


@pytest.mark.long
@pytest.mark.parametrize("early", [False, True])
def test_a_closed_terminal_ends_all_nodes_and_gives_the_report(tmp_path, early):
    """The kernel sends SIGHUP, and every write to the terminal fails."""
    folder, nodes = tmp_path / "out" / "latest", {}
    with on_a_terminal(folder) as (process, keyboard):
        try:
            if early:
                nodes = first_nodes(process)
            else:
                read_until_recording(keyboard, folder / "bag")
        finally:
            os.close(keyboard)
        assert process.wait(PATIENCE) == int(early)
        assert_gone(nodes)
    if not early:
        assert_finished(folder / "bag")
    assert reports(folder) == REPORT


@pytest.mark.parametrize("what", ["signal.raise_signal(signal.SIGINT)", "1 / 0"])
def test_ctrl_c_in_a_destructor_is_not_forgotten(what):
    program = f"""
import signal, sys, time
from slosh_bringup.cli import main

class Fragile:
    def __del__(self):
        {what}

def run(*_):
    Fragile()
    time.sleep(0.5)
    print("went on")

main._run = run
sys.exit(main.command())
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    if "SIGINT" in what:
        assert (done.returncode, done.stdout, done.stderr) == (1, "", "slosh: stopped\n")
    else:
        assert done.stdout == "went on\n"
        assert "ZeroDivisionError" in done.stderr


BEFORE_OURS = r"Fatal Python error: init|Traceback .*\n  File .*, line 0, in <module>\nKeyboard"
"""What the interpreter itself prints when it is interrupted before the first line of a program."""


def test_ctrl_c_while_it_starts_is_no_traceback(tmp_path):
    said = []
    for moment in range(2, 30, 3):  # hundredths of a second: where it is then is left to chance
        with (tmp_path / "words").open("w+") as words:
            process = subprocess.Popen(
                [Path(sys.prefix) / "bin" / "slosh", "doctor"], stdout=words, stderr=words
            )
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(0.01 * moment)
            process.send_signal(signal.SIGINT)
            process.wait(60)
            words.seek(0)
            said.append(words.read())
    # The interpreter's own start is not ours: on a busy machine it takes longer than 20 ms.
    ours = [text for text in said if not re.match(BEFORE_OURS, text)]
    assert len(ours) > 3
    assert "Traceback" not in "".join(ours)
