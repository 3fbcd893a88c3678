"""The `slosh` command: what it prints, what it writes, how it fails."""

import json
import os
import re

import numpy as np
import pytest

from slosh_bringup.cli.main import COMMANDS, main
from slosh_bringup.errors import SloshBringupError
from slosh_bringup.live.cell_setup import read_setup
from slosh_bringup.processes import config_folder

MODEL = str(config_folder() / "model.yaml")


@pytest.fixture
def motion(tmp_path):
    t = np.arange(0.0, 3.0, 0.002)
    ay = 3.0 * np.sin(9.0 * t) * np.sin(np.pi * t / 3.0) ** 2
    path = tmp_path / "motion.csv"
    rows = np.column_stack([t, np.zeros_like(t), ay, np.zeros_like(t)])
    np.savetxt(path, rows, "%.9f", ",", header="t,ax,ay,az", comments="")
    return path


def fails_with(capsys, *words):
    """Runs the command; returns its one line of complaint."""
    assert main(words) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    (line,) = captured.err.strip().split("\n")
    return line


def test_help_names_every_command(capsys):
    assert main([]) == 2
    text = capsys.readouterr().out
    assert all(name in text for name in COMMANDS)


def test_it_tells_its_version(capsys):
    with pytest.raises(SystemExit) as caught:
        main(["--version"])
    assert caught.value.code == 0
    assert re.fullmatch(r"slosh \d+\.\d+\.\d+\n", capsys.readouterr().out)


def test_a_call_leaves_the_environment_of_the_process_as_it_is(capsys, motion, tmp_path):
    """What this process starts later must not depend on whether `main` was called before."""
    before = dict(os.environ)
    assert main(["simulate", MODEL, str(motion), "-o", str(tmp_path / "out.csv")]) == 0
    assert dict(os.environ) == before


def test_a_mistyped_command_exits_with_two():
    with pytest.raises(SystemExit) as caught:
        main(["simulte"])
    assert caught.value.code == 2


def test_simulate_writes_heights(capsys, motion, tmp_path):
    output = tmp_path / "out.csv"
    assert main(["simulate", MODEL, str(motion), "-o", str(output), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    table = np.genfromtxt(output, delimiter=",", names=True)
    assert table.dtype.names == ("t", "msh", "azimuth", "sh_x", "sh_y")
    assert len(table) == facts["samples"] == 1500
    assert table["msh"].max() == facts["peak"] > 0.005
    assert np.allclose(table["msh"], np.hypot(table["sh_x"], table["sh_y"]))
    assert not table["sh_x"].any()  # a motion along y


def test_simulate_takes_a_rectangle(capsys, motion, tmp_path):
    model, output = tmp_path / "tank.yaml", tmp_path / "out.csv"
    tank = "container: {shape: rectangle, width: 0.06, depth: 0.04, fill_height: 0.067}\n"
    model.write_text(tank + "effects: [{name: pendulum_nonlinearity}]\n")
    assert main(["simulate", str(model), str(motion), "-o", str(output)]) == 0
    assert capsys.readouterr().out.startswith("2D-NL: peak ")
    table = np.genfromtxt(output, delimiter=",", names=True)
    assert np.array_equal(table["msh"], np.abs(table["sh_x"]) + np.abs(table["sh_y"]))
    assert table["msh"].max() > 0.002
    model.write_text(tank + "effects:\n  - name: surface_nonlinearity\n")
    line = fails_with(capsys, "simulate", str(model), str(motion), "-o", str(output))
    assert line.endswith("tank.yaml:3: effect 'surface_nonlinearity' is not for a rectangle")


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
    assert facts["peak"] == read["msh"].max() == pytest.approx(liquid["msh"].max() + 0.002, 1e-3)
    assert facts["peak_time"] == read["t"][np.argmax(read["msh"])]


def test_simulate_says_whose_heights_it_writes(capsys):
    with pytest.raises(SystemExit):
        main(["simulate", "--help"])
    text = " ".join(capsys.readouterr().out.split())
    assert "as a sensor would read it" in text
    assert "the liquid's own signed height" in text


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
        line = fails_with(capsys, "simulate", str(model), str(table), "-o", output)
        assert re.search(match, line), line


def test_a_folder_that_cannot_be_written_is_one_line(capsys, motion):
    line = fails_with(capsys, "simulate", MODEL, str(motion), "-o", "/nowhere/out.csv")
    assert "/nowhere/out.csv" in line


def test_replay_names_what_is_no_bag(capsys, tmp_path):
    assert "no .mcap file" in fails_with(capsys, "replay", str(tmp_path))


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
        ("model: a.yaml\n\tremap: {}", r"cell\.yaml:2: not YAML: .*a tab stands here"),
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
