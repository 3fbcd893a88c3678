"""Write the table of docs/input_checks.md: wrong mountings, units and gravity, and what is named.

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
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import with_tools  # noqa: F401
from camera_sequences import ROOT
from honest_inputs import HonestInput, honest_input
from result_tables import fill

from slosh_base.types import Array
from slosh_estimator.gate import GateSettings
from slosh_estimator.inputs import InputSettings
from slosh_estimator.pose_input import PoseInput
from slosh_estimator.sample import Sample
from slosh_metrics.mounting.rotations import axis_rotations
from slosh_metrics.mounting.verdict import Expected, MountingVerdict
from slosh_metrics.mounting.watch import MountingWatch

PAGE = ROOT / "docs" / "input_checks.md"
UNITS = {"m/s²": 1.0, "g": 1.0 / 9.81, "mm/s²": 1000.0}
TRACKER, TURNED = 5e-5, 2e-4
"""Noise of positions [m] and attitudes [rad]."""
LOOKS = 500_000_000
"""So often the watch looks [ns]."""
WORLD = np.array((0.0, 0.0, 9.81))


class Mounted(NamedTuple):
    """A sensor as it is mounted.

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


def poses(honest: HonestInput, seed: int) -> list[Sample]:
    """What the estimator's own input makes of a tracker's poses."""
    random = np.random.default_rng([seed, 1])
    how = InputSettings("pose", GateSettings(confirms=False), any_world=True)
    reader = how.reader("pose")
    assert isinstance(reader, PoseInput)
    count = len(honest.stamps)
    places = honest.position + random.normal(0.0, TRACKER, (count, 3))
    turn = type(honest.attitude).from_rotvec(random.normal(0.0, TURNED, (count, 3)))
    turns = (honest.attitude * turn).as_quat()
    found: list[Sample] = []
    for stamp, place, q in zip(honest.stamps, places.tolist(), turns.tolist(), strict=True):
        found += reader.update(int(stamp), tuple(place), tuple(q))
    return found


def told(honest: HonestInput, mounted: Mounted, kind: str) -> tuple[Array, Array]:
    """Accelerations and angular velocities (N, 3) that the sensor tells."""
    up = honest.attitude.inv().apply(np.tile(WORLD, (len(honest.stamps), 1)))
    if kind == "imu":
        force = honest.force - (0.0 if mounted.gravity else up)
    else:
        force = honest.acceleration + (WORLD if mounted.gravity else 0.0)
    force = UNITS[mounted.unit] * force @ mounted.rotation.T
    rate = honest.rate @ mounted.rotation.T
    return force, np.degrees(rate) if mounted.degrees else rate


def verdicts(
    honest: HonestInput, moved: Sequence[Sample], mounted: Mounted, kind: str,
    rotation: Array | None = None,
) -> tuple[MountingVerdict | None, MountingVerdict | None]:
    """What is said of a sensor after the first motion, and after all of them.

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
    readings = zip(honest.stamps.tolist(), map(tuple, force.tolist()), map(tuple, rate.tolist()))
    motions = iter(moved)
    due, first = int(honest.stamps[0]), None
    for stamp, f, w in readings:
        watch.take_sensor(stamp, f, w if kind == "imu" else None)
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
    """A mounting, and what is true of it."""

    kind: str
    mounted: Mounted

    @property
    def right(self) -> bool:
        """Whether nothing is wrong, if the rotation is as said."""
        gravity = self.mounted.gravity == (self.kind == "imu")
        return self.mounted.unit == "m/s²" and gravity and not self.mounted.degrees

    def faults(self, turns: bool) -> set[str]:
        """What must be named, if the motion turns."""
        found = set()
        if self.mounted.unit != "m/s²":
            found.add(f"it is in {self.mounted.unit}")
        if self.mounted.gravity != (self.kind == "imu"):
            found.add("gravity is left out" if self.kind == "imu" else "gravity is contained")
        if self.mounted.degrees and turns:
            found.add("in degrees/s")
        return found


def cases(kind: str) -> Iterator[Case]:
    """24 rotations, 3 units, gravity in and out, and for a gyroscope both units in turn."""
    number = 0
    for rotation in axis_rotations():
        for unit in UNITS:
            for gravity in (True, False):
                number += 1
                yield Case(kind, Mounted(rotation, unit, gravity, kind == "imu" and number % 2 == 0))


def outcome(case: Case, found: MountingVerdict | None) -> str:
    """What became of a case: 'named', 'in part', 'unseen', 'silent' or 'still'."""
    if found is None:
        return "still"
    rotation = case.mounted.rotation
    turned = not np.array_equal(rotation, np.eye(3))
    want = case.faults(found.fit.turn is not None)
    said = "; ".join(found.wrong)
    hidden = any("turn" in one for one in found.unseen if "hardly" not in one)
    missing = {one for one in want if one not in said}
    remedy = math.isclose(
        float(np.sum(axes_of(found) * rotation.T)), 3.0, abs_tol=0.02
    ) and "set sensor_rotation" in said
    if (not turned or remedy) and not missing:
        return "named" if turned or want or not said else "false"
    if hidden and not missing:
        return "unseen"
    if not turned and not want:
        return "false" if said else "named"
    return "in part" if said else "unseen" if hidden else "silent"


def axes_of(found: MountingVerdict) -> Array:
    """The rotation (3, 3) container ← sensor that is to be written."""
    roll, pitch, yaw = found.sensor_rotation
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return np.array([
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ])  # fmt: skip


def counted(seeds: Sequence[int], kind: str) -> Iterator[tuple[str, str]]:
    """Cell of the table and outcome, of every case of every seed, before and behind."""
    for seed in seeds:
        honest = honest_input(seed)
        moved = poses(honest, seed)
        for case in cases(kind):
            identity = np.array_equal(case.mounted.rotation, np.eye(3))
            what = "right" if identity and case.right else "wrong"
            pair = verdicts(honest, moved, case.mounted, kind)
            for when, found in zip(("first", "all"), pair, strict=True):
                yield f"{what} {when}", outcome(case, found)
        for rotation in axis_rotations():
            mounted = Mounted(rotation, gravity=kind == "imu")
            case = Case(kind, mounted)
            pair = verdicts(honest, moved, mounted, kind, rotation.T)
            for when, found in zip(("first", "all"), pair, strict=True):
                good = found is None or not found.wrong
                yield f"right {when}", "named" if good else f"false: {found.wrong} {seed}"
