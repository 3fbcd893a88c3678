"""Tests `slosh motion`: the written table and errors for invalid options."""

import json

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from slosh_bringup.cli.main import main
from slosh_model.motion_profiles import LAWS
from slosh_motion.tables.motion_table import read_motion_table


def words(output, *more, profile="quintic", speed="30", stroke="0.1"):
    return ["motion", profile, "--speed", speed, "--stroke", stroke, *more, "-o", str(output)]


# Rows a millisecond apart spread the harmonic law's jumps, and with them move the end.
@pytest.mark.parametrize("profile", [law for law in LAWS if law != "harmonic"])
@pytest.mark.parametrize("speed", ["12", "48", "60"])
def test_the_table_moves_the_container_by_the_stroke(tmp_path, capsys, profile, speed):
    output = tmp_path / "motion.csv"
    assert main(words(output, profile=profile, speed=speed)) == 0
    table = read_motion_table(output)
    assert table.t[-1] == pytest.approx(60.0 / float(speed), abs=1.1e-3)
    assert np.diff(table.t) == pytest.approx(np.full(len(table.t) - 1, 1e-3))
    velocity = cumulative_trapezoid(table.acceleration, table.t, axis=0, initial=0)
    position = cumulative_trapezoid(velocity, table.t, axis=0, initial=0)
    assert position[-1] == pytest.approx([0.1, 0.0, 0.0], abs=1e-5)
    assert table.acceleration[table.t > 0.4 * 60.0 / float(speed) + 1e-9, 0] == pytest.approx(
        0.0, abs=1e-9
    )
    assert "rows in" in capsys.readouterr().out


def test_cycles_axis_and_ratio(tmp_path, capsys):
    output = tmp_path / "motion.csv.gz"
    more = ["--cycles", "3", "--axis", "y", "--ratio", "0.5", "--rate", "500", "--json"]
    assert main(words(output, *more, profile="acceleration-pulse")) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["profile"] == "acceleration_pulse"
    assert facts["cycle_time"] == 2.0
    assert facts["motion_time"] == 1.0
    table = read_motion_table(output)
    assert len(table.t) == facts["rows"] == 3001
    a = table.acceleration[:, 1]
    assert not table.acceleration[:, [0, 2]].any()
    assert a[:1000] == pytest.approx(a[1000:2000], abs=1e-12)
    assert np.abs(a).max() == facts["peak_acceleration"]


@pytest.mark.parametrize(
    ("change", "match"),
    [
        (["--rate", "5"], "--rate 5: must be at least 12.5 Hz"),
        (["--rate", "nan"], "--rate nan"),
        (["--cycles", "0"], "--cycles 0: must be at least 1"),
        (["--rate", "1e7"], "rows exceed the maximum of 10000000"),
        (["--ratio", "0"], "ratio = 0.0 must lie in [0.01, 1]"),
        (["--stroke", "-100"], "stroke = -100.0 m must lie in"),
        (["--speed", "0"], "speed = 0.0 1/min"),
    ],
)
def test_refusals_are_one_line(tmp_path, capsys, change, match):
    output = tmp_path / "motion.csv"
    assert main([*words(output), *change]) == 2
    captured = capsys.readouterr()
    assert match in captured.err
    assert captured.err.count("\n") == 1
    assert not output.exists()


def test_another_law_and_another_kind_of_file_are_refused(tmp_path, capsys):
    assert main(words(tmp_path / "a.csv", profile="jump")) == 2
    assert "'jump' is not one of quintic" in capsys.readouterr().err
    assert main(words(tmp_path / "a.txt")) == 2
    assert "a motion table must end in .csv" in capsys.readouterr().err


MODEL = """container: {shape: cylinder, radius: 0.05, fill_height: 0.07}
liquid: {density: 998.2, kinematic_viscosity: 1.0e-6}
damping_ratio: auto
effects: [{name: vertical_acceleration}, {name: surface_nonlinearity, alpha: 0.58}]
"""
TANK = """container: {shape: rectangle, width: 0.08, depth: 0.06, fill_height: 0.07}
liquid: {density: 998.2, kinematic_viscosity: 1.0e-6}
damping_ratio: auto
"""
POSES = "t,x,y,z\n0,0,0,0\n0.5,0.1,0.05,0\n1,0.2,0.1,0\n"


@pytest.fixture
def slosh_shape(tmp_path, capsys):
    """Returns a function that runs `slosh shape` on a table and returns all its output."""

    def run(table, *options, model=MODEL):
        (tmp_path / "model.yaml").write_text(model)
        (tmp_path / "motion.csv").write_text(table)
        words = ["shape", str(tmp_path / "model.yaml"), str(tmp_path / "motion.csv")]
        code = main([*words, "-o", str(tmp_path / "out.csv"), *options])
        out, err = capsys.readouterr()
        return code, out, err, tmp_path / "out.csv"

    return run


@pytest.mark.parametrize("name", ["zv", "zvd", "exponential", "average", "polynomial"])
def test_a_shaped_motion_leaves_less_and_can_be_simulated(slosh_shape, tmp_path, capsys, name):
    code, out, _, table = slosh_shape(POSES, "--filter", name, "--json")
    assert code == 0
    facts = json.loads(out)
    assert facts["after"]["residual_linear"] < 0.02 * facts["before"]["residual_linear"]
    assert facts["after"]["residual"] < 0.2 * facts["before"]["residual"]
    assert facts["deviation"] < 1e-6
    motion = read_motion_table(table)
    assert motion.t[-1] == pytest.approx(facts["after"]["duration"], abs=1e-9)
    simulated = main(["simulate", str(tmp_path / "model.yaml"), str(table), "--json",
                      "-o", str(tmp_path / "heights.csv")])  # fmt: skip
    assert simulated == 0
    # The simulation ends with the motion: the peak may come later.
    assert json.loads(capsys.readouterr().out)["peak"] <= facts["after"]["peak"] + 1e-9


def test_the_summary_has_before_and_after(slosh_shape):
    code, out, _, table = slosh_shape(POSES, "--filter", "zv", "--per-axis")
    assert code == 0
    assert "lasts 1.000 → 1.16" in out
    assert f"rows in {table}" in out


def test_the_attitude_is_kept(slosh_shape):
    rows = [line + ",0,0,0.6,0.8" for line in POSES.splitlines()[1:]]
    code, _, _, table = slosh_shape(
        "\n".join(["t,x,y,z,qx,qy,qz,qw", *rows]), "--filter", "zv", model=TANK
    )
    assert code == 0
    motion = read_motion_table(table)
    assert motion.attitude == pytest.approx(np.tile([0, 0, 0.6, 0.8], (len(motion.t), 1)))


@pytest.mark.parametrize(
    ("table", "options", "text"),
    [
        ("t,ax,ay,az\n0,0,0,0\n1,1,0,0\n", ("--filter", "zv"), "end at a speed of 0.5 m/s"),
        (POSES, ("--filter", "polynomial", "--per-axis"), "a time law along the path"),
        (
            "t,x,y,z\n0,0,0,0\n0.05,0.1,0,0\n0.1,0.2,0,0\n", ("--filter", "polynomial"),
            "has no residual-free polynomial",
        ),
        ("t,x,y,z\n0,0,0,0\n1,0,0,0\n2,0,0,0\n", ("--filter", "zv"), "no length"),
        (
            "t,x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,0,1\n1,1,0,0,0,0,0.6,0.8\n2,2,0,0,0,0,0.6,0.8\n",
            ("--filter", "zv"), "the container turns",
        ),
        (
            "t,x,y,z,qx,qy,qz,qw\n0,0,0,0,0.1,0,0,1\n1,1,0,0,0.1,0,0,1\n2,2,0,0,0.1,0,0,1\n",
            ("--filter", "zv"), "tilted by",
        ),
    ],
)  # fmt: skip
def test_what_cannot_be_shaped_is_refused_in_one_line(slosh_shape, table, options, text):
    code, out, err, written = slosh_shape(table, *options)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert text in err
    assert not written.exists()


def test_two_frequencies_have_no_polynomial(slosh_shape):
    code, _, err, _ = slosh_shape(POSES, "--filter", "polynomial", model=TANK)
    assert code == 2
    assert "both frequencies of a rectangle" in err
