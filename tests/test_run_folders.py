"""Tests that each run of a cell has its own folder and changes no earlier run."""

import os
import re
import shutil
import signal
import subprocess
import sys
from datetime import datetime

import pytest

from slosh_bag.reader import BagReader
from slosh_bringup.cli.main import main
from slosh_bringup.live.run_folder import new_run
from slosh_bringup.processes import config_folder
from slosh_testing.live_processes import until

PATIENCE = 60.0
NOW = datetime(2026, 11, 22, 10, 15, 0)
NAME = re.compile(r"\d{4}-\d\d-\d\dT\d\d-\d\d-\d\d(-\d+)?")


@pytest.fixture
def cell(tmp_path, domain, monkeypatch):
    """Starts `slosh cell` in a folder; ends it after the test."""
    monkeypatch.chdir(tmp_path)
    for name in ("model.yaml", "camera.yaml"):
        shutil.copy(config_folder() / name, tmp_path / name)
    (tmp_path / "robot.yaml").write_text("{model: model.yaml, calibration: camera.yaml}")
    processes = []

    def start(**environment):
        processes.append(
            subprocess.Popen(
                [sys.executable, "-m", "slosh_bringup.cli", "cell", "--config", "robot.yaml"],
                stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                env={**os.environ, **environment},
            )
        )  # fmt: skip
        return processes[-1]

    yield start
    for process in processes:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
        process.communicate(timeout=PATIENCE)


def runs(output):
    return sorted(path for path in output.glob("*") if NAME.fullmatch(path.name))


def contents(folder):
    return {path: path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def recorded(run):
    """Returns whether a run's bag has a message on disk."""
    begun = any(file.stat().st_size for file in (run / "bag").glob("*.mcap"))
    return begun and any(info.count for info in BagReader(run / "bag").topics().values())


def stop(process):
    process.send_signal(signal.SIGINT)
    return process.communicate(timeout=PATIENCE)


@pytest.mark.long
def test_a_second_cell_leaves_the_first_ones_recording(cell, tmp_path):
    output = tmp_path / "out" / "cell"
    first = cell()
    until(lambda: len(runs(output)) == 1, "the run's folder")
    (run,) = runs(output)
    until(lambda: recorded(run), "the nodes' diagnostics in the bag")
    _, told = stop(first)
    assert f"slosh cell: this run is in {run.relative_to(tmp_path)}\n" in told
    before = contents(run)
    assert any(path.suffix == ".mcap" for path in before)
    assert (output / "latest").resolve() == run
    second = cell()
    until(lambda: len(runs(output)) == 2, "the second run's folder")
    until(lambda: list((runs(output)[1] / "bag").glob("*.mcap")), "the second bag")
    assert contents(run) == before
    stop(second)
    assert contents(run) == before
    assert (output / "latest").resolve() == runs(output)[1]
    assert os.readlink(output / "latest") == runs(output)[1].name


def test_starts_in_one_second_have_folders_of_their_own(tmp_path):
    """Processes that all ask at the same moment."""
    program = """
import sys
from datetime import datetime
from pathlib import Path
from slosh_bringup.live.run_folder import new_run
sys.stdin.read()
print(new_run(Path(sys.argv[1]), datetime(2026, 11, 22, 10, 15), print))
"""
    command = [sys.executable, "-c", program, str(tmp_path / "out")]
    processes = [
        subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        for _ in range(6)
    ]
    for process in processes:
        process.stdin.close()
    found = {process.stdout.read().strip() for process in processes}
    assert all(process.wait(PATIENCE) == 0 for process in processes)
    names = ["2026-11-22T10-15-00", *(f"2026-11-22T10-15-00-{n}" for n in range(2, 7))]
    assert found == {str(tmp_path / "out" / name) for name in names}
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == sorted([*names, "latest"])
    assert (tmp_path / "out" / "latest").is_dir()


@pytest.mark.parametrize("what", ["folder", "file"])
def test_what_is_no_link_but_called_latest_stays(tmp_path, what):
    latest, told = tmp_path / "latest", []
    mine = latest / "mine" if what == "folder" else latest
    mine.parent.mkdir(exist_ok=True)
    mine.write_text("precious")
    run = new_run(tmp_path, NOW, told.append)
    assert run.is_dir()
    assert told == [f"{latest}: is not a link and is left unchanged"]
    assert mine.read_text() == "precious"
    assert sorted(tmp_path.iterdir()) == [run, latest]


def test_a_link_goes_from_run_to_run(tmp_path):
    (tmp_path / "latest").symlink_to("gone")
    for number in ("", "-2", "-3"):
        run = new_run(tmp_path, NOW, print)
        assert run.name == f"2026-11-22T10-15-00{number}"
        assert os.readlink(tmp_path / "latest") == run.name


def test_an_output_that_is_no_folder_is_one_line(tmp_path, capsys):
    (tmp_path / "file").write_text("mine")
    assert main(["demo", "-o", str(tmp_path / "file")]) == 2
    told = capsys.readouterr()
    assert (told.out, told.err) == ("", f"slosh demo: {tmp_path / 'file'}: File exists\n")
    assert (tmp_path / "file").read_text() == "mine"
