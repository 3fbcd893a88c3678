import json
from dataclasses import replace

import numpy as np
import pytest

from slosh_bringup.cli.main import main
from slosh_model.model_text import parse_model
from slosh_motion.tables.motion_table import read_motion_table
from slosh_plan import Trajectory, predict
from slosh_plan.planning.tolerance import ERRORS

MODEL = """container: {shape: cylinder, radius: 0.05, fill_height: 0.07}
liquid: {density: 998.2, kinematic_viscosity: 1.0e-6}
damping_ratio: auto
effects: [{name: vertical_acceleration}, {name: surface_nonlinearity, alpha: 0.58}]
"""
HEAD = "t,x,y,z\n"
LINE = HEAD + "0,0,0,0\n1,0.4,0,0\n"


@pytest.fixture
def slosh_plan(tmp_path, capsys):
    """Returns a function that runs `slosh plan` on a table and returns all its output."""
    (tmp_path / "model.yaml").write_text(MODEL)

    def run(table, *options, limit="0.015"):
        (tmp_path / "path.csv").write_text(table)
        words = [
            "plan",
            str(tmp_path / "model.yaml"),
            str(tmp_path / "path.csv"),
            "--limit",
            limit,
        ]
        code = main([*words, "-o", str(tmp_path / "out.csv"), *options])
        out, err = capsys.readouterr()
        return code, out, err, tmp_path / "out.csv"

    return run


def test_a_plan_is_a_motion_table_that_can_be_simulated(slosh_plan, tmp_path, capsys):
    code, out, _, table = slosh_plan(LINE, "--residual", "0.002", "--json", "--time-limit", "5")
    assert code == 0
    facts = json.loads(out)
    motion = read_motion_table(table)
    assert motion.t[-1] == pytest.approx(facts["duration"], abs=1e-9)
    assert table.read_text().splitlines()[0] == "t,x,y,z,ax,ay,az"
    simulated = main(["simulate", str(tmp_path / "model.yaml"), str(table), "--json",
                      "-o", str(tmp_path / "heights.csv")])  # fmt: skip
    assert simulated == 0
    assert json.loads(capsys.readouterr().out)["peak"] <= 0.015


def test_a_robust_plan_tells_the_likely_heights_and_their_price(slosh_plan, tmp_path):
    code, _, err, _ = slosh_plan(LINE, "--robust")
    assert (code, err.count("\n")) == (2, 1)
    assert "needs the covariance" in err
    covariance = "covariance: {parameters: [damping_ratio], matrix: [[1.0e-6]]}\n"
    (tmp_path / "model.yaml").write_text(MODEL + covariance)
    code, out, _, _ = slosh_plan(LINE, "--robust", "--json", "--time-limit", "5")
    facts = json.loads(out)
    assert code == 0
    assert facts["likely"]["parameters"] == ["damping_ratio"]
    assert facts["peak"] < facts["likely"]["peak"] <= 0.015 * 1.001
    assert facts["duration"] >= facts["likely"]["nominal_duration"]


def test_the_attitude_is_kept(slosh_plan):
    rows = "t,x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,0.6,0.8\n1,0.1,0,0,0,0,0.6,0.8\n"
    code, _, _, table = slosh_plan(rows, "--time-limit", "0")
    assert code == 0
    assert read_motion_table(table).attitude == pytest.approx(
        np.tile([0, 0, 0.6, 0.8], (len(read_motion_table(table).t), 1))
    )


@pytest.mark.long
def test_a_container_may_tilt(slosh_plan, tmp_path, capsys):
    pytest.importorskip("casadi")
    code, out, _, table = slosh_plan(LINE, "--residual", "0.002", "--max-tilt", "10")
    assert code == 0
    assert "tilt 10 of 10°, 120 of 120°/s" in out
    motion = read_motion_table(table)
    assert motion.attitude[[0, -1]] == pytest.approx(np.array([[0.0, 0.0, 0.0, 1.0]] * 2))
    (tmp_path / "model.yaml").write_text(
        MODEL.replace("effects: [", "effects: [{name: gravity_tilt}, ")
    )
    heights = str(tmp_path / "heights.csv")
    assert (
        main(["simulate", str(tmp_path / "model.yaml"), str(table), "--json", "-o", heights]) == 0
    )
    assert json.loads(capsys.readouterr().out)["peak"] <= 0.015


def test_the_summary_says_what_is_reached_and_why_no_optimum(slosh_plan):
    code, out, _, _ = slosh_plan(LINE, "--time-limit", "0", "--margin", "0.001")
    assert code == 0
    assert "scaled:" in out
    assert "of 15 mm" in out
    assert "margin 1 mm" in out


def test_the_summary_says_how_small_an_error_breaks_the_plan(slosh_plan):
    options = ("--time-limit", "5", "--margin", "0.3mm")
    code, out, _, table = slosh_plan(LINE, "--json", *options, limit="15mm")
    assert code == 0
    facts = json.loads(out)
    assert 0.0 < facts["frequency_tolerance"] < ERRORS[-1]
    assert facts["residual"] <= 0.0075 - 0.0003 + 1e-9  # half of the limit where it is not told
    model, motion = parse_model(MODEL), read_motion_table(table)
    trajectory = Trajectory(motion.t, motion.acceleration)
    following = ERRORS[ERRORS.index(facts["frequency_tolerance"]) + 1]
    kept = {}
    for error in (facts["frequency_tolerance"], following):
        twins = [
            replace(model, natural_frequency=model.mode_frequency(1) * (1.0 + signed))
            for signed in (-error, error)
        ]
        found = [predict(twin, trajectory)[0].nonlinear for twin in twins]
        kept[error] = all(one.peak <= 0.015 and one.residual <= 0.0075 for one in found)
    assert kept == {facts["frequency_tolerance"]: True, following: False}
    _, out, _, _ = slosh_plan(LINE, *options, limit="15mm")
    assert f"the limits hold for errors of up to {100 * facts['frequency_tolerance']:g} %" in out


REPLAYED = {
    "replay": {
        "accuracy": [
            {"name": "3D-L", "sigma": 0.002, "epsilon": 0.3},
            {"name": "3D-NL", "sigma": 0.0001, "epsilon": -0.05},
        ]
    }
}


RAN = {"agreements": [{"name": "3D-NL / camera", "sigma": 0.0002, "epsilon": 0.02}]}


def test_the_error_of_results_is_kept_off_the_limits(slosh_plan, tmp_path):
    files = [tmp_path / "c3.json", tmp_path / "result.json"]
    for file, document in zip(files, (REPLAYED, RAN), strict=True):
        file.write_text(json.dumps(document))
    options = ("--residual", "0.002", "--time-limit", "0")
    code, out, _, _ = slosh_plan(LINE, *options, "--json", "--error", *map(str, files))
    facts = json.loads(out)
    assert (code, facts["sigma"], facts["epsilon"]) == (0, 0.0002, 0.05)
    assert facts["error_margin"] == pytest.approx(np.hypot(0.0004, 0.05 * facts["peak"]))
    assert facts["peak"] + facts["error_margin"] == pytest.approx(facts["upper"])
    assert facts["upper"] <= 0.015
    _, out, _, _ = slosh_plan(LINE, *options, "--mae", "0.0002", "--epsilon", "0.05")
    assert "reserved for the model's error (MAE 0.2 mm, ε 5 %" in out


@pytest.mark.parametrize(
    ("text", "options", "words"),
    [
        ("{}", (), "no accuracy figures for model 3D-NL"),
        ("[1", (), "is not JSON"),
        ('{"agreements": [{"name": "3D-NL", "sigma": null}]}', (), "sigma of 3D-NL is None"),
        (json.dumps(RAN), ("--sigma", "0.1"), "do not give --mae or --epsilon as well"),
        (None, (), "No such file"),
    ],
)
def test_errors_that_are_none_are_refused_in_one_line(slosh_plan, tmp_path, text, options, words):
    file = tmp_path / "result.json"
    if text is not None:
        file.write_text(text)
    code, _, err, _ = slosh_plan(LINE, "--error", str(file), *options)
    assert (code, err.count("\n")) == (2, 1)
    assert words in err


def test_no_safe_motion_is_exit_code_1(slosh_plan):
    code, out, err, table = slosh_plan(LINE, "--max-acceleration", "1e-5")
    assert (code, out) == (1, "")
    assert err.count("\n") == 1
    assert "the limit of the acceleration asks for 402 s" in err
    assert not table.exists()


WRONG = {
    "unsorted": (
        HEAD + "0,0,0,0\n2,0.1,0,0\n1,0.2,0,0\n",
        "line 4: column 't': 1 s does not come after 2 s",
    ),
    "repeated": (HEAD + "0,0,0,0\n0,0.1,0,0\n", "line 3: column 't': 0 s does not come after 0 s"),
    "one point": (HEAD + "0,0,0,0\n", "holds 1 rows"),
    "empty": ("", "is empty"),
    "NaN": (HEAD + "0,0,0,0\n1,nan,0,0\n", "line 3: column 'x': nan"),
    "a word": (HEAD + "0,0,0,0\n1,far,0,0\n", "'far' is not a number"),
    "no length": (HEAD + "0,0,0,0\n1,0,0,0\n", "no length"),
    "a column": ("t,x,y,z,w\n0,0,0,0,0\n1,1,0,0,0\n", "'w' is unknown"),
    "half an attitude": ("t,x,y,z,qx\n0,0,0,0,0\n1,1,0,0,0\n", "'qy' is missing"),
    "a cell": (HEAD + "0,0,0,0\n1,0,0\n", "line 3: has 3 columns, the heading has 4"),
    "turning": (
        "t,x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,0,1\n1,1,0,0,0,0,0.6,0.8\n", "attitude changes",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_wrong_paths_are_refused_in_one_line(slosh_plan, name):
    table, text = WRONG[name]
    code, out, err, written = slosh_plan(table)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert text in err
    assert not written.exists()


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (("--max-tilt", "60"), "tilt = 60° must lie in 0 … 45°"),
        (("--max-tilt-rate", "0"), "tilt_rate = 0 rad/s"),
        (("--max-jerk", "nan"), "jerk = nan"),
        (("--residual", "0"), "residual limit = 0.0 m"),
        (("--margin", "0.02"), "is not below the limit"),
    ],
)
def test_wrong_options_are_refused_in_one_line(slosh_plan, options, text):
    code, _, err, _ = slosh_plan(LINE, *options)
    assert (code, err.count("\n")) == (2, 1)
    assert text in err


def test_the_page_and_its_numbers_are_written_on_demand(slosh_plan, tmp_path):
    folder = tmp_path / "report"
    code, _, _, table = slosh_plan(LINE, "--time-limit", "0", "--report", str(folder))
    assert code == 0
    assert sorted(path.name for path in folder.iterdir()) == ["plan.json", "report.html"]
    document = json.loads((folder / "plan.json").read_text())
    last = document["motions"][-1]
    assert last["duration"] == pytest.approx(read_motion_table(table).t[-1], abs=1e-9)
    assert "path.csv with" in (folder / "report.html").read_text()


def test_a_straight_path_needs_no_file(tmp_path, capsys):
    model = tmp_path / "model.yaml"
    model.write_text(MODEL)
    words = ["plan", str(model), "--straight", "400mm", "--limit", "15mm", "--time-limit", "5"]
    assert main(words) == 0
    out = capsys.readouterr().out
    assert "path 0.400 m, no stop" in out
    assert "not written (-o FILE.csv)" in out
    assert main([*words, "-o", str(tmp_path / "out.csv")]) == 0
    rows = np.genfromtxt(tmp_path / "out.csv", delimiter=",", names=True)
    assert [rows[name][-1] for name in "xyz"] == pytest.approx([0.4, 0.0, 0.0], abs=1e-4)
    for wrong in (words[:2] + words[4:], [*words, str(tmp_path / "path.csv")]):
        assert main(wrong) == 2
        assert "give either a PATH or --straight" in capsys.readouterr().err


def test_a_tray_is_planned_for_the_container_with_the_lowest_limit(tmp_path, capsys):
    (tmp_path / "cup.yaml").write_text(MODEL)
    cups = ("{name: a, model: cup.yaml}", "{name: b, model: cup.yaml, limit: 0.01}")
    tray = tmp_path / "tray.yaml"
    tray.write_text("containers:\n" + "".join(f"- {cup}\n" for cup in cups))
    words = ["plan", str(tray), "--straight", "0.2", "--limit", "0.02", "--time-limit", "2"]
    assert main(words) == 0
    first, *_ = capsys.readouterr().out.splitlines()
    assert first.startswith("planned for container b: a ")
    assert first.endswith(" of 10 mm")
    assert main([*words, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["container"] == "b"
    assert found["peak"] <= found["height_limit"] == 0.01
