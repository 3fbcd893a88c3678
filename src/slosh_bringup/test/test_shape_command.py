import json

import numpy as np
import pytest

from slosh_bringup.cli.main import main
from slosh_tables.motion_table import read_motion_table

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
    """`slosh shape` on a table; its exit code, what it prints and what it writes to."""

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
