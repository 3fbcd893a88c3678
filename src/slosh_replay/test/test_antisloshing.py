"""Tests that the importer keeps every number and reports broken files."""

import gzip
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from slosh_bag.errors import SloshBagError
from slosh_bag.reader import BagReader
from slosh_base.files.errors import SloshFileError
from slosh_motion.inputs.robot import Robot, available
from slosh_replay.tables.antisloshing import POSE_TOPIC, SURFACE_TOPIC, import_antisloshing

RUN = "LE_2D_test"
TIMES = np.arange(20) / 60.0
HEIGHTS = np.linspace(-3.0, 30.0, 20)
POSE = "{t:g};0.1;0.2;0.3;0;0;0;1\n"


@pytest.fixture
def data(tmp_path: Path) -> Path:
    folder = tmp_path / "data"
    (folder / "heights").mkdir(parents=True)
    (folder / "poses").mkdir()
    write_heights(folder, slosh_times=TIMES, slosh_heights=HEIGHTS)
    write_poses(folder, "".join(POSE.format(t=0.002 * k) for k in range(30)))
    return folder


def write_heights(folder: Path, **variables: object) -> None:
    scipy.io.savemat(folder / "heights" / f"{RUN}.mat", variables)


def write_poses(folder: Path, text: str) -> None:
    (folder / "poses" / f"{RUN}.csv.gz").write_bytes(gzip.compress(text.encode()))


def test_every_sample_is_in_the_bag(data: Path, tmp_path: Path):
    (bag,) = import_antisloshing(data, tmp_path / "bags")
    reader = BagReader(bag)
    surfaces = [reader.decode(message) for message in reader.messages([SURFACE_TOPIC])]
    np.testing.assert_allclose([surface.msh for surface in surfaces], 1e-3 * HEIGHTS)
    assert np.isnan([surface.fitted_msh for surface in surfaces]).all()
    stamps = [s.header.stamp.sec + 1e-9 * s.header.stamp.nanosec for s in surfaces]
    np.testing.assert_allclose(stamps, 1.0 + TIMES, atol=1e-9)
    poses = [reader.decode(message) for message in reader.messages([POSE_TOPIC])]
    assert len(poses) == 30
    assert (poses[3].pose.position.y, poses[3].pose.orientation.w) == (0.2, 1.0)


URDF = """<?xml version="1.0"?><link name="world"/><link name="axes_6"/>
<joint name="q3_joint" type="revolute"><parent link="world"/><child link="axes_6"/>
<axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>"""


def write_joints(folder: Path, text: str) -> None:
    (folder / "arm.urdf").write_text(URDF)
    (folder / "joints").mkdir()
    (folder / "joints" / f"{RUN}.csv").write_text(text)


def test_joints_are_kept_in_the_convention_of_the_arms_description(data: Path, tmp_path: Path):
    write_joints(data, "".join(f"{0.002 * k:g};0.1;0.2;0.3;0.4;0.5;0.6\n" for k in range(30)))
    (bag,) = import_antisloshing(data, tmp_path / "bags")
    reader = BagReader(bag)
    states = [reader.decode(message) for message in reader.messages(["/joint_states"])]
    assert len(states) == 30
    np.testing.assert_allclose(states[3].position, [0.1, 0.2, 0.3 - 1.57, 0.4, 0.5, 0.6])
    (told,) = [reader.decode(one).data for one in reader.messages(["/robot_description"])]
    if not available():
        return
    robot = Robot(told, "container", "world")
    assert robot.carrying == ("q3_joint",)
    position, turn = robot.pose({"q3_joint": -0.5 * np.pi})
    # The cup hangs 80 mm in front of the flange, and stands upright where that points up.
    np.testing.assert_allclose(position, [0.0, 0.0, 0.08], atol=1e-12)
    np.testing.assert_allclose(np.abs(turn)[2:], [1.0, 0.0], atol=1e-9)


def test_joints_that_are_no_table_are_named(data: Path, tmp_path: Path):
    write_joints(data, "0;1;2;3\n")
    with pytest.raises(SloshBagError, match="line 1: has 4 columns, expected t;q1;q2"):
        import_antisloshing(data, tmp_path / "bags")


def test_the_bag_says_that_its_clocks_are_unrelated(data: Path, tmp_path: Path):
    (bag,) = import_antisloshing(data, tmp_path / "bags")
    facts = BagReader(bag).metadata()
    assert facts["clocks"] == "unrelated"
    assert (facts["container_radius"], facts["container_fill_height"]) == ("0.049", "0.078")


@pytest.mark.parametrize(
    ("poses", "expected"),
    [
        ("", "is empty"),
        ("0;1;2\n", "line 1: has 3 columns"),
        (POSE.format(t=0) + "0.002;a;0;0;0;0;0;1\n", "line 2: '0.002;a;0;0;0;0;0;1' is not all"),
        ("0;nan;0;0;0;0;0;1\n", "line 1: a value is not finite"),
        (POSE.format(t=1) + POSE.format(t=1), "t, entry 2: 1 s does not come after 1 s"),
    ],
)
def test_broken_poses_are_named(data: Path, tmp_path: Path, poses: str, expected: str):
    write_poses(data, poses)
    check_refused(data, tmp_path, f"poses/{RUN}.csv.gz", expected)


@pytest.mark.parametrize(
    ("variables", "expected"),
    [
        ({"slosh_times": TIMES}, "'slosh_heights' is missing"),
        ({"slosh_times": TIMES, "slosh_heights": []}, "'slosh_heights' is missing, empty"),
        ({"slosh_times": TIMES, "slosh_heights": HEIGHTS[1:]}, "20 slosh_times but 19"),
        ({"slosh_times": -TIMES, "slosh_heights": HEIGHTS}, "does not come after"),
    ],
)
def test_broken_heights_are_named(data: Path, tmp_path: Path, variables, expected: str):
    write_heights(data, **variables)
    check_refused(data, tmp_path, f"heights/{RUN}.mat", expected)


def test_cut_off_files_are_named(data: Path, tmp_path: Path):
    poses = data / "poses" / f"{RUN}.csv.gz"
    poses.write_bytes(poses.read_bytes()[:40])
    check_refused(data, tmp_path, poses.name, "cut off or damaged")
    heights = data / "heights" / f"{RUN}.mat"
    heights.write_bytes(heights.read_bytes()[:200])
    check_refused(data, tmp_path, heights.name, "is not a readable MATLAB file")


@pytest.mark.parametrize("kind", ["heights", "poses"])
def test_a_missing_twin_is_named(data: Path, tmp_path: Path, kind: str):
    next((data / kind).iterdir()).unlink()
    check_refused(data, tmp_path, RUN, f"has no matching {kind}/{RUN}")


def test_an_empty_folder_is_named(tmp_path: Path):
    check_refused(tmp_path, tmp_path, str(tmp_path), "holds no heights")


def check_refused(data: Path, tmp_path: Path, where: str, expected: str) -> None:
    with pytest.raises(SloshFileError) as caught:
        import_antisloshing(data, tmp_path / "bags")
    message = str(caught.value)
    assert where in message
    assert expected in message
    assert "\n" not in message
