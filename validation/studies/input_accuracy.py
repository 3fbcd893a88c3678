"""Compares the height errors of all kinds of estimator input for the same motions.

tools/run python validation/studies/input_accuracy.py --docs

A two-link arm moves a cup by random moves with piecewise constant jerk. Poses, joint states and
velocities of it are rounded to a resolution and taken up to a time early or late, and say so. The
error is that of the NL model's height under the input, against the same model under the true
acceleration, as rms over the whole record in percent of the peak: median and worst motion.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
import with_tools  # noqa: F401
from camera_sequences import ROOT
from result_tables import fill

from slosh_base.types import Array
from slosh_estimator.estimator import Estimator
from slosh_motion.inputs.gate import GateSettings
from slosh_motion.inputs.inputs import InputSettings
from slosh_motion.inputs.joint_poses import JointPoses
from slosh_motion.inputs.pose_input import PoseInput
from slosh_motion.inputs.sampling import Sample, Samples, modes_of
from slosh_motion.inputs.velocity_input import Twist, VelocityInput
from slosh_testing.joint_driver import FORE, JOINTS, RAIL_URDF, UPPER, cup_position, quaternion
from slosh_testing.random_moves import AFTER, MODEL, moves

PAGE = ROOT / "docs" / "robot.md"
RATES, RESOLUTIONS, JITTERS = (125, 250, 500, 1000), (0.02, 0.1, 1.0), (0.0, 1.0, 4.0)
"""Hz, mm, ms."""
REACH, STEP, WINDOW = UPPER + FORE, 1e-4, 0.1
"""Of the arm [m]; of differences [s]; in which a driver derives velocities from positions [s]."""
HEAD = "| input | Hz | resolution [mm] | no jitter | 1 ms | 4 ms |\n|---|--:|--:|--:|--:|--:|"


class Motion(NamedTuple):
    """A robot arm's joint positions over time, and the true wave height.

    Attributes:
        end: of the record [s].
        joints: (N, 4) of JOINTS at times (N,) [s].
        t, wave: (M,) times [s] and the NL model's height under the true acceleration [m].
    """

    end: float
    joints: Callable[[Array], Array]
    t: Array
    wave: Array


class Sampled(NamedTuple):
    """How a robot publishes its motion: rate [Hz], resolution [m], jitter [s]."""

    rate: float
    resolution: float
    jitter: float

    def times(self, end: float, seed: int) -> Array:
        """Draws increasing publishing times (N,) [s]."""
        random = np.random.default_rng(seed)
        count = int(end * self.rate)
        t = (np.arange(count) + 1.0) / self.rate + random.uniform(-1, 1, count) * self.jitter
        stamps = np.unique(np.rint(np.maximum(t, 0.0) * 1e9))
        return np.asarray(stamps * 1e-9, dtype=np.float64)

    def rounded(self, values: Array, unit: float = 1.0) -> Array:
        """Rounds values to the resolution; `unit` is the value of one metre."""
        quantum = self.resolution * unit
        return np.asarray(np.round(values / quantum) * quantum, dtype=np.float64)


def motion(seed: int) -> Motion:
    """Returns a random motion of the robot arm for a seed."""
    move = moves(seed)

    def joints(t: Array) -> Array:
        x, y = move.at(np.maximum(t, 0.0))[0][:, :2].T
        return np.column_stack([0.0 * x, 1.1 * x + 0.3, 0.8 - 1.1 * y, 0.0 * x])

    t = np.arange(0.0, move.end + AFTER, 5e-4)
    places = [cup_position(*joints(t + k * STEP).T) for k in (-1, 0, 1)]
    felt = np.ascontiguousarray((places[0] - 2.0 * places[1] + places[2]) / STEP**2)
    restarted = np.zeros(len(t), dtype=bool)
    restarted[0] = True
    stamps = np.rint(t * 1e9).astype(np.int64)
    found = Estimator(MODEL).update_many(Samples(stamps, felt, np.zeros(len(t)), restarted))
    return Motion(move.end + AFTER, joints, t, found.heights[:, 1, 0])


def by_poses(robot: Motion, sampled: Sampled, t: Array) -> Iterator[Sample]:
    """Yields input samples from simulated tracker poses."""
    reader = settings("pose").reader("pose")
    assert isinstance(reader, PoseInput)
    q = robot.joints(t)
    places = sampled.rounded(cup_position(*q.T))
    for at, place, row in zip(t.tolist(), places.tolist(), q.tolist(), strict=True):
        yield from reader.update(round(at * 1e9), tuple(place), quaternion(*row[1:]))


def by_joints(robot: Motion, sampled: Sampled, t: Array) -> Iterator[Sample]:
    """Yields input samples from simulated joint states with encoder resolution."""
    how = settings("joints")._replace(urdf=RAIL_URDF, tool_frame="cup")
    reader, poses = how.reader("joints"), how.poses("joints")
    assert isinstance(reader, PoseInput)
    assert isinstance(poses, JointPoses)
    q = sampled.rounded(robot.joints(t), 1.0 / REACH)
    for at, row in zip(t.tolist(), q.tolist(), strict=True):
        for pose in poses.take(round(at * 1e9), JOINTS, row):
            yield from reader.update(*pose)


def by_velocities(robot: Motion, sampled: Sampled, t: Array, kind: str) -> Iterator[Sample]:
    """Yields input samples from simulated odometry or twists."""
    reader, q = settings(kind).reader(kind), robot.joints(t)
    assert isinstance(reader, VelocityInput)
    before, after = (robot.joints(t + k * STEP) for k in (-1, 1))
    linear = (cup_position(*after.T) - cup_position(*before.T)) / (2 * STEP)
    rate = (after - before)[:, 1:3].sum(axis=1) / (2 * STEP)
    linear = sampled.rounded(linear, 1.0 / WINDOW)
    rate = sampled.rounded(rate, 1.0 / WINDOW / REACH)
    for at, v, w, row in zip(t.tolist(), linear.tolist(), rate.tolist(), q.tolist(), strict=True):
        turn = quaternion(*row[1:])
        c, s = math.cos(row[1] + row[2]), math.sin(row[1] + row[2])
        stamp, turning = round(at * 1e9), (0.0, 0.0, w)
        if kind == "odometry":
            own = (c * v[0] + s * v[1], c * v[1] - s * v[0], v[2])
            yield from reader.update_twist(Twist(stamp, own, turning, turn))
        else:
            yield from reader.update_twist(Twist(stamp, tuple(v), turning, None, "world"))


Made = Callable[[Motion, Sampled, Array], Iterator[Sample]]
INPUTS: dict[str, Made] = {
    "pose": by_poses,
    "joints": by_joints,
    "odometry": lambda robot, sampled, t: by_velocities(robot, sampled, t, "odometry"),
    "twist": lambda robot, sampled, t: by_velocities(robot, sampled, t, "twist"),
}


def settings(kind: str) -> InputSettings:
    """Returns the input settings as the estimator node uses them."""
    return InputSettings(kind, GateSettings(max_gap=0.2, confirms=False), modes=modes_of(MODEL))


def error(robot: Motion, sampled: Sampled, made: Made, seed: int) -> float:
    """Returns the rms height error of an input relative to the peak height."""
    samples = list(made(robot, sampled, sampled.times(robot.end, seed)))
    found = Estimator(MODEL).update_many(Samples.of(samples))
    true = np.interp(found.stamps * 1e-9, robot.t, robot.wave)
    return float(np.sqrt(np.mean((found.heights[:, 1, 0] - true) ** 2)) / robot.wave.max())


def rows(robots: Sequence[Motion]) -> Iterator[str]:
    """Yields the table rows, one for each input, rate and resolution."""
    for name, made in INPUTS.items():
        for rate in RATES:
            for resolution in RESOLUTIONS:
                cells = []
                for jitter in JITTERS:
                    sampled = Sampled(rate, 1e-3 * resolution, 1e-3 * jitter)
                    errors = [
                        100.0 * error(robot, sampled, made, seed)
                        for seed, robot in enumerate(robots)
                    ]
                    cells.append(f"{np.median(errors):.1f}, {max(errors):.1f}")
                yield f"| {name} | {rate} | {resolution:g} | {' | '.join(cells)} |"


def main() -> int:
    """Measures all inputs and prints or writes the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--motions", type=int, default=8)
    parser.add_argument("--docs", action="store_true", help="write the table")
    arguments = parser.parse_args()
    robots = [motion(seed) for seed in range(arguments.motions)]
    lines = [HEAD]
    print(HEAD)
    for row in rows(robots):
        print(row, flush=True)
        lines.append(row)
    if arguments.docs:
        fill(PAGE, "inputs", "\n".join(lines) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
