"""Tests `slosh discover`: selection of motions, output files and errors for invalid input."""

import json
import shlex
import shutil
from base64 import b64encode
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from slosh_bringup import discovery_task
from slosh_bringup.cli.main import main
from slosh_bringup.processes import config_folder
from slosh_discovery.discover.finding import Verdict, WorstMoment
from slosh_discovery.discovering import recorded_model
from slosh_discovery.errors import SloshDiscoveryError
from slosh_model.model_text import parse_model, read_model
from slosh_motion.tables.motion_table import MotionTable, read_motion_table, write_motion_table
from slosh_testing.commands import complaint
from slosh_testing.example_finding import FOUND, example_finding, example_inputs, example_motion
from slosh_testing.reports import grey_png

MODEL = str(config_folder() / "model.yaml")
BAGS = Path(__file__).parents[3] / "bags"


class Discovery:
    """Replaces the fits: records the arguments and returns a fixed result."""

    def __init__(self):
        self.verdict, self.calls, self.drawn, self.worst = Verdict.NAMED, [], False, ()

    def __call__(self, motions, base, holdout=(), *, progress=None, threads=None):
        self.calls.append((motions, base, holdout, threads))
        progress("fitting", 0.5)
        finding = example_finding(self.verdict)
        # Charts take most of the time; one test looks for them.
        shown = finding.motions if self.drawn else ()
        return replace(finding, base=base, motions=shown, worst=self.worst)

    @property
    def names(self):
        """Returns the names of the fitted and of the held-out motions in the last call."""
        motions, _, holdout, _ = self.calls[-1]
        return [motion.name for motion in motions], [motion.name for motion in holdout]


@pytest.fixture
def discovery(monkeypatch):
    found = Discovery()
    monkeypatch.setattr(discovery_task, "discover", found)
    return found


@pytest.fixture
def tables(tmp_path):
    """Motion tables of five measured motions, each with different noise."""
    paths = []
    for number in range(1, 6):
        path = tmp_path / f"run_{number}.csv"
        write_table(path, number)
        paths.append(str(path))
    return paths


def write_table(path, seed, *, measured=True):
    """Writes a table of the example motion, with measured heights at 50 Hz."""
    inputs, motion = example_inputs(), example_motion("any", seed)
    msh = np.full(len(inputs.t), np.nan)
    msh[::10] = np.interp(inputs.t[::10], motion.t, np.nan_to_num(motion.msh))
    msh = msh if measured else None
    write_motion_table(path, MotionTable(inputs.t, inputs.acceleration, msh=msh))


def test_it_writes_model_document_page_and_prints_the_verdict(capsys, discovery, tables, tmp_path):
    output, discovery.drawn = tmp_path / "out", True
    assert main(["discover", *tables, "--model", MODEL, "-o", str(output)]) == 0
    captured = capsys.readouterr()
    lines = captured.out.splitlines()
    assert lines[0].endswith("lacks fill_level and vertical_acceleration (confidence 0.96).")
    assert lines[-1] == f"report {output / 'report.html'}"
    assert "fitting" in captured.err
    assert parse_model((output / "model.yaml").read_text()) == FOUND
    assert json.loads((output / "discovery.json").read_text())["verdict"] == "named"
    assert "<svg" in (output / "report.html").read_text(encoding="utf-8")
    assert sorted(path.name for path in output.iterdir()) == [
        "discovery.json", "model.yaml", "report.html",
    ]  # fmt: skip


def test_json_is_all_that_is_printed(capsys, discovery, tables, tmp_path):
    output = tmp_path / "o"
    assert main(["discover", *tables, "--model", MODEL, "-o", str(output), "--json"]) == 0
    assert capsys.readouterr().out == (output / "discovery.json").read_text()


def test_every_third_motion_is_held_out_and_the_reader_is_told(
    capsys, discovery, tables, tmp_path
):
    assert main(["discover", *tables, "--model", MODEL, "-o", str(tmp_path / "o")]) == 0
    assert discovery.names == (["run_1", "run_2", "run_4", "run_5"], ["run_3"])
    assert discovery.calls[0][1] == read_model(MODEL)
    captured = capsys.readouterr()
    note = "every third motion is held out: 1 of 5"
    assert note in captured.err
    assert note in captured.out
    assert note in json.loads((tmp_path / "o" / "discovery.json").read_text())["remarks"]


def test_the_separating_motion_is_a_table_that_can_be_played(capsys, discovery, tables, tmp_path):
    discovery.verdict, output = Verdict.AMBIGUOUS, tmp_path / "a folder"
    words = [tables[0], "--model", MODEL, "-o", str(output)]
    assert main(["discover", *words]) == 0
    table, inputs = read_motion_table(output / "separating_1.csv"), example_inputs()
    assert np.array_equal(table.acceleration, inputs.acceleration)
    assert np.array_equal(table.attitude, inputs.attitude)
    assert table.measured is None
    text = capsys.readouterr().out
    assert f"slosh discover {tables[0]} RECORDING --model {MODEL} -o '{output}_2'" in text
    assert f"slosh simulate '{output}/model.yaml' '{output}/separating_1.csv'" in text


def printed_commands(text):
    """Returns the slosh commands that a discovery prints, split into words."""
    return [shlex.split(line.strip()) for line in text.splitlines() if "  slosh " in f"  {line}"]


def ready_to_run(words, recording):
    """Replaces the word RECORDING in a command by the path of a recording."""
    return [str(recording) if word == "RECORDING" else word for word in words]


@pytest.mark.first(1)
@pytest.mark.parametrize("kind", ["file", "folder of tables", "foreign table", "folder of bags"])
def test_each_printed_command_can_be_typed(capsys, discovery, tables, tmp_path, day, kind):
    options = []
    if kind == "folder of tables":
        given = tmp_path / "my tables"
        given.mkdir()
        for table in tables:
            shutil.move(table, given)
    elif kind == "foreign table":
        given = tmp_path / "foreign.csv"
        given.write_text(Path(tables[0]).read_text().replace("t,", "Time,", 1))
        options = ["--columns", "t=Time,ax=ax,ay=ay,az=az,msh=msh"]
    elif kind == "folder of bags":
        given = tmp_path / "days"
        shutil.copytree(day, given / "c3")
    else:
        given = Path(tables[0])
    output = str(tmp_path / "o")
    assert main(["discover", str(given), "--model", MODEL, "-o", output, *options]) == 0
    found = printed_commands(capsys.readouterr().out)
    assert found
    for words in found:
        if words[1] != "call":  # that needs a running cell
            assert main(ready_to_run(words[1:], given)) in (0, 1), words
        capsys.readouterr()


@pytest.fixture
def day():
    """Path of a recording of the simulated cell."""
    if not (BAGS / "c3").exists():
        pytest.skip("the recordings are not there")
    return BAGS / "c3"


def test_a_day_brings_its_own_model(capsys, discovery, day, tmp_path):
    words = ["discover", "--from-bag", str(day), "-o", str(tmp_path / "o")]
    assert main(words) == 0
    motions, base, *_ = discovery.calls[0]
    assert base == recorded_model(day)
    assert base.container.radius > 0.0
    assert all(motion.name.startswith("c3") for motion in motions)
    text = capsys.readouterr().out
    assert f"slosh replay {day} --model {tmp_path / 'o' / 'model.yaml'}" in text
    document = json.loads((tmp_path / "o" / "discovery.json").read_text())
    assert document["schema"] == 1


def test_the_page_shows_the_camera_s_image_of_the_worst_moment(
    monkeypatch, discovery, day, tmp_path
):
    discovery.worst = (WorstMoment("c3#1", 1.0, 0.01, 0.02, 0.01),)

    def pictures(run, stamps):
        return dict.fromkeys(stamps, (grey_png(), 0.0123)) if run.path == day else {}

    monkeypatch.setattr(discovery_task, "pictures_at", pictures)
    assert main(["discover", "--from-bag", str(day), "-o", str(tmp_path / "o")]) == 0
    page = (tmp_path / "o" / "report.html").read_text(encoding="utf-8")
    assert "A: c3#1, 1.00 s, 12.3 mm" in page
    assert b64encode(grey_png()).decode() in page


def test_a_model_must_come_from_somewhere(capsys, discovery, tables, tmp_path):
    output = tmp_path / "o"
    assert "--model" in complaint(capsys, "discover", tables[0], "-o", output)
    line = complaint(capsys, "discover", "--from-bag", tables[0], "-o", output)
    assert "contains no model" in line


def test_what_is_wrong_is_one_line(capsys, discovery, tables, tmp_path):
    output, bare = tmp_path / "o", tmp_path / "bare.csv"
    write_table(bare, 1, measured=False)
    bad = tmp_path / "bad.yaml"
    bad.write_text("container: {radius: 0.05, fill_height: 0.07, colour: red}")
    end = ["--model", MODEL, "-o", output]
    for words, match in (
        ([tmp_path / "none.csv", *end], "none.csv"),
        ([tmp_path / "none", *end], "none: no such file or folder"),
        ([bare, *end], "bare.csv"),
        ([tables[0], "--model", bad, "-o", output], "bad.yaml:1: unknown key 'container.colour'"),
        ([tables[0], "--model", tmp_path / "no.yaml", "-o", output], "no.yaml"),
        ([tables[0], tables[0], *end], "is in DATA twice"),
        ([tables[0], "--holdout", tables[0], *end], "is in both DATA and --holdout"),
        ([*tables, "--jobs", "0", *end], "--jobs 0: must be at least 1"),
        ([*tables, "--motions", "-1", *end], "--motions -1: must be at least 1"),
    ):
        line = complaint(capsys, "discover", *words)
        assert line.startswith("slosh discover: ")
        assert match in line
    assert discovery.calls == []


def test_a_folder_that_takes_no_file_is_told_before_the_work(capsys, discovery, tables, tmp_path):
    file = tmp_path / "file"
    file.write_text("")
    for output in (file, "/proc/nowhere", "/proc"):
        line = complaint(capsys, "discover", tables[0], "--model", MODEL, "-o", output)
        assert str(output) in line
    assert discovery.calls == []


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["--group", "late"], "--group late: must be NAME=PATTERN"),
        (["--group", "a/b=*"], "--group a/b=*: must be NAME=PATTERN"),
        (["--group", "early=run_1"], "motion run_2 matches none of the groups"),
        (["--group", "a=*", "--group", "b=run_1"], "motion run_1 matches groups a, b"),
    ],
)
def test_groups_that_do_not_part_the_motions_are_one_clear_error(
    capsys, discovery, tables, tmp_path, words, expected
):
    line = complaint(capsys, "discover", *tables, *words, "--model", MODEL, "-o", tmp_path / "o")
    assert expected in line
    assert discovery.calls == []


def test_a_note_stands_once_in_the_terminal_and_in_the_results(
    discovery, tables, tmp_path, capsys
):
    out = tmp_path / "out"
    assert main(["discover", tables[0], "--model", MODEL, "-o", str(out)]) == 0
    note = "no motion is held out: the gap is shown on the motions of the fit"
    assert capsys.readouterr().err.count(note) == 1
    assert json.loads((out / "discovery.json").read_text())["remarks"].count(note) == 1


def test_what_was_told_before_an_error_is_told(monkeypatch, tables, tmp_path, capsys):
    def prepared(request, tell):
        tell("the axes look turned")
        raise SloshDiscoveryError("run_2.csv: is empty")

    monkeypatch.setattr(discovery_task, "prepare", prepared)
    out = tmp_path / "out"
    assert main(["discover", *tables[:2], "--model", MODEL, "-o", str(out)]) == 2
    *_, note, error = capsys.readouterr().err.splitlines()
    assert note == "slosh discover: note: the axes look turned"
    assert error.endswith("run_2.csv: is empty")
    assert not out.exists()
