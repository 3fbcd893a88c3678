"""Compares the models with measurements and CFD results, if the data are present."""

import os
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_motion.inputs.inputs import WantedInput
from slosh_motion.inputs.robot import available
from slosh_motion.tables.motion_table import read_motion_table
from slosh_plan.joints import Arm
from slosh_replay.replay import replay_bag, replay_table
from slosh_replay.tables.antisloshing import (
    JOINTS,
    import_antisloshing,
    read_arm,
    read_joints,
    read_poses,
)
from slosh_testing.robot_runs import RUNS, write_runs

REPOSITORY = Path(__file__).resolve().parents[2]
DATA = Path(os.environ.get("SLOSH_SHARED_DATA", REPOSITORY.parent / "shared" / "data"))
ANTISLOSHING = DATA / "antisloshing"
CFD = DATA / "cfd"
CUP = Model(Cylinder(0.05, 0.07))


@pytest.fixture(scope="module", params=[pytest.param("published", marks=pytest.mark.long), "own"])
def untilted(request, tmp_path_factory):
    """Returns replays of runs of a robot's cup: published ones, or simulated ones."""
    folder = ANTISLOSHING
    if request.param == "own":
        folder = write_runs(tmp_path_factory.mktemp("own"))
    elif not folder.is_dir():
        pytest.skip(f"no measured runs in {folder}")
    return replays(folder, tmp_path_factory.mktemp("bags"))


def replays(folder, output):
    bags = import_antisloshing(folder, output)
    return [replay_bag(bag) for bag in bags if not bag.name.startswith("Tilt")]


def plain(name):
    """Returns a model's name without the gravity_tilt that poses add."""
    return name.removesuffix("+gravity_tilt")


def mean(results, model, field):
    rows = [row for r in results for row in r.accuracy if plain(row.name) == model]
    values = [getattr(row, field) for row in rows]
    return float(np.mean(values))


class TestMeasuredRuns:
    @pytest.mark.long
    def test_3d_nl_has_the_smallest_mean_error(self, untilted):
        sigma = {name: mean(untilted, name, "sigma") for name in ("2D-L", "3D-L", "2D-NL")}
        best = mean(untilted, "3D-NL", "sigma")
        assert best < min(sigma.values())
        assert best < 2.5e-3

    def test_3d_nl_meets_the_peaks_best(self, untilted):
        sizes = {
            plain(row.name): np.mean([abs(r.accuracy[k].epsilon) for r in untilted])
            for k, row in enumerate(untilted[0].accuracy)
        }
        assert min(sizes, key=sizes.get) == "3D-NL"
        assert sizes["3D-NL"] < 0.13

    def test_every_offset_of_3d_nl_is_unambiguous(self, untilted):
        ambiguous = [r.name for r in untilted if not r.accuracy[-1].clock.unambiguous]
        assert ambiguous == []


@pytest.mark.long
def test_two_clocks_are_laid_over_each_other_where_they_are(tmp_path):
    found = replays(write_runs(tmp_path / "runs"), tmp_path / "bags")
    assert {result.name for result in found} == set(RUNS)
    for result in found:
        clock = result.accuracy[-1].clock
        assert clock.offset == pytest.approx(RUNS[result.name], abs=1e-2), result.name
        assert result.accuracy[-1].sigma < 1.2e-3, result.name


@pytest.mark.long
@pytest.mark.skipif(not ANTISLOSHING.is_dir(), reason=f"no measured runs in {ANTISLOSHING}")
@pytest.mark.skipif(not available(), reason="no Pinocchio (requirements/joints.txt)")
def test_joints_of_a_real_robot_give_the_heights_of_its_poses(tmp_path):
    """Tests that a robot's joint positions give the same heights as the recorded cup poses."""
    compared = 0
    for bag in import_antisloshing(ANTISLOSHING, tmp_path):
        if not any((ANTISLOSHING / "joints").glob(f"{bag.name}.csv*")):
            continue
        joints, poses = (replay_bag(bag, given=WantedInput(kind)) for kind in ("joints", "pose"))
        one, other = ({plain(k): h for k, h in r.heights.items()} for r in (joints, poses))
        apart = one["3D-NL"] - other["3D-NL"]
        assert np.sqrt(np.nanmean(apart**2)) < 5e-5, bag.name
        compared += 1
    assert compared == 13


@pytest.mark.skipif(not ANTISLOSHING.is_dir(), reason=f"no measured runs in {ANTISLOSHING}")
@pytest.mark.skipif(not available(), reason="no Pinocchio (requirements/joints.txt)")
def test_the_kinematics_of_a_real_robot_give_its_poses():
    """Tests that forward kinematics reproduce the recorded poses of a robot's cup."""
    data = read_arm(ANTISLOSHING)
    assert data is not None
    assert len(data.joints) == 13
    text = data.urdf.replace('xyz="0.54707 0.0 0.0"', 'xyz="0.5471 0.0 0.0"')
    assert text != data.urdf
    arm, base = Arm(text, "container", "comau"), Rotation.from_euler("z", 3.14 - np.pi)
    apart = []
    for path in data.joints.values():
        joints, poses = read_joints(path), read_poses(ANTISLOSHING / "poses" / path.name)
        position, attitude = arm.poses(JOINTS, joints[:, 1:])
        turned = base * Rotation.from_quat(attitude)
        off = turned.inv() * Rotation.from_quat(poses[:, 4:])
        assert off.magnitude().max() < 1e-9, path.name
        apart.append(base.apply(position) - poses[:, 1:4])
    origin = np.mean(apart[0], axis=0)
    assert max(np.abs(one - origin).max() for one in apart) < 1e-6


@pytest.mark.skipif(not CFD.is_dir(), reason=f"no CFD tables in {CFD}")
@pytest.mark.parametrize("motion", ["l1", "e1"])
def test_l_overestimates_and_nl_underestimates_the_cfd_peak(motion):
    table = read_motion_table(CFD / f"{motion}.csv.gz")
    rows = {row.name: row for row in replay_table(motion, table, CUP).accuracy}
    assert 0.0 < rows["2D-L"].epsilon < 0.10
    assert -0.20 < rows["2D-NL"].epsilon < 0.0
