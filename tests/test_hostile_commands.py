"""Tests that commands refuse impossible options and tables with one line and exit code 2."""

import pytest

from slosh_bringup.cli.main import main
from slosh_plan.errors import SloshPlanError
from slosh_plan.planning.path import path_through

MODEL = """version: 1
container: {shape: cylinder, radius: 0.04, fill_height: 0.06, rim_height: 0.11}
liquid: {density: 998.2, kinematic_viscosity: 1.0e-06}
"""
ROWS = "".join(f"{0.01 * k},{k % 3},0,0\n" for k in range(60))


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Makes a folder with a model, a motion and a folder of runs the current one."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "model.yaml").write_text(MODEL)
    (tmp_path / "motion.csv").write_text("t,ax,ay,az\n" + ROWS)
    (tmp_path / "runs").mkdir()
    return tmp_path


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("plan model.yaml --straight 1e300 --limit 0.02 -o p.csv", "must be at most 10 m"),
        ("plan model.yaml --straight 400000mm --limit 1e9m -o p.csv", "must be at most 100 m"),
        ("plan model.yaml --straight 300 --limit 0.02 -o p.csv", "did you mean 300 mm, 0.3?"),
        ("plan model.yaml --straight 0.1 --velocity-scaling 0.5 --limit 0.02 -o p.csv",
         "--velocity-scaling: needs the robot"),
        ("plan model.yaml --straight 0.1 --acceleration-scaling 0.5 --limit 0.02 -o p.csv",
         "--acceleration-scaling: needs the robot"),
        ("predict model.yaml motion.csv --limit 1e300", "must be at most 1 m"),
        ("predict model.yaml motion.csv --epsilon=-1", "must be 0 to 1"),
        ("mounting bag --sensor-to-origin 1e300 0 0", "must be at most 5 m"),
        ("mounting bag --sensor-rotation 1e300 0 0", "must be -6.3 to 6.3 rad"),
        ("motion quintic --speed 60 --stroke 0 -o m.csv", "must be at least 0.001 mm"),
        ("motion quintic --speed 60 --stroke 1e-300 -o m.csv", "must be at least 0.001 mm"),
        ("store runs --quota nan", "nan bytes is no size"),
        ("store runs --quota inf", "inf bytes is no size"),
        ("store runs --quota 20", "did you mean 20GB?"),
    ],
)  # fmt: skip
def test_an_impossible_option_is_refused_in_one_line(folder, capsys, line, told):
    try:
        code = main(line.split())
    except SystemExit as ended:
        code = ended.code
    assert code == 2
    assert told in capsys.readouterr().err


@pytest.mark.parametrize("line", ["store runs --quota 0", "store runs --quota 20GB"])
def test_a_possible_quota_is_taken(folder, line):
    assert main(line.split()) == 0


@pytest.mark.parametrize("value", [1e300, -1e7, float("inf"), float("nan")])
def test_a_waypoint_that_is_nowhere_is_named(value):
    with pytest.raises(
        SloshPlanError, match=r"waypoint 1 has y = .*it must be finite and at most"
    ):
        path_through([[0.0, 0.0, 0.0], [0.1, value, 0.0]])
