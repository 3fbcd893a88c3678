"""Tests which wrong mountings, units and gravity settings the mounting check finds.

tools/run python validation/studies/mountings.py --docs

Random honest motions (`honest_inputs.py`) move a container. A tracker tells its poses, an inertial
sensor or an acceleration topic tells the same motion as it is mounted: each of the 24 rotations of
axes, in m/s², g or mm/s², with gravity and without; the gyroscope in rad/s or degrees/s. Each case
is compared after the motions of the record, without a hint. Even seeds were used for tuning, odd
ones are reported.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import with_tools  # noqa: F401
from camera_sequences import ROOT
from honest_inputs import HonestInput, honest_input
from result_tables import fill
from scipy.spatial.transform import Rotation

from slosh_base.types import Array
from slosh_motion.inputs.gate import GateSettings
from slosh_motion.inputs.inputs import InputSettings
from slosh_motion.inputs.pose_input import PoseInput
from slosh_motion.inputs.sampling import Sample
from slosh_motion.inputs.sensor_inputs import ImuInput
from slosh_motion.mounting.columns import axis_rotations, rotation_vector
from slosh_motion.mounting.verdict import Expected, MountingVerdict
from slosh_motion.mounting.watch import MountingWatch

PAGE = ROOT / "docs" / "input_checks.md"
UNITS = {"m/s²": 1.0, "g": 1.0 / 9.81, "mm/s²": 1000.0}
TRACKER, TURNED = 5e-5, 2e-4
"""Noise of positions [m] and attitudes [rad]."""
COARSE, COARSE_RATE, COARSE_SEEDS = (1e-3, 2e-3), 60.0, 5
"""Noise of a coarse tracker [m, rad], its rate [Hz], and motions for each seed."""
LOOKS = 500_000_000
"""So often the watch looks [ns]."""
WHEN = ("the first motion", "all motions")
WORLD = np.array((0.0, 0.0, 9.81))


class Mounted(NamedTuple):
    """A simulated sensor's mounting rotation, unit and gravity setting.

    Attributes:
        rotation: (3, 3) sensor ← container.
        unit: of the accelerations.
        gravity: whether it is contained.
        degrees: whether the angular velocity is in degrees/s.
    """

    rotation: Array
    unit: str = "m/s²"
    gravity: bool = True
    degrees: bool = False


def poses(
    honest: HonestInput,
    seed: int,
    noise: tuple[float, float] = (TRACKER, TURNED),
    rate: float = math.inf,
) -> list[Sample]:
    """Returns the input samples that the estimator makes of a tracker's noisy poses.

    Args:
        honest: motion.
        seed: of the noise.
        noise: of positions [m] and attitudes [rad].
        rate: at most [Hz].
    """
    random = np.random.default_rng([seed, 1])
    how = InputSettings("pose", GateSettings(max_gap=0.2, confirms=False), any_world=True)
    reader = how.reader("pose")
    assert isinstance(reader, PoseInput)
    count = len(honest.stamps)
    # Its positions are sums of sums: their second difference is the acceleration a sample ahead.
    places = np.vstack([honest.position[:1], honest.position[:-1]])
    places = places + random.normal(0.0, noise[0], (count, 3))
    turn = Rotation.from_rotvec(random.normal(0.0, noise[1], (count, 3)))
    turns = (honest.attitude * turn).as_quat()
    found: list[Sample] = []
    each = max(round(1e9 / float(np.median(np.diff(honest.stamps))) / rate), 1)
    for k in range(0, count, each):
        found += reader.update(
            int(honest.stamps[k]), tuple(places[k].tolist()), tuple(turns[k].tolist())
        )
    return found


def told(honest: HonestInput, mounted: Mounted, kind: str) -> tuple[Array, Array]:
    """Returns the accelerations and angular velocities (N, 3) that the mounted sensor measures."""
    up = honest.attitude.inv().apply(np.tile(WORLD, (len(honest.stamps), 1)))
    if kind == "imu":
        force = honest.force - (0.0 if mounted.gravity else up)
    else:
        force = honest.acceleration + (WORLD if mounted.gravity else 0.0)
    force = UNITS[mounted.unit] * force @ mounted.rotation.T
    # Theirs is that of the step ahead.
    rate = 0.5 * (honest.rate + np.vstack([honest.rate[:1], honest.rate[:-1]]))
    rate = rate @ mounted.rotation.T
    return force, np.degrees(rate) if mounted.degrees else rate


def verdicts(
    honest: HonestInput,
    moved: Sequence[Sample],
    mounted: Mounted,
    kind: str,
    rotation: Array | None = None,
) -> tuple[MountingVerdict | None, MountingVerdict | None]:
    """Returns the mounting verdicts after the first motion and after all motions.

    Args:
        honest: motion.
        moved: the same by the tracker.
        mounted: how the sensor is.
        kind: 'imu' or 'accel'.
        rotation: (3, 3) container ← sensor that is said; None: the same axes.
    """
    said = Expected(
        np.eye(3) if rotation is None else rotation, np.zeros(3), kind == "imu", kind == "imu"
    )
    watch = MountingWatch(said, in_world=kind == "accel")
    force, rate = told(honest, mounted, kind)
    readings = zip(honest.stamps.tolist(), force.tolist(), rate.tolist(), strict=True)
    motions = iter(moved)
    due, first = int(honest.stamps[0]), None
    for stamp, f, w in readings:
        watch.take_sensor(stamp, tuple(f), tuple(w) if kind == "imu" else None)
        if stamp < due:
            continue
        due = stamp + LOOKS
        for sample in motions:
            watch.take_motion(sample.stamp_ns, (sample.ax, sample.ay, sample.az), sample.pose)
            if sample.stamp_ns >= stamp:
                break
        watch.look()
        first = first or watch.verdict
    watch.look(finished=True)
    return first or watch.verdict, watch.verdict


class Case(NamedTuple):
    """A kind of sensor with its simulated mounting."""

    kind: str
    mounted: Mounted

    @property
    def right(self) -> bool:
        """Whether unit and gravity setting are right, whatever the rotation."""
        gravity = self.mounted.gravity == (self.kind == "imu")
        return self.mounted.unit == "m/s²" and gravity and not self.mounted.degrees

    def faults(self, turns: bool) -> set[str]:
        """Returns the faults that the check must name for this case."""
        found = set()
        if self.mounted.unit != "m/s²":
            found.add(f"it is in {self.mounted.unit}")
        if self.mounted.gravity != (self.kind == "imu"):
            found.add("gravity is left out" if self.kind == "imu" else "gravity is contained")
        if self.mounted.degrees and turns:
            found.add("in degrees/s")
        return found


def cases(kind: str) -> Iterator[Case]:
    """Yields all cases: 24 rotations, 3 units, with and without gravity."""
    number = 0
    for rotation in axis_rotations():
        for unit in UNITS:
            for gravity in (True, False):
                number += 1
                yield Case(
                    kind, Mounted(rotation, unit, gravity, kind == "imu" and number % 2 == 0)
                )


def outcome(case: Case, found: MountingVerdict | None) -> str:
    """Judges a verdict: 'named', 'in part', 'unseen', 'silent' or 'still'."""
    if found is None:
        return "still"
    rotation = case.mounted.rotation
    turned = not np.array_equal(rotation, np.eye(3))
    want = case.faults(found.fit.turn is not None)
    said = "; ".join(found.wrong)
    hidden = any("turn" in one for one in found.unseen if "hardly" not in one)
    missing = {one for one in want if one not in said}
    remedy = (
        math.isclose(float(np.sum(axes_of(found) * rotation.T)), 3.0, abs_tol=0.02)
        and "set sensor_rotation" in said
    )
    if (not turned or remedy) and not missing:
        return "named" if turned or want or not said else "false"
    if hidden and not missing:
        return "unseen"
    if not turned and not want:
        return "false" if said else "named"
    return "in part" if said else "unseen" if hidden else "silent"


def axes_of(found: MountingVerdict) -> Array:
    """Returns the rotation (3, 3) container ← sensor that a verdict suggests."""
    roll, pitch, yaw = found.sensor_rotation
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return np.array([
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ])  # fmt: skip


OUTCOMES = ("named", "in part", "unseen", "silent", "false", "still")
HEAD = (
    "| sensor | mounting | judged after | cases | named with the remedy | named in part | turn "
    "not shown, told | accepted silently | named though right | no motion |\n"
    "|---|---|---|--:|--:|--:|--:|--:|--:|--:|"
)
"""Columns: what must be read, and OUTCOMES."""


def counted(seed: int, kind: str) -> Iterator[tuple[str, str, str]]:
    """Yields mounting, time of judgement and outcome of every case for one motion."""
    honest = honest_input(seed)
    moved = poses(honest, seed)
    for case in cases(kind):
        identity = np.array_equal(case.mounted.rotation, np.eye(3))
        what = "right" if identity and case.right else "wrong"
        pair = verdicts(honest, moved, case.mounted, kind)
        for when, found in zip(WHEN, pair, strict=True):
            yield what, when, outcome(case, found)
    for rotation in axis_rotations():
        pair = verdicts(honest, moved, Mounted(rotation, gravity=kind == "imu"), kind, rotation.T)
        for when, found in zip(WHEN, pair, strict=True):
            good = "still" if found is None else "false" if found.wrong else "named"
            yield "right", when, good


def coarse(seed: int, kind: str) -> Iterator[tuple[str, str, str]]:
    """Yields the outcomes of a rightly mounted sensor against a coarse tracker."""
    honest = honest_input(seed)
    moved = poses(honest, seed, COARSE, COARSE_RATE)
    pair = verdicts(honest, moved, Mounted(np.eye(3), gravity=kind == "imu"), kind)
    for when, found in zip(WHEN, pair, strict=True):
        good = "still" if found is None else "false" if found.wrong else "named"
        yield "right, poses of 1 mm", when, good


def alone(seed: int) -> Iterator[tuple[str, str, str]]:
    """Yields the outcomes of an inertial sensor alone, checked only by gravity."""
    honest = honest_input(seed)
    for case in cases("imu"):
        reader = InputSettings("imu", GateSettings(confirms=False)).reader("imu")
        assert isinstance(reader, ImuInput)
        force, rate = told(honest, case.mounted, "imu")
        rows = zip(honest.stamps.tolist(), force.tolist(), rate.tolist(), strict=True)
        for stamp, f, w in rows:
            reader.update(stamp, tuple(f), tuple(w))
        reader.check.finish()
        said = any(doubt.wrong for doubt in reader.check.raised.values()) or not reader.gate.used
        upright = case.mounted.rotation[2, 2] > 0.5
        what = "right" if case.right and upright else "wrong"
        unseen = upright and case.mounted.unit == "m/s²" and case.mounted.gravity
        if what == "right":
            yield "right, or turned about z", WHEN[1], "false" if said else "named"
        else:
            yield "wrong otherwise", WHEN[1], "named" if said else "unseen" if unseen else "silent"


def errors(seeds: Sequence[int]) -> Array:
    """Returns errors (K, 3) of measured rotations in standard errors, by principal axis."""
    found = []
    for seed in seeds:
        honest = honest_input(seed)
        rotation = Rotation.random(random_state=seed).as_matrix()
        last = verdicts(honest, poses(honest, seed), Mounted(rotation), "imu", rotation.T)[1]
        if last is not None:
            off = rotation_vector(rotation.T @ last.fit.rotation)
            values, axes = np.linalg.eigh(last.fit.covariance)
            found.append(axes.T @ off / np.sqrt(values))
    return np.array(found)


def rows(seeds: Sequence[int]) -> Iterator[str]:
    """Yields the table rows."""
    for kind in ("imu", "accel", "imu alone"):
        count: Counter[tuple[str, str, str]] = Counter()
        for seed in seeds:
            if kind == "imu alone":
                count.update(alone(seed))
                continue
            count.update(counted(seed, kind))
            for other in range(seed, seed + COARSE_SEEDS * 100, 100):
                count.update(coarse(other, kind))
            print(kind, seed, dict(count), file=sys.stderr, flush=True)
        for what, when in sorted({key[:2] for key in count}, reverse=True):
            cells = [count[what, when, one] for one in OUTCOMES]
            yield f"| {kind} | {what} | {when} | {sum(cells)} | {' | '.join(map(str, cells))} |"


def main() -> int:
    """Tests all mountings and prints or writes the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--motions", type=int, default=10)
    parser.add_argument("--tuning", action="store_true", help="use the seeds for tuning")
    parser.add_argument("--docs", action="store_true", help="write the table")
    arguments = parser.parse_args()
    first = 0 if arguments.tuning else 1
    seeds = range(first, first + 2 * arguments.motions, 2)
    lines = [HEAD]
    print(HEAD)
    for row in rows(seeds):
        print(row, flush=True)
        lines.append(row)
    off = np.abs(errors(seeds))
    print(f"within 1, 2, 3 standard errors: {[float(np.mean(off < k)) for k in (1, 2, 3)]}")
    if arguments.docs:
        fill(PAGE, "mountings", "\n".join(lines) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
