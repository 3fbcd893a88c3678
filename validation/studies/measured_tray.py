"""Compares predicted height intervals with measured peaks of four cups on one tray.

A robot carries the tray along an arc and turns it by half a turn in 1.84 s (AntiSloshing, folder
`tray` of SLOSH_SHARED_DATA or ../shared/data, with the arm's URDF in `antisloshing`). The joints
give the tray's motion; the cups stand 115 mm from its centre on its diagonals. Which cup stands on
which diagonal is not stated: the order, of the eight possible ones, is that whose heights agree
best with those that the makers predicted; the measured heights do not enter. Nothing is tuned. The
interval is that of 3D-NL's MAE over twelve other measured runs. With --plan the fastest motion
along the same joints is planned for the four cups, with the greatest acceleration and jerk of the
makers' motion as limits of each joint.

    tools/run python validation/studies/measured_tray.py [--plan]
"""

from __future__ import annotations

import itertools
import math
import os
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat
from scipy.spatial.transform import Rotation

from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.simulate import Inputs, simulate
from slosh_model.tray import Tray, TrayContainer
from slosh_plan import ModelError, Trajectory
from slosh_plan.joints import Arm
from slosh_plan.planning.joint_limits import limits_of
from slosh_plan.planning.joint_path import joint_path
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.planning.plan import plan
from slosh_plan.planning.plan_tray import TrayPlan, plan_tray
from slosh_plan.robot_file import read_arm
from slosh_plan.tray import predict_tray
from slosh_report.text_table import aligned

Array = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[2]
DATA = Path(os.environ.get("SLOSH_SHARED_DATA", ROOT.parent / "shared" / "data"))
MOTION = "TO_arc_0.015eta_lim_4containers_180_deg"
RUN = "1A_15"
JOINTS = tuple(f"q{number}_joint" for number in range(1, 7))
STEP = 0.002  # s
CUP = Cylinder(radius=0.035, fill_height=0.197e-3 / (math.pi * 0.035**2))
FROM_CENTRE = 0.115  # m
LIMIT = 0.015  # m, for which the motion was planned
JERK = 1100.0
"""Of the tray's frame: hardly more than that of the makers' motion, 1,034 m/s³."""
ERROR = ModelError(sigma=2.29e-3)
"""Of 3D-NL over twelve runs with one cup: docs/results/measurements.md."""
CUPS = (1, 2, 3, 4)


class Order(NamedTuple):
    """Arrangement of the cups on the tray: quarter of the first one, sense of rotation."""

    quarter: int
    sense: int


def tray_motion() -> Trajectory:
    """Returns the measured motion of the tray's centre."""
    arm = read_arm(str(DATA / "antisloshing" / "comau_smartsix5.urdf"), "axes_6")
    joints = joint_rows()
    t = np.arange(len(joints), dtype=np.float64) * STEP
    given = arm.motion(t, JOINTS, joints, name=MOTION)
    assert given.attitude is not None
    turn = Rotation.from_quat(given.attitude)
    upright = (turn * turn[0].inv()).as_quat()
    return Trajectory(given.t, given.acceleration, upright, name=MOTION)


def diagonal() -> float:
    """Returns the azimuth of the tray's diagonal at the start [rad]."""
    arm = read_arm(str(DATA / "antisloshing" / "comau_smartsix5.urdf"), "axes_6")
    _, attitude = arm.poses(JOINTS, joint_rows()[:1])
    across = Rotation.from_quat(attitude[0]).as_matrix()[:, 1]
    return math.atan2(across[1], across[0]) + 0.25 * math.pi


def tray_of(order: Order) -> Tray:
    """Returns the tray with its cups in a given arrangement."""
    model = Model(CUP).spatial().nonlinear()
    cups = []
    for index, number in enumerate(CUPS):
        angle = diagonal() + 0.5 * math.pi * (order.quarter + order.sense * index)
        place = (FROM_CENTRE * math.cos(angle), FROM_CENTRE * math.sin(angle), 0.0)
        cups.append(TrayContainer(f"cup {number}", model, place, LIMIT))
    return Tray(tuple(cups))


def heights(tray: Tray, motion: Trajectory) -> Array:
    """Simulates the heights (4, N) of all cups [m]."""
    inputs = Inputs(motion.t, motion.acceleration, motion.attitude)
    return np.array([simulate(one.placed, inputs)[0].msh for one in tray.containers])


def made_order(motion: Trajectory) -> tuple[Order, float]:
    """Returns the arrangement that fits the data's own simulation best, and the rms error [m].

    Their time begins with the motion, half a second and more after that of the joints.
    """
    made = loadmat(DATA / "tray" / f"{MOTION}_etas.mat")
    start = float(motion.t[np.flatnonzero(np.linalg.norm(motion.acceleration, axis=1) > 1e-3)[0]])
    found = {}
    for order in itertools.starmap(Order, itertools.product(range(4), (1, -1))):
        ours = heights(tray_of(order), motion)
        gaps = [
            np.interp(made[f"time_{number}"].ravel() + start, motion.t, ours[index])
            - np.abs(made[f"eta_{number}"].ravel())
            for index, number in enumerate(CUPS)
        ]
        found[order] = float(np.sqrt(np.mean(np.concatenate(gaps) ** 2)))
    best = min(found, key=lambda order: found[order])
    return best, found[best]


def measured(number: int) -> float:
    """Returns the measured peak of a cup above its still level [m]."""
    run = loadmat(DATA / "tray" / f"container_{number}_full_slosh_{RUN}_c{number}.mat")
    return float(1e-3 * np.nanmax(run["world_points"][:, 1] - run["h0_point"].item()))


def planned(tray: Tray) -> TrayPlan:
    """Plans the fastest motion along the same joint path that keeps a limit in each cup."""
    plain, joints = DATA / "antisloshing" / "comau_smartsix5.urdf", joint_rows()
    _, attitude = read_arm(str(plain), "axes_6").poses(JOINTS, joints[:1])
    turn = " ".join(map(str, Rotation.from_quat(attitude[0]).inv().as_euler("xyz")))
    text = plain.read_text(encoding="utf-8").partition("?>")[2]
    frame = (
        '<link name="tray"/><joint name="tray_joint" type="fixed"><parent link="axes_6"/>'
        f'<child link="tray"/><origin xyz="0 0 0" rpy="{turn}"/></joint>'
    )
    arm = Arm(f"<robot name='own'>{text}{frame}</robot>", "tray", plain.name)
    rates = [np.diff(joints, order, axis=0) / STEP**order for order in (1, 2, 3)]
    most = {"acceleration": np.abs(rates[1]).max(), "jerk": np.abs(rates[2]).max()}
    limits = limits_of(
        arm, JOINTS, {joint: {k: float(v) for k, v in most.items()} for joint in JOINTS}
    )
    moving = np.flatnonzero(np.abs(rates[0]).max(axis=1) > 1e-3)
    rows = joints[moving[0] - 1 : moving[-1] + 2]
    path = joint_path(arm, limits, np.vstack([rows[:-1:10], rows[-1:]]))

    def make(one: TrayContainer, kept: PlanLimits) -> TrayPlan:
        return TrayPlan(plan(one.placed, path, kept), one)

    return plan_tray(tray, PlanLimits(LIMIT, LIMIT, jerk=JERK), make)


def joint_rows() -> Array:
    """Reads the joint positions (N, 6) of the motion [rad]."""
    return np.loadtxt(DATA / "tray" / f"{MOTION}.csv", delimiter=";")


def main() -> int:
    """Prints the table; returns 1 if the data are missing."""
    if not (DATA / "tray").is_dir():
        print(f"measured_tray: no data in {DATA / 'tray'}", file=sys.stderr)
        return 1
    motion = tray_motion()
    order, rms = made_order(motion)
    (found,) = predict_tray(tray_of(order), [motion], error=ERROR)
    rows = [["cup", "predicted [mm]", "interval [mm]", "measured [mm]", "inside"]]
    peaks = {f"cup {number}": measured(number) for number in CUPS}
    for name, one in found.containers.items():
        inside = "yes" if one.lower <= peaks[name] <= one.upper else "no"
        interval = f"{1e3 * one.lower:.1f} … {1e3 * one.upper:.1f}"
        peak = f"{1e3 * one.nonlinear.peak:.1f}"
        rows.append([name, peak, interval, f"{1e3 * peaks[name]:.1f}", inside])
    print("\n".join(aligned(rows, "<>>><")))
    print(f"worst: predicted {found.worst}, measured {max(peaks, key=lambda name: peaks[name])}")
    print(f"order {order}: {1e3 * rms:.2f} mm rms from the makers' heights")
    if "--plan" in sys.argv:
        ours = planned(tray_of(order))
        assert ours.found is not None
        peaks = {name: one.nonlinear.peak for name, one in ours.found.containers.items()}
        print(
            f"planned: {ours.plan.found.motion.duration:.3f} s for {ours.one.name}, the makers' "
            "1.84 s"
        )
        print(", ".join(f"{name} {1e3 * peak:.1f} mm" for name, peak in peaks.items()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
