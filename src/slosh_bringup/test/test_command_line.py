"""Tests the command line: units, suggestions for typing errors and one-line errors."""

import argparse
import os
import subprocess
import sys

import pytest

from slosh_bringup.cli import quantities
from slosh_bringup.cli.main import all_commands, build_parser, main
from slosh_bringup.processes import config_folder
from slosh_testing.commands import complaint, printed

MODEL = str(config_folder() / "model.yaml")


@pytest.mark.parametrize(
    ("kind", "text", "value"),
    [
        (quantities.length(), "0.01", 0.01),
        (quantities.length(), "10mm", 0.01),
        (quantities.length(), "1e-2 m", 0.01),
        (quantities.length(), "-3.3cm", -0.033),
        (quantities.time(), "300ms", 0.3),
        (quantities.time(), "2min", 120.0),
        (quantities.angle(), "5deg", 5.0),
        (quantities.angle(), "5°", 5.0),
        (quantities.angle(), "3.141592653589793rad", 180.0),
        (quantities.FRACTION, "5%", 0.05),
        (quantities.RATE, "1kHz", 1000.0),
        (quantities.SPEED, "0.8Hz", 48.0),
        (quantities.ACCELERATION, "0.5g", 4.903325),
        (quantities.VISCOSITY, "1cSt", 1e-6),
        (quantities.DENSITY, "1.03g/cm3", 1030.0),
    ],
)
def test_a_value_may_carry_its_unit(kind, text, value):
    assert kind(text) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(
    ("kind", "text", "said"),
    [
        (quantities.HEIGHT, "10", r"10 m is out of range; did you mean 10 mm, 0\.01\?"),
        (quantities.time(600.0), "3000", r"3000 s .* did you mean 3000 ms, 3\?"),
        (quantities.angle(3.15, 180.0), "1.2", r"1\.2 deg .* did you mean 1\.2 rad, 68\.75\?"),
        (quantities.FRACTION, "5", r"5 is out of range; did you mean 5 %, 0\.05\?"),
        (quantities.HEIGHT, "10mn", r"unknown unit 'mn' \(mm, cm, m"),
        (quantities.HEIGHT, "ten", r"'ten' is not a number"),
    ],
)
def test_a_bare_number_that_cannot_be_meant_is_asked_back(kind, text, said):
    with pytest.raises(argparse.ArgumentTypeError, match=said):
        kind(text)


@pytest.mark.parametrize(
    ("typed", "said"),
    [
        ("simulte", "slosh: unknown command 'simulte'; did you mean simulate?"),
        ("help simulat", "slosh: unknown command 'simulat'; did you mean simulate?"),
        ("import tabel x", "slosh import: unknown command 'tabel'; did you mean table?"),
        ("predict --limt 3", "slosh predict: unknown option --limt; did you mean --limit?"),
        ("predict m.yaml", "slosh predict: missing: TRAJECTORY; slosh help predict shows how"),
        ("predict m.yaml a.csv --limit", "--limit: expected one argument; slosh help predict"),
        ("predict m.yaml a.csv --limit 10", "--limit: 10 m is out of range; did you mean 10 mm"),
        ("simulate m.yaml a.csv -o b.csv --limit 10", "did you mean 10 mm, 0.01?"),
        ("plan m.yaml a.csv -o b.csv --limit 10", "did you mean 10 mm, 0.01?"),
        ("motion quintic --speed 48 --stroke 300 -o a.csv", "did you mean 300 mm, 0.3?"),
        ("new cup --radius 40 --fill-height 60mm", "did you mean 0.04 (40 mm)?"),
        ("calibrate a.png --fov 40 --radius 40 -o c.yaml", "did you mean 40 mm, 0.04?"),
        ("predict model.yaml m.csv --horizon 1e9", "1e+09 s is out of range"),
        ("intrinsics --board 9x6 --square 25 a.png", "did you mean 25 mm, 0.025?"),
        ("intrinsics --board 9x6 --lens plumbob", "did you mean plumb_bob?"),
        ("replay --jobs two x", "--jobs: 'two' is not a whole number"),
        ("demo a b", "slosh demo: too many arguments: a b; slosh help demo"),
        ("demo --motion c33", "did you mean c3?"),
        ("discover --holdout a b -o c", "missing: DATA (an option of several values, --holdout,"),
        ("export --topic /a bag", "missing: BAG (an option of several values, --topic,"),
        (
            "simulate a.csv m.yaml -o b.csv",
            "MODEL and MOTION are exchanged; type: slosh simulate m.yaml a.csv",
        ),
        (
            "predict a.csv m.yaml",
            "MODEL and TRAJECTORY are exchanged; type: slosh predict m.yaml a.csv",
        ),
        ("predict m.yaml a.csv n.yaml", "n.yaml: is a model, but TRAJECTORY must be a table"),
        ("discover bag --model a.csv -o c", "a.csv: is a table, but MODEL must be a model.yaml"),
    ],
)
def test_a_mistake_is_one_line_with_the_remedy(capsys, tmp_path, monkeypatch, typed, said):
    monkeypatch.chdir(tmp_path)
    assert said in complaint(capsys, *typed.split())
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("container: {radius: 65, fill_height: 0.07}", "did you mean 65 mm, 0.065?"),
        ("container: {radus: 0.05, fill_height: 0.07}", "did you mean radius?"),
        ("container: {radius: 0.05, fill_height: 0.07}\nefects: []", "did you mean effects?"),
        (
            "container: {radius: 0.05, fill_height: 0.07}\neffects: [{name: gravity-tilt}]",
            "did you mean gravity_tilt?",
        ),
    ],
)
def test_a_mistake_in_a_model_is_one_line_with_the_remedy(capsys, tmp_path, text, said):
    model = tmp_path / "model.yaml"
    model.write_text(text)
    line = complaint(capsys, "simulate", str(model), "a.csv", "-o", str(tmp_path / "b.csv"))
    assert said in line
    assert "model.yaml:" in line


@pytest.mark.parametrize("name", all_commands())
def test_help_of_a_command_is_its_own_help(capsys, name):
    texts = []
    for words in (["help", name], [name, "--help"]):
        with pytest.raises(SystemExit) as caught:
            main(words)
        assert caught.value.code == 0
        texts.append(capsys.readouterr().out)
    assert texts[0] == texts[1]
    assert texts[0].startswith(f"usage: slosh {name}")


@pytest.mark.parametrize(
    ("command", "old", "new", "name"),
    [
        ("calibrate a.png -o b", "--wall-thickness 0.002", "--wall 2mm", "wall_thickness"),
        ("new cup", "--wall-thickness 0.002", "--wall 2mm", "wall"),
        ("replay bag", "--cell /a", "--namespace /a", "cell"),
        ("export bag", "--topics /a", "--topic /a", "topics"),
    ],
)
def test_an_old_name_of_an_option_is_taken_and_not_shown(command, old, new, name):
    words = command.split()
    parser = build_parser(words[0])
    values = [getattr(parser.parse_args([*words, *option.split()]), name) for option in (old, new)]
    assert values[0] == values[1]
    sub = parser._subparsers._group_actions[0].choices[words[0]]
    assert old.split()[0] not in sub.format_help().split()


@pytest.mark.parametrize(
    ("typed", "offered"), [("pla", ["plan", "play"]), ("predict --li", ["--limit"])]
)
def test_a_shell_completes_commands_and_options(tmp_path, typed, offered):
    """Calls the completion as the shell function of register-python-argcomplete does."""
    line = f"slosh {typed}"
    answer = tmp_path / "answer"
    asked = {"COMP_LINE": line, "COMP_POINT": str(len(line)), "COMP_TYPE": "9",
             "_ARGCOMPLETE": "1", "_ARGCOMPLETE_IFS": "\n"}  # fmt: skip
    command = f"exec {sys.executable} -m slosh_bringup.cli 8>{answer}"
    subprocess.run(["/bin/sh", "-c", command], env={**os.environ, **asked}, check=True)
    assert [word.strip() for word in answer.read_text().split("\n")] == offered


def test_what_a_command_answers_can_be_had_as_json(capsys, tmp_path):
    cup = ["--radius", "40mm", "--fill-height", "60mm"]
    made = printed(capsys, "new", str(tmp_path / "cup"), *cup, "--json")
    assert made["files"][0] == str(tmp_path / "cup" / "model.yaml")
    assert made["next"][-1].startswith("slosh cell ")
    (effect,) = printed(capsys, "explain", "gravity-tilt", "--json")
    assert (effect["kind"], effect["name"]) == ("effect", "gravity_tilt")
    assert effect in printed(capsys, "explain", "--json")
    table = tmp_path / "table.csv"
    table.write_text("t,ax,ay,az\n0,0,0,0\n0.1,1,0,0\n")
    words = ["import", "table", str(table), "-o", str(tmp_path / "bags"), "--json"]
    (bag,) = printed(capsys, *words)
    assert (bag["bag"], bag["rows"]) == (str(tmp_path / "bags" / "table"), 2)
