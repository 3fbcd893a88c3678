"""Tests the `slosh` command: output, files and errors."""

import gzip
import json
import re

import cv2
import numpy as np
import pyarrow.parquet
import pytest

from slosh_bringup.cli import demo
from slosh_bringup.cli.main import all_commands, main
from slosh_bringup.errors import SloshBringupError
from slosh_bringup.live.cell_setup import read_setup
from slosh_bringup.processes import config_folder
from slosh_testing.commands import complaint

MODEL = str(config_folder() / "model.yaml")


@pytest.fixture
def motion(tmp_path):
    t = np.arange(0.0, 3.0, 0.002)
    ay = 3.0 * np.sin(9.0 * t) * np.sin(np.pi * t / 3.0) ** 2
    path = tmp_path / "motion.csv"
    rows = np.column_stack([t, np.zeros_like(t), ay, np.zeros_like(t)])
    np.savetxt(path, rows, "%.9f", ",", header="t,ax,ay,az", comments="")
    return path


def test_help_names_every_command(capsys):
    assert main([]) == 2
    text = capsys.readouterr().out
    assert all(name in text for name in all_commands())


def test_it_tells_its_version(capsys):
    with pytest.raises(SystemExit) as caught:
        main(["--version"])
    assert caught.value.code == 0
    assert re.fullmatch(r"slosh \d+\.\d+\.\d+\n", capsys.readouterr().out)


def test_simulate_writes_heights(capsys, motion, tmp_path):
    output = tmp_path / "out.csv"
    assert main(["simulate", MODEL, str(motion), "-o", str(output), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    table = np.genfromtxt(output, delimiter=",", names=True)
    assert table.dtype.names == ("t", "msh", "azimuth", "sh_x", "sh_y")
    assert len(table) == facts["samples"] == 1500
    # The peak is looked for between the rows, too.
    assert 0.005 < table["msh"].max() <= facts["peak"] < 1.001 * table["msh"].max()
    assert np.allclose(table["msh"], np.hypot(table["sh_x"], table["sh_y"]))
    assert not table["sh_x"].any()  # a motion along y


def test_simulate_writes_what_a_sensor_would_read(capsys, motion, tmp_path):
    plain, output = tmp_path / "plain.csv", tmp_path / "out.csv"
    model = tmp_path / "model.yaml"
    cup = "container: {radius: 0.05, fill_height: 0.07}\n"
    effects = "effects: [{name: height_offset, offset: 0.002}, {name: time_offset, tau: 0.1}]\n"
    model.write_text(cup)
    assert main(["simulate", str(model), str(motion), "-o", str(plain)]) == 0
    model.write_text(cup + effects)
    capsys.readouterr()
    assert main(["simulate", str(model), str(motion), "-o", str(output), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    liquid = np.genfromtxt(plain, delimiter=",", names=True)
    read = np.genfromtxt(output, delimiter=",", names=True)
    for name in ("t", "azimuth", "sh_x", "sh_y"):
        assert np.array_equal(read[name], liquid[name])
    late = np.interp(read["t"] - 0.1, liquid["t"], liquid["msh"])
    assert read["msh"] == pytest.approx(late + 0.002, abs=2e-6)
    assert facts["peak"] == pytest.approx(read["msh"].max(), 1e-3)
    assert facts["peak"] == pytest.approx(liquid["msh"].max() + 0.002, 1e-3)
    assert facts["peak_time"] == pytest.approx(read["t"][np.argmax(read["msh"])], abs=2e-3)


def simulated(capsys, table, *options):
    """Simulates a table; returns the exit code, the results and other output."""
    code = main(["simulate", MODEL, str(table), "-o", "/dev/null", "--json", *options])
    captured = capsys.readouterr()
    return code, json.loads(captured.out), captured.err


def scaled(motion, path, factor=1.0, az=0.0, stretch=1.0):
    """Writes a motion table with scaled accelerations or times, as if in other units."""
    rows = np.loadtxt(motion, delimiter=",", skiprows=1)
    rows[:, 0] *= stretch
    rows[:, 1:] = rows[:, 1:] * factor + (0.0, 0.0, az)
    np.savetxt(path, rows, "%.9g", ",", header="t,ax,ay,az", comments="")
    return path


def test_simulate_says_whether_the_motion_stays_within_bounds(capsys, motion, tmp_path):
    code, facts, _ = simulated(capsys, motion)
    assert code == 0
    assert facts["within_validity"]
    assert facts["over_rim"] is False
    assert facts["over_limit"] is None
    peak, rim = facts["peak"], facts["freeboard"]
    assert simulated(capsys, motion, "--limit", str(1.01 * peak))[0] == 0
    code, facts, _ = simulated(capsys, motion, "--limit", str(0.99 * peak))
    assert (code, facts["over_limit"]) == (1, True)
    near = str(rim - 0.99 * peak)
    code, facts, _ = simulated(capsys, motion, "--rim-distance", near)
    assert (code, facts["over_rim"], facts["over_rim_distance"]) == (1, False, True)
    assert facts["wall"]["distance_to_rim"] == pytest.approx(rim - peak)
    assert main(["simulate", MODEL, str(motion), "-o", "/dev/null", "--rim-distance", "1"]) == 2
    assert "the distance of the still liquid" in capsys.readouterr().err
    wild = scaled(motion, tmp_path / "wild.csv", 6.0)
    code, facts, _ = simulated(capsys, wild)
    assert not facts["within_validity"]
    assert facts["peak"] > rim
    assert facts["over_rim"]
    assert main(["simulate", MODEL, str(wild), "-o", "/dev/null"]) == code == 1
    line = capsys.readouterr().out
    assert re.search(r"peak .* above the rim of 65 mm, outside validity \(acceleration 1", line)


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"factor": 1000.0}, r"is it in mm/s²\? It must be m/s²"),
        ({"az": 9.81}, r" is \(.*9\.81\) m/s².* gravity is contained, along \+z"),
        ({"factor": 1 / 9.81, "az": 1.0}, r"gravity is contained in g, along \+z"),
        ({"az": -8.81}, r"9\.81 was subtracted from a sensor that reports g"),
        ({"stretch": 100.0}, r"rows are 0\.2 s apart, the liquid's period is 0\.33 s"),
    ],
)
def test_simulate_doubts_units_that_look_wrong(capsys, motion, tmp_path, change, match):
    code, facts, said = simulated(capsys, scaled(motion, tmp_path / "other.csv", **change))
    assert code == 1
    (line,) = said.splitlines()
    (doubt,) = facts["warnings"]
    assert re.search(match, doubt)
    assert doubt in line
    assert "other.csv" in line
    assert simulated(capsys, motion)[1]["warnings"] == []


@pytest.mark.parametrize("command", ["simulate", "predict"])
def test_a_gap_in_the_motion_is_named_with_time_and_length(capsys, motion, tmp_path, command):
    """Gaps are reported beyond ten samples and an eighth of the liquid's period, 0.33 s."""
    rows = np.loadtxt(motion, delimiter=",", skiprows=1)
    for lost, is_gap in ((0.03, False), (0.06, True), (0.5, True)):
        kept = rows[(rows[:, 0] <= 0.6) | (rows[:, 0] >= 0.6 + lost)]
        table = tmp_path / "gap.csv"
        np.savetxt(table, kept, "%.9g", ",", header="t,ax,ay,az", comments="")
        output = ["-o", str(tmp_path / "out.csv")]
        code = main([command, MODEL, str(table), *output])
        said = capsys.readouterr().err
        assert (code != 0) is is_gap
        assert bool(re.search(rf"gap\.csv: .*a gap.*{lost:g} s .*0\.6", said)) is is_gap


def test_a_time_in_microseconds_is_refused_at_once_and_read_when_named(capsys, motion, tmp_path):
    """With times in microseconds read as seconds the rows are 2,000 s apart."""
    table = scaled(motion, tmp_path / "us.csv", stretch=1e6)
    line = complaint(capsys, "simulate", MODEL, str(table), "-o", "/dev/null")
    assert re.search(r"us\.csv: column 't': rows are 2000 apart.*probably us \(500 Hz\)", line)
    assert "--time-unit us" in line
    line = complaint(capsys, "simulate", MODEL, str(table), "-o", "/dev/null", "--time-unit", "s")
    assert "more than 86400 s" in line
    code, facts, _ = simulated(capsys, table, "--time-unit", "us")
    assert code == 0
    assert facts["peak"] == pytest.approx(simulated(capsys, motion)[1]["peak"], rel=1e-6)


@pytest.mark.parametrize("given", ["ax", "ax=", "=acc", "t=a,t=b"])
def test_columns_that_are_no_pairs_are_named(capsys, motion, given):
    line = complaint(capsys, "simulate", MODEL, str(motion), "-o", "/dev/null", "--columns", given)
    assert "--columns" in line
    assert "NAME=COLUMN" in line


def test_predict_and_plan_tell_the_same_doubts(capsys, motion, tmp_path):
    table = scaled(motion, tmp_path / "gravity.csv", az=9.81)
    sentence = simulated(capsys, table)[1]["warnings"][0]
    assert main(["predict", MODEL, str(table)]) == 1
    said = capsys.readouterr().err
    assert said.startswith("slosh predict: warning: ")
    assert sentence in said
    assert main(["predict", MODEL, str(motion)]) == 0
    assert capsys.readouterr().err == ""
    path = tmp_path / "path.csv"
    path.write_text("t,x,y,z\n0,0,0,0\n1,400,0,0\n")
    command = ["plan", MODEL, str(path), "--limit", "0.02", "-o", str(tmp_path / "plan.csv")]
    assert main(command) in (1, 2)
    assert "the path is 400 m long: are its positions in mm?" in capsys.readouterr().err


def test_simulate_refuses_what_no_container_undergoes(capsys, motion, tmp_path):
    table = tmp_path / "big.csv"
    table.write_text("t,ax,ay,az\n0,0,0,0\n0.01,0,-1e300,0\n")
    line = complaint(capsys, "simulate", MODEL, str(table), "-o", str(tmp_path / "out.csv"))
    assert re.search(r"big\.csv: line 3: an acceleration of 1e\+300 m/s² is not possible", line)


def test_simulate_writes_the_format_that_the_name_says(capfd, motion, tmp_path):
    plain, packed, parquet = (tmp_path / f"out{end}" for end in (".csv", ".csv.gz", ".parquet"))
    for output in (plain, packed, parquet):
        assert main(["simulate", MODEL, str(motion), "-o", str(output)]) == 0
    text = plain.read_text()
    assert gzip.decompress(packed.read_bytes()).decode() == text
    table = pyarrow.parquet.read_table(parquet)
    rows = np.genfromtxt(plain, delimiter=",", names=True)
    for name in rows.dtype.names:
        assert np.array_equal(table[name].to_numpy(), rows[name])
    capfd.readouterr()
    assert main(["simulate", MODEL, str(motion), "-o", "-"]) == 0
    captured = capfd.readouterr()
    assert captured.out == text
    assert "peak" in captured.err


def test_simulate_refuses_a_format_that_it_does_not_know(capsys, motion, tmp_path):
    for option, name in (("-o", "out.xls"), ("--plot", "out.jpg")):
        words = ["simulate", MODEL, str(motion), "-o", str(tmp_path / "out.csv")]
        assert name in complaint(capsys, *words, option, str(tmp_path / name))
    assert list(tmp_path.iterdir()) == [motion]


def test_simulate_draws_what_it_says(capsys, motion, tmp_path):
    png, svg = tmp_path / "out.png", tmp_path / "out.svg"
    for picture in (png, svg):
        _, facts, _ = simulated(capsys, motion, "--limit", "0.02", "--plot", str(picture))
    assert cv2.imread(str(png)).shape[:2] == (648, 1152)
    drawn = svg.read_text()
    assert f"{1e3 * facts['peak']:.1f} mm" in drawn
    assert "height [mm]" in drawn
    assert "within validity" in drawn
    assert ">limit<" in drawn


def test_a_demonstration_plays_a_table_of_one_s_own(monkeypatch, motion):
    runs = []
    monkeypatch.setattr(demo, "run_live", lambda run, *rest, **options: runs.append(run) or 0)
    monkeypatch.chdir(motion.parent)
    assert main(["demo", "--motion", motion.name]) == 0
    assert runs[0].simulated.parameters["motion"] == str(motion)
    assert "motion.csv" in runs[0].title


def test_a_demonstration_is_refused_before_a_node_starts(capsys, motion, tmp_path):
    output = tmp_path / "out"
    for words, match in (
        (["--repeat", "0"], "--repeat 0: must be from 1 to 10000"),
        (["--motion", str(tmp_path / "none.csv")], "none.csv"),
        (["--motion", "d7"], "unknown motion 'd7'"),
    ):
        assert match in complaint(capsys, "demo", "-o", str(output), *words)
    assert not output.exists()


def test_simulate_names_what_is_wrong(capsys, motion, tmp_path):
    output = str(tmp_path / "out.csv")
    bad = tmp_path / "model.yaml"
    bad.write_text("container: {radius: 0.05, fill_height: 0.07, colour: red}")
    nan = tmp_path / "nan.csv"
    nan.write_text("t,ax,ay,az\n0,0,0,0\n1,nan,0,0\n")
    for model, table, match in (
        (bad, motion, r"model\.yaml:\d+: unknown key 'container\.colour'"),
        (tmp_path / "none.yaml", motion, r"none\.yaml"),
        (MODEL, nan, r"nan\.csv.*3"),
        (MODEL, tmp_path / "none.csv", r"none\.csv"),
        (MODEL, tmp_path, r"."),
    ):
        line = complaint(capsys, "simulate", str(model), str(table), "-o", output)
        assert re.search(match, line), line


def test_replay_names_what_is_no_bag(capsys, tmp_path):
    assert "no .mcap file" in complaint(capsys, "replay", str(tmp_path))


def test_doctor_as_json(capsys):
    assert main(["doctor", "--json"]) == 0
    findings = {finding["name"]: finding for finding in json.loads(capsys.readouterr().out)}
    assert findings["messages over DDS"]["ok"]
    assert findings["slosh_msgs"]["ok"]


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("model: a.yaml", r"cell\.yaml:1: model: no such file"),
        ("modell: a.yaml", r"cell\.yaml:1: unknown key 'modell'"),
        ("namespace: /a\nmodel: a\nnamespace: /b", r"cell\.yaml:3: namespace: given twice"),
        ("model: a.yaml\n\tremap: {}", r"cell\.yaml:2: not YAML: .*there is a tab here"),
        ("[1]", "must be a mapping"),
        ("{", "not YAML"),
        ("", "must be a mapping"),
    ],
)
def test_a_wrong_cell_file_is_named(tmp_path, text, match):
    path = tmp_path / "cell.yaml"
    path.write_text(text)
    with pytest.raises(SloshBringupError, match=match) as caught:
        read_setup(path)
    assert str(caught.value).startswith(str(path))


def test_a_cell_file_points_relative_to_itself(tmp_path):
    for name in ("model.yaml", "camera.yaml"):
        (tmp_path / name).write_text((config_folder() / name).read_text())
    path = tmp_path / "robot.yaml"
    path.write_text(
        "{model: model.yaml, calibration: camera.yaml, namespace: /a, remap: {accel: /arm/accel}}"
    )
    setup = read_setup(path)
    assert setup.model == (tmp_path / "model.yaml").resolve()
    commands = {
        process.name: process.command(setup.namespace) for process in setup.processes(tmp_path)
    }
    assert "accel:=/arm/accel" in commands["estimator"]
    assert "__ns:=/a" in commands["monitor"]


@pytest.mark.parametrize("columns", ["qx,qy,qz,qw", "wx,wy,wz"])
def test_a_table_that_tilts_feels_gravity_and_says_so(capsys, tmp_path, columns):
    """A cup that tips by 30 degrees within a second without translation keeps a level surface."""
    t = np.linspace(0.0, 1.0, 501)
    half = 0.25 * np.radians(30.0) * (1.0 - np.cos(2.0 * np.pi * t))
    zero = np.zeros_like(t)
    turn = [zero, np.sin(half), zero, np.cos(half)]
    if columns.startswith("w"):  # from which the attitude follows, as the container begins upright
        turn = [zero, 2.0 * np.gradient(half, t), zero]
    rows = np.column_stack([t, zero, zero, zero, *turn])
    table = tmp_path / "tilt.csv"
    np.savetxt(table, rows, "%.9f", ",", header=f"t,ax,ay,az,{columns}", comments="")
    _, facts, said = simulated(capsys, table)
    assert facts["peak"] > 0.8 * 0.05 * np.tan(np.radians(30.0))
    assert "note: " in said
    assert "tilts by up to 30.0 deg: the effect gravity_tilt is added to the model" in said
    main(["predict", MODEL, str(table), "--json"])
    captured = capsys.readouterr()
    (answer,) = json.loads(captured.out)
    assert answer["peak_nonlinear"] == pytest.approx(facts["peak"], rel=1e-3)
    assert "the effect gravity_tilt is added" in captured.err
