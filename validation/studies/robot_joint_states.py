"""Compares heights from joint states with the truth, for random motions of three robots.

    tools/run python -m pip install --no-deps -r requirements/robots.txt
    tools/run python validation/studies/robot_joint_states.py [--motions 20] [--first 1000]
        [--antisloshing FOLDER]

The robots and their random paths are those of `joint_plan_tables.py`, with other seeds; joints
follow a spline through the path, from rest to rest. Joint states come at 125 Hz, up to 1 ms early
or late, rounded to 0.1 mrad, in a random order and with a joint that the robot does not have. The
error is that of the NL model's height under the input `joints`, against the same model under the
true acceleration, in percent of the peak.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import with_tools  # noqa: F401
from joint_plan_tables import COMAU, MACHINES, MODEL, Kinematics, description, random_path
from scipy.interpolate import CubicSpline

from slosh_base.types import Array
from slosh_estimator.estimator import Estimator
from slosh_model.simulate import simulate
from slosh_motion.inputs.inputs import JOINTS, InputSettings
from slosh_motion.inputs.joint_poses import JointPoses
from slosh_motion.inputs.pose_input import PoseInput
from slosh_motion.inputs.sampling import modes_of
from slosh_plan.joints import Arm

BEGIN = 10**18
RATE, JITTER, RESOLUTION = 125.0, 1e-3, 1e-4
REST, AFTER, FINE = 0.6, 1.0, 1e-3
LIQUID = MODEL.with_gravity_tilt()


class Error(NamedTuple):
    """Errors of one motion's height by its peak: rms over the record, and of the peak itself."""

    rms: float
    peak: float


def motion(points: Array, lasts: float, t: Array) -> Array:
    """Returns joint positions (N, J) of a motion through points, which rests at both ends."""
    share = np.clip((t - REST) / lasts, 0.0, 1.0)
    along = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    found: Array = CubicSpline(np.linspace(0.0, 1.0, len(points)), points)(along)
    return found


def heights(
    urdf: str, joints: Sequence[str], t: Array, told: Array
) -> Iterator[tuple[float, float]]:
    """Yields stamps [s] and heights [m] that the estimator gives for joint states."""
    how = InputSettings(JOINTS, urdf=urdf, tool_frame="cup", modes=modes_of(LIQUID))
    poses, reader, estimator = how.poses(JOINTS), how.reader(JOINTS), Estimator(LIQUID)
    assert isinstance(poses, JointPoses)
    assert isinstance(reader, PoseInput)
    for moment, row in zip(t.tolist(), told.tolist(), strict=True):
        for pose in poses.take(BEGIN + round(moment * 1e9), joints, row, []):
            for sample in reader.update(*pose, None, "world"):
                estimate = estimator.update(sample)
                yield (sample.stamp_ns - BEGIN) * 1e-9, estimate.nonlinear.msh


def measure(name: str, seed: int, folder: Path | None) -> Error:
    """Returns the errors of one random motion of a robot."""
    machine, random = MACHINES[name], np.random.default_rng([seed, 7])
    urdf = description(machine, folder if name == COMAU else None)
    points, _ = random_path(Kinematics(urdf, machine.joints), seed)
    arm, unit = Arm(urdf, "cup", name), np.arange(REST, REST + 1.0, FINE)
    fastest = np.abs(np.gradient(motion(points, 1.0, unit), FINE, axis=0)).max(axis=0)
    # No joint moves faster than it can.
    least = float((fastest / arm.limits(machine.joints)["velocity"]).max())
    lasts = max(float(random.uniform(0.9, 1.8)), least)
    fine = np.arange(0.0, REST + lasts + AFTER, FINE)
    true = arm.motion(fine, machine.joints, motion(points, lasts, fine))
    inputs = true.inputs(0.0)
    known = simulate(LIQUID, inputs)[0].msh
    t = np.arange(0.0, fine[-1], 1.0 / RATE)
    t = np.sort(t + random.uniform(-JITTER, JITTER, len(t)))
    order = random.permutation(len(machine.joints))
    told = np.round(motion(points, lasts, t) / RESOLUTION)[:, order] * RESOLUTION
    names = [*(machine.joints[k] for k in order), "gripper"]
    found = np.array(list(heights(urdf, names, t, np.column_stack([told, 0.0 * t]))))
    expected = np.interp(found[:, 0], inputs.t, known)
    peak = float(known.max())
    rms = float(np.sqrt(np.mean((found[:, 1] - expected) ** 2)))
    return Error(rms / peak, abs(float(found[:, 1].max() - expected.max())) / peak)


def main() -> int:
    """Prints the errors for each robot."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--motions", type=int, default=20, help="of each robot (default: 20)")
    parser.add_argument("--first", type=int, default=1000, help="first seed (default: 1000)")
    parser.add_argument(
        "--antisloshing", type=Path, help="folder of the public data with the Comau's URDF"
    )
    arguments = parser.parse_args()
    for name in MACHINES:
        if name == COMAU and arguments.antisloshing is None:
            continue
        seeds = range(arguments.first, arguments.first + arguments.motions)
        errors = np.array([measure(name, seed, arguments.antisloshing) for seed in seeds])
        (rms, peak), (worst, worst_peak) = np.median(errors, axis=0), errors.max(axis=0)
        print(
            f"{name}: {len(errors)} motions, rms {100 * rms:.2f} % (worst {100 * worst:.2f} %), "
            f"peak {100 * peak:.2f} % (worst {100 * worst_peak:.2f} %)"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
