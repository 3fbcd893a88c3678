"""Tests that `slosh predict` says of a plan's motion what `slosh plan` said, and exits alike."""

import json

import pytest

from slosh_bringup.cli.main import main
from slosh_motion.inputs.robot import available
from slosh_plan.planning import optimise

BARE = "container: {shape: cylinder, radius: 0.05, fill_height: 0.07}\n"
BOX = "container: {shape: rectangle, width: 0.08, depth: 0.06, fill_height: 0.07}\n"
DOUBTFUL = (
    BARE + "damping_ratio: 0.006\nnatural_frequency: 19.0\n"
    "covariance: {parameters: [natural_frequency], matrix: [[0.0025]]}\n"
)
TRAY = (
    "containers:\n"
    "  - {name: left, model: bare.yaml, place: [0.0, 0.1, 0.0], limit: 0.012}\n"
    "  - {name: right, model: box.yaml, place: [0.0, -0.1, 0.0]}\n"
)
CORNER = "t,x,y,z\n0,0,0,0\n1,0.3,0,0\n2,0.3,0.2,0.1\n"
JOINTS = "t,shoulder,wrist\n0,0,0\n1,0.4,0.1\n2,0.8,0\n"
URDF = """<robot name="arm"><link name="base"/><link name="upper"/><link name="cup"/>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
<axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="8" velocity="2"/></joint>
<joint name="wrist" type="revolute"><parent link="upper"/><child link="cup"/>
<origin xyz="0.4 0 0.1"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="5" velocity="3"/>
</joint></robot>"""
LIMITS = "joint_limits: {shoulder: {max_acceleration: 9.0, max_jerk: 150.0},\n \
 wrist: {max_acceleration: 9.0, max_jerk: 150.0}}\n"
KEPT = ("--limit", "0.015", "--residual", "0.004")
ERROR = ("--mae", "0.0005", "--epsilon", "0.05")
long = pytest.mark.long
needs_casadi = pytest.mark.skipif(
    not optimise.available(), reason="no CasADi (requirements/plan.txt)"
)


@pytest.fixture
def folder(tmp_path):
    files = {
        "bare.yaml": BARE, "box.yaml": BOX, "doubtful.yaml": DOUBTFUL, "tray.yaml": TRAY,
        "path.csv": CORNER, "joints.csv": JOINTS, "arm.urdf": URDF, "limits.yaml": LIMITS,
    }  # fmt: skip
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    return tmp_path


@pytest.mark.parametrize(
    ("model", "options", "shared", "seconds"),
    [
        pytest.param("bare", (), (), "0", id="without effects"),
        pytest.param("box", (), (), "0", id="box without effects"),
        pytest.param("doubtful", (), (), "0", id="covariance"),
        pytest.param("bare", (), ERROR, "0", id="error"),
        pytest.param("bare", (), (), "8", id="searched", marks=needs_casadi),
        pytest.param("bare", ("--max-tilt", "8"), (), "8", id="tilt", marks=[needs_casadi, long]),
        pytest.param("doubtful", ("--robust",), (), "2", id="robust", marks=[needs_casadi, long]),
        pytest.param("tray", (), (), "0", id="tray"),
        pytest.param("tray", (), ERROR, "3", id="tray and error", marks=long),
    ],
)
def test_a_plan_is_predicted_as_it_was_planned(folder, capsys, model, options, shared, seconds):
    model, out = str(folder / f"{model}.yaml"), str(folder / "out.csv")
    given = [model, str(folder / "path.csv"), *KEPT, *options, *shared, "-o", out, "--json"]
    assert main(["plan", *given, "--time-limit", seconds]) == 0
    planned = json.loads(capsys.readouterr().out)
    code = main(["predict", model, out, *KEPT, *shared, "--json"])
    (found,) = json.loads(capsys.readouterr().out)
    assert (code, found["kept"]) == (0, True)
    own = found if "containers" not in found else {"peak_nonlinear": found["containers"][
        planned["container"]]}  # fmt: skip
    assert own["peak_nonlinear"] == pytest.approx(planned["peak"], rel=1e-4)
    of = f"{found['container']}: " if "container" in found else ""
    assert bool(found["flags"] & 1) == (f"{of}planarity lost" in planned["remarks"])
    assert main(["predict", model, out, *KEPT, *shared]) == 0
    text = capsys.readouterr().out
    assert "as given" in text or found["time_scale"] <= 1.0
    assert "above the" not in text


@pytest.mark.skipif(not available(), reason="no Pinocchio (requirements/joints.txt)")
def test_a_plan_of_joints_is_predicted_as_it_was_planned(folder, capsys):
    robot = ["--urdf", str(folder / "arm.urdf"), "--tool-frame", "cup"]
    model, out = str(folder / "bare.yaml"), str(folder / "out.csv")
    given = [model, str(folder / "joints.csv"), *KEPT, *robot, "-o", out, "--json"]
    limits = ["--joint-limits", str(folder / "limits.yaml")]
    assert main(["plan", *given, *limits, "--time-limit", "0"]) == 0
    planned = json.loads(capsys.readouterr().out)
    assert main(["predict", model, out, *KEPT, *robot, "--json"]) == 0
    (found,) = json.loads(capsys.readouterr().out)
    assert found["kept"]
    assert found["peak_nonlinear"] == pytest.approx(planned["peak"], rel=2e-3)
