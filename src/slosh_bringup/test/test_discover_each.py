"""Tests `slosh discover --each`: recordings apart, in processes, interrupted and continued."""

import importlib
import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from slosh_bringup import discovery_task
from slosh_bringup.cli.main import main
from slosh_bringup.discovery_task import each_recording
from slosh_bringup.finished_work import NOTES
from slosh_bringup.many_files import KILLED, map_files
from slosh_bringup.processes import config_folder
from slosh_discovery.discover.finding import Verdict
from slosh_discovery.discovering import DiscoveryRequest
from slosh_motion.tables.motion_table import MotionTable, write_motion_table
from slosh_testing.commands import complaint
from slosh_testing.example_finding import example_finding, example_inputs, example_motion

MODEL = str(config_folder() / "model.yaml")
BAGS = Path(__file__).parents[3] / "bags"


@pytest.fixture
def tables(tmp_path):
    """Folder of four motion tables, each with different noise."""
    folder = tmp_path / "tables"
    folder.mkdir()
    for number in range(1, 5):
        write_table(folder / f"run_{number}.csv", number)
    return folder


def write_table(path, seed):
    inputs, motion = example_inputs(), example_motion("any", seed)
    msh = np.full(len(inputs.t), np.nan)
    msh[::10] = np.interp(inputs.t[::10], motion.t, np.nan_to_num(motion.msh))
    write_motion_table(path, MotionTable(inputs.t, inputs.acceleration, msh=msh))


@pytest.fixture
def examined(monkeypatch):
    """Replaces the fits; names of the motions that were examined, and one that interrupts."""
    names, stop = [], []

    def discover(motions, base, holdout=(), *, progress=None, threads=None):
        assert threads == 1
        if [motion.name for motion in motions] == stop:
            raise KeyboardInterrupt
        names.extend(motion.name for motion in motions)
        return replace(example_finding(Verdict.NAMED), base=base, motions=())

    monkeypatch.setattr(discovery_task, "discover", discover)
    return names, stop


def line(tables, output, *words):
    return ["discover", "--each", str(tables), "--model", MODEL, "-o", str(output), *words]


def contents(folder):
    """Returns the contents of all files of results by their names."""
    files = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def test_each_recording_has_its_folder_and_a_wrong_one_costs_no_other(
    capsys, examined, tables, tmp_path
):
    (tables / "run_2.csv").write_text("t,ax\n0,nothing\n")
    output = tmp_path / "out"
    assert main(line(tables, output, "--jobs", "1")) == 2
    told = capsys.readouterr()
    assert "run_2.csv" in told.err
    assert examined[0] == ["run_1", "run_3", "run_4"]
    assert sorted(path.name for path in output.iterdir()) == [
        NOTES, "discoveries.json", "run_1", "run_3", "run_4"
    ]  # fmt: skip
    rows = told.out.splitlines()
    assert rows[1].split() == [
        "run_1", "named", "fill_level", "+", "vertical_acceleration", "0.96", "100%"
    ]  # fmt: skip
    assert rows[2].split() == ["run_2", "not", "examined"]
    found = json.loads((output / "discoveries.json").read_text())
    assert [Path(row["recording"]).name for row in found] == [f"run_{n}.csv" for n in (1, 2, 3, 4)]
    assert "run_2.csv" in found[1]["error"]
    assert found[0]["verdict"] == "named"


def test_an_interrupted_run_goes_on_with_the_rest_and_gives_the_same(
    capsys, examined, tables, tmp_path
):
    names, stop = examined
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    assert main(line(tables, whole, "--jobs", "1")) == 0
    names.clear()
    stop[:] = ["run_3"]
    assert main(line(tables, parts, "--jobs", "1")) not in (0, 2)
    assert names == ["run_1", "run_2"]
    # As a killed process leaves it.
    (parts / "run_3" / ".slosh-0123456789ab").mkdir(parents=True)
    names.clear()
    stop.clear()
    capsys.readouterr()
    assert main(line(tables, parts, "--jobs", "1")) == 0
    assert names == ["run_3", "run_4"]
    assert capsys.readouterr().err.count("examined before") == 2
    expected = {
        name: data.replace(bytes(whole), bytes(parts)) for name, data in contents(whole).items()
    }
    assert contents(parts) == expected


def test_what_has_changed_is_examined_again(examined, tables, tmp_path):
    names, _ = examined
    output = tmp_path / "out"
    assert main(line(tables, output, "--jobs", "1")) == 0
    names.clear()
    write_table(tables / "run_2.csv", 9)
    assert main(line(tables, output, "--jobs", "1")) == 0
    assert names == ["run_2"]
    names.clear()
    assert main(line(tables, output, "--jobs", "1", "--time-unit", "s")) == 0
    assert names == [f"run_{number}" for number in (1, 2, 3, 4)]


def test_what_does_not_fit_is_one_line(capsys, examined, tables, tmp_path):
    output = tmp_path / "out"
    words = line(tables, output)[2:]
    said = complaint(capsys, "discover", *words, "--scheduler", "tcp://127.0.0.1:1")
    assert "--scheduler needs --each" in said
    both = [*words, "--each", "--jobs", "2", "--scheduler", "tcp://127.0.0.1:1"]
    assert "has its own workers" in complaint(capsys, "discover", *both)
    assert not output.exists()
    (output / "run_1").mkdir(parents=True)
    (output / "run_1" / "mine.txt").write_text("")
    assert "exists already" in complaint(capsys, *line(tables, output))
    assert examined[0] == []


WORK = """
import os
import signal

from slosh_bringup.discovery_task import discovery_task


def discover_or_die(request):
    if request.output.name == "c3":
        os.kill(os.getpid(), signal.SIGKILL)
    return discovery_task(request)
"""


@pytest.mark.long
def test_processes_give_the_same_and_a_killed_one_costs_its_own_recording(
    capsys, tmp_path, monkeypatch
):
    (tmp_path / "each_work.py").write_text(WORK)
    monkeypatch.syspath_prepend(str(tmp_path))
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    monkeypatch.setenv("PYTHONPATH", path.rstrip(os.pathsep))
    work = importlib.import_module("each_work")
    serial, parallel = tmp_path / "serial", tmp_path / "processes"
    bags = tuple(BAGS / name for name in ("l", "c3"))
    requests = each_recording(DiscoveryRequest(bags, parallel, from_bag=True))
    found = list(map_files(work.discover_or_die, requests, jobs=2, sizes=[1.0] * len(requests)))
    del sys.modules["each_work"]
    assert {one.item.output.name: one.error for one in found if one.error} == {"c3": KILLED}
    words = ["discover", "--each", "--from-bag", *map(str, bags)]
    assert main([*words, "-o", str(parallel), "--jobs", "2"]) == 0
    assert capsys.readouterr().err.count("examined before") == 1
    # In a process of its own: this one's OpenBLAS may have several threads, which round otherwise.
    command = [sys.executable, "-m", "slosh_bringup.cli", *words, "-o", str(serial), "--jobs", "1"]
    subprocess.run(command, check=True, capture_output=True)
    results = contents(serial)
    assert len(results) > 3 * len(requests)
    assert contents(parallel) == {
        name: data.replace(bytes(serial), bytes(parallel)) for name, data in results.items()
    }
