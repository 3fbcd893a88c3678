"""Compares plans of joint paths with toppra and uniform slowing; fills docs/plan.md.

    tools/run python -m pip install --no-deps -r requirements/robots.txt
    tools/run python validation/studies/joint_plan_tables.py ROWS.jsonl [--cases 70] [--docs]
        [--antisloshing FOLDER]

Random paths on which a UR5, a Panda or a Comau Smart Six (whose description comes with the public
AntiSloshing data) keeps a cup upright, or leans it by up to 15° on the way,
in joints. Each plan is verified by other means: the joints' positions are differenced, the
kinematics are Pinocchio's on the rows themselves, and the liquid is integrated on that. toppra
gives the time that the joints' velocity, acceleration and torque limits alone allow: a bound from
below. Rows that ROWS.jsonl holds are not measured again.
"""

from __future__ import annotations

import argparse
import importlib
import json
import statistics
import sys
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import with_tools  # noqa: F401
from numpy.typing import NDArray
from result_tables import fill

from slosh_model import Cylinder, Inputs, Model, simulate
from slosh_plan import SloshPlanError
from slosh_plan.joints import Arm
from slosh_plan.planning.joint_limits import JointLimits, limits_of
from slosh_plan.planning.joint_path import JointLeg, joint_path
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.planning.path import Leg
from slosh_plan.planning.plan import Plan, plan

Array = NDArray[np.float64]
PAGE = Path(__file__).resolve().parents[2] / "docs" / "plan.md"
MODEL = Model(Cylinder(0.05, 0.07)).spatial().nonlinear().with_gravity_tilt()
HEIGHTS = (0.01, 0.02)
RESIDUAL = 0.5
ACCELERATION, JERK = 8.0, 200.0
"""Of each joint [rad/s², rad/s³]: descriptions have none."""
Pose = tuple[Array, float, float]
"""Place [m], yaw and lean [rad] of a cup."""
POINTS, LEAN = 12, np.deg2rad(15.0)
JUMP = 0.4
"""Largest change of a joint from one of these points to the next [rad]."""
TOLERANCE = 2e-3
"""By which a differenced row may exceed a limit: the rows are 1 ms apart."""


@dataclass(frozen=True, slots=True)
class Machine:
    """A robot: its URDF file, and the pose of the cup on it."""

    urdf: str
    link: str
    place: str
    turn: str
    joints: tuple[str, ...]


COMAU = "Comau"
MACHINES = {
    "UR5": Machine(
        "ur_description/urdf/ur5_robot.urdf", "ee_link", "0.1 0 0", "0 0 0",
        ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint",
         "wrist_2_joint", "wrist_3_joint"),
    ),
    "Panda": Machine(
        "panda_description/urdf/panda.urdf", "panda_hand", "0 0 0.1", "0 1.5707963 0",
        tuple(f"panda_joint{n}" for n in range(1, 8)),
    ),
    COMAU: Machine(
        "comau_smartsix5.urdf", "axes_6", "0.1 0 0", "0 1.5707963 0",
        tuple(f"q{n}_joint" for n in range(1, 7)),
    ),
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Row:
    """Results of one joint path: durations [s], largest excess over a limit.

    `excess` is the largest share by which any limit is exceeded, by other means than the plan's.
    """

    machine: str
    seed: int
    height: float
    leans: bool
    optimal: float
    method: str
    scaled: float
    toppra: float
    excess: float
    seconds: float
    refusal: str

    @property
    def case(self) -> tuple[str, int]:
        """Robot and seed, which identify the case."""
        return self.machine, self.seed


def description(machine: Machine, folder: Path | None = None) -> str:
    """Returns the robot's URDF with an added link `cup`.

    Args:
        machine: the robot.
        folder: that holds the file; None: it is one of example-robot-data.
    """
    if folder is None:
        files = metadata.files("example-robot-data") or []
        (file,) = (one for one in files if str(one).endswith(f"robots/{machine.urdf}"))
        text = file.read_text(encoding="utf-8")
    else:
        own = (folder / machine.urdf).read_text(encoding="utf-8")
        text = f"<robot name='own'>{own.partition('?>')[2] or own}</robot>"  # it has no root
    cup = (
        f'<link name="cup"/><joint name="cup_joint" type="fixed"><parent link="{machine.link}"/>'
        f'<child link="cup"/><origin xyz="{machine.place}" rpy="{machine.turn}"/></joint>'
    )
    return text.replace("</robot>", cup + "</robot>")


class Kinematics:
    """Inverse kinematics of a cup on a robot, by damped least squares."""

    def __init__(self, urdf: str, joints: Sequence[str]) -> None:
        self._pin: Any = importlib.import_module("pinocchio")
        self._model = self._pin.buildModelFromXML(urdf)
        self._data = self._model.createData()
        self._frame = self._model.getFrameId("cup")
        places = [self._model.joints[self._model.getJointId(name)] for name in joints]
        self._q, self._v = [one.idx_q for one in places], [one.idx_v for one in places]
        self.lower = self._model.lowerPositionLimit[self._q]
        self.upper = self._model.upperPositionLimit[self._q]

    def at(self, joints: Array, place: Array, yaw: float, lean: float) -> Array | None:
        """Returns joint positions (J,) for a cup pose; None if none are found."""
        pin = self._pin
        turn = pin.utils.rotate("z", yaw) @ pin.utils.rotate("x", lean)
        target, q = pin.SE3(turn, place), pin.neutral(self._model)
        q[self._q] = joints
        for _ in range(300):
            pin.forwardKinematics(self._model, self._data, q)
            pose = pin.updateFramePlacement(self._model, self._data, self._frame)
            error = pin.log(pose.inverse() * target).vector
            if np.linalg.norm(error) < 1e-10:
                found: Array = q[self._q]
                inside = (found >= self.lower).all() and (found <= self.upper).all()
                return found.copy() if inside else None
            slopes = pin.computeFrameJacobian(self._model, self._data, q, self._frame, pin.LOCAL)[
                :, self._v
            ]
            step = np.zeros(self._model.nv)
            damped = slopes @ slopes.T + 1e-8 * np.eye(6)
            step[self._v] = slopes.T @ np.linalg.solve(damped, error)
            step *= min(1.0, 0.3 / max(float(np.linalg.norm(step)), 1e-12))
            q = pin.integrate(self._model, q, step)
        return None

    def along(self, start: Array, poses: Iterable[Pose], jump: float) -> Array | None:
        """Returns joint positions (N, J) for cup poses one after another.

        Args:
            start: (J,) from which the first one is sought.
            poses: place, yaw and lean of the cup.
            jump: largest change of a joint from one to the next [rad or m].

        Returns:
            the positions, or None if a pose is not reached or a joint jumps.
        """
        found: list[Array] = []
        for place, yaw, lean in poses:
            q = self.at(found[-1] if found else start, place, yaw, lean)
            if q is None or (found and np.abs(q - found[-1]).max() > jump):
                return None
            found.append(q)
        return np.array(found)


def random_path(hand: Kinematics, seed: int) -> tuple[Array, bool]:
    """Returns joint positions (POINTS, J) along a random cup curve, and whether it tilts."""
    rng = np.random.default_rng(seed)
    leans = bool(seed % 2)
    share = np.linspace(0.0, 1.0, POINTS)
    middle, reach = 0.5 * (hand.lower + hand.upper), np.minimum(hand.upper - hand.lower, 4.0)
    while True:
        start = rng.uniform([-0.6, -0.6, 0.15], [0.6, 0.6, 0.7])
        change, bump = rng.uniform(-0.4, 0.4, 3) * [1, 1, 0.5], rng.uniform(-0.1, 0.1, 3)
        yaw, turn = rng.uniform(-3.0, 3.0), rng.uniform(-0.8, 0.8)
        lean = rng.uniform(-LEAN, LEAN) if leans else 0.0
        poses = (
            (start + s * change + 4.0 * s * (1.0 - s) * bump, yaw + s * turn,
             lean * np.sin(np.pi * s) ** 2)
            for s in share
        )  # fmt: skip
        q = middle + 0.35 * reach * rng.uniform(-1.0, 1.0, len(middle))
        found = hand.along(q, poses, JUMP)
        if found is not None:
            return found, leans


def joint_constraints(arm: Arm, limits: JointLimits) -> list[Any]:
    """Returns the joints' limits except the jerk's as constraints of toppra."""
    ta: Any = importlib.import_module("toppra")

    def torque(q: Array, rate: Array, change: Array) -> Array:
        still = np.zeros_like(q)[None]
        along = arm.torque_terms(limits.names, q[None], change[None], still)[0]
        across = arm.torque_terms(limits.names, q[None], rate[None], still)[0]
        found: Array = along[0] + across[1] + along[2]
        return found

    def both(most: Array) -> Array:
        return np.column_stack([-most, most])

    return [
        ta.constraint.JointVelocityConstraint(both(limits.velocity)),
        ta.constraint.JointAccelerationConstraint(both(limits.acceleration)),
        ta.constraint.JointTorqueConstraint(
            torque, both(limits.torque), np.zeros(len(limits.names))
        ),
    ]


def leg_time(arm: Arm, limits: JointLimits, leg: Leg) -> float:
    """Returns toppra's shortest time [s] along a leg, for all joint limits except the jerk's."""
    ta: Any = importlib.import_module("toppra")
    ta.setup_logging("ERROR")
    assert isinstance(leg, JointLeg)
    grid = np.linspace(0.0, leg.length, 400)
    curve = ta.SplineInterpolator(grid, leg.joint_derivative(grid, 0))
    constraints = joint_constraints(arm, limits)
    found = ta.algorithm.TOPPRA(constraints, curve, gridpoints=grid).compute_trajectory(0.0, 0.0)
    return float("nan") if found is None else float(found.duration)


def excess(arm: Arm, answer: Plan, limits: PlanLimits) -> float:
    """Returns the largest relative excess over a joint limit, from positions only."""
    joints, step = answer.found.motion.joints, answer.found.motion.step
    assert joints is not None
    used = [
        np.abs(np.diff(joints.position, order, axis=0) / step**order) / most
        for order, most in enumerate(
            (joints.limits.velocity, joints.limits.acceleration, joints.limits.jerk), start=1
        )
    ]
    place, turned = arm.poses(joints.limits.names, joints.position)
    acceleration = np.zeros_like(place)
    acceleration[1:-1] = np.diff(place, 2, axis=0) / step**2
    rest = 2000
    t = step * np.arange(len(place) + rest, dtype=np.float64)
    inputs = Inputs(
        t, np.concatenate([acceleration, np.zeros((rest, 3))]),
        np.concatenate([turned, np.tile(turned[-1], (rest, 1))]),
    )  # fmt: skip
    heights = simulate(MODEL, inputs)[0].msh
    shares = [float(one.max()) for one in used]
    shares.append(float(heights.max()) / limits.height)
    shares.append(float(heights[len(place) :].max()) / limits.residual)
    outside = np.maximum(joints.limits.lower - joints.position,
                         joints.position - joints.limits.upper).max()  # fmt: skip
    return max(max(shares) - 1.0, float(outside))


def measure(name: str, seed: int, folder: Path | None = None) -> Row:
    """Plans one joint path and returns the results."""
    machine = MACHINES[name]
    text = description(machine, folder if name == COMAU else None)
    arm = Arm(text, "cup", name)
    own = {joint: {"acceleration": ACCELERATION, "jerk": JERK} for joint in machine.joints}
    joint_limits = limits_of(arm, machine.joints, own)
    points, leans = random_path(Kinematics(text, machine.joints), seed)
    height = HEIGHTS[seed // 2 % len(HEIGHTS)]
    limits = PlanLimits(height, RESIDUAL * height)
    missing = float("nan")
    try:
        path = joint_path(arm, joint_limits, points)
        bound = sum(leg_time(arm, joint_limits, leg) for leg in path.legs)
        answer = plan(MODEL, path, limits)
    except SloshPlanError as error:
        return Row(
            name, seed, height, leans, missing, "", missing, missing, missing, missing, str(error)
        )
    return Row(
        name, seed, height, leans, answer.found.motion.duration, answer.method,
        answer.scaled.found.motion.duration, bound, excess(arm, answer, limits), answer.seconds,
        "",
    )  # fmt: skip


def table(rows: Sequence[Row]) -> str:
    """Formats the results as a table and a sentence."""
    lines = [
        "| robot | paths | planned | optimal | time / slowed law | time / toppra | "
        "largest excess | planning, median [s] | longest [s] |",
        "|---|" + "--:|" * 8,
    ]
    for name in MACHINES:
        own = [row for row in rows if row.machine == name]
        done = [row for row in own if not row.refusal]
        if not done:
            continue
        slowed = statistics.median(row.optimal / row.scaled for row in done)
        bound = statistics.median(row.optimal / row.toppra for row in done)
        worst = max(row.excess for row in done)
        seconds = [row.seconds for row in done]
        lines.append(
            f"| {name} | {len(own)} | {len(done)} | {sum(row.method == 'optimal' for row in done)}"
            f" | {slowed:.2f} | {bound:.2f} | {max(100.0 * worst, 0.0):.2f} % | "
            f"{statistics.median(seconds):.1f} | {max(seconds):.1f} |"
        )
    over = sum(row.excess > TOLERANCE for row in rows)
    lines += ["", f"{over} of {len(rows)} motions exceed a limit by more than {TOLERANCE:.1%}."]
    return "\n".join(lines)


def main() -> int:
    """Plans missing cases and prints the table; returns 1 if a limit is exceeded."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "rows", type=Path, help="file of results as JSON lines, extended by each run"
    )
    parser.add_argument(
        "--cases", type=int, default=100, help="number of cases of each robot (default: 100)"
    )
    parser.add_argument("--first", type=int, default=0, help="first seed (default: 0)")
    parser.add_argument(
        "--antisloshing", type=Path, help=f"folder with {MACHINES[COMAU].urdf}: the Comau, too"
    )
    parser.add_argument("--docs", action="store_true", help=f"write the table into {PAGE.name}")
    given = parser.parse_args()
    lines = given.rows.read_text(encoding="utf-8").splitlines() if given.rows.exists() else []
    rows = {row.case: row for row in (Row(**json.loads(line)) for line in lines)}
    for seed in range(given.first, given.first + given.cases):
        for name in MACHINES:
            if (name, seed) in rows or (name == COMAU and given.antisloshing is None):
                continue
            row = measure(name, seed, given.antisloshing)
            rows[row.case] = row
            with given.rows.open("a", encoding="utf-8") as file:
                file.write(json.dumps(asdict(row)) + "\n")
            print(row, file=sys.stderr)
    text = table(list(rows.values()))
    print(text)
    if given.docs:
        fill(PAGE, "joints", text)
    return int(any(row.excess > TOLERANCE for row in rows.values()))


if __name__ == "__main__":
    sys.exit(main())
