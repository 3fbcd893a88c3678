"""Measures planned motions against other ways to move, and fills docs/results/plan_peers.md.

    tools/run python -m pip install --no-deps -r requirements/robots.txt
    tools/run python validation/studies/plan_peers.py ROWS.jsonl [--paths 20] [--docs]

DL22's spatial motions, a straight line of 0.4 m and random smooth paths, for a cup that moves
freely and for one that a UR5 or a Panda carries upright along the same path. Each way is slowed
until the simulation keeps every limit; toppra, which knows no jerk, need not keep that limit. What
comes out is judged by other means: the positions are differenced, a robot's by Pinocchio's
kinematics, and independently written equations are integrated on that. Rows that ROWS.jsonl holds
are not measured again.
"""

from __future__ import annotations

import argparse
import importlib
import json
import math
import statistics
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import with_tools  # noqa: F401
from joint_plan_tables import (
    ACCELERATION,
    JERK,
    MACHINES,
    Kinematics,
    description,
    joint_constraints,
)
from numpy.typing import NDArray
from plan_tables import by_parameter, cases, shaped
from result_tables import fill

from slosh_bringup.cell.motions import MOTIONS
from slosh_model import Cylinder, Model
from slosh_plan.joints import Arm
from slosh_plan.planning.checked import Checker
from slosh_plan.planning.joint_limits import limits_of
from slosh_plan.planning.joint_path import JointLeg, joint_path
from slosh_plan.planning.known_laws import LONGEST, Make, fastest, known_laws
from slosh_plan.planning.limits import LARGEST, PlanLimits
from slosh_plan.planning.path import Leg, path_through
from slosh_plan.planning.path import Path as Route
from slosh_plan.planning.plan import plan
from slosh_plan.planning.time_law import STEP, Law, PlannedMotion, motion_along
from slosh_plan.planning.unit_laws import UNIT_LAWS
from slosh_testing.planned_equations import planned_heights

Array = NDArray[np.float64]
PAGE = Path(__file__).resolve().parents[2] / "docs" / "results" / "plan_peers.md"
CUP = Model(Cylinder(0.05, 0.07)).spatial().nonlinear()
LIMITS = PlanLimits(0.015, 0.002)
FREE, CARRIERS = "free", ("free", "UR5", "Panda")
TIME_LIMIT = 60.0
"""Of a plan [s]; the default of `slosh plan` is half of it. Run the study on a quiet machine."""
TOLERANCE = 1e-3
"""Share of a limit by which two integrators may differ."""
POINTS = 60
"""Of a path at which the robot's joints are computed."""
JUMP = 0.3
"""Largest change of a joint between two of these [rad]."""
TRIALS = 3000
"""Places of a path that are tried until the robot reaches all of it."""
DIRECTIONS = 60
"""Along which toppra limits the acceleration of a cup that moves freely."""
PLANNED = "planned"
WAYS = ("uniform slowing", "toppra, slowed", "ZV shaping", "best known law", PLANNED)


@dataclass(frozen=True, slots=True)
class Row:
    """Results of one path, moved by one carrier: the free cup or a robot.

    Attributes:
        carrier: one of CARRIERS.
        name: of the path.
        times: shortest safe times by way [s]; null: there is none.
        excess: largest share by which a limit is exceeded, by way, by other means.
        method: of the plan.
        fastest: time by toppra without regard to the liquid [s].
        height: that the liquid then reaches [m].
    """

    carrier: str
    name: str
    times: dict[str, float]
    excess: dict[str, float]
    method: str
    fastest: float
    height: float

    @property
    def case(self) -> tuple[str, str]:
        """Carrier and path, which identify the case."""
        return self.carrier, self.name


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """A path of a carrier, with the limits that its motions must keep.

    Attributes:
        name: of the path.
        model: of the liquid.
        route: the path.
        smooth: the path whose joints have no limit of the jerk, for toppra.
        arm: the robot; None: the cup moves freely.
    """

    name: str
    model: Model
    route: Route
    smooth: Route
    arm: Arm | None = None

    def excess(self, motion: PlannedMotion, limits: PlanLimits) -> float:
        """Returns a motion's largest relative excess over a limit, from its positions alone."""
        place, turned, shares = motion.position, None, []
        if self.arm is not None:
            joints = motion.joints
            assert joints is not None
            place, turned = self.arm.poses(joints.limits.names, joints.position)
            kept = (joints.limits.velocity, joints.limits.acceleration, joints.limits.jerk)
            for order, most in enumerate(kept, start=1):
                share = float((np.abs(differences(joints.position, order)) / most).max())
                shares.append(share)
        acceleration = differences(place, 2)[1:-1]
        felt = replace(motion, acceleration=acceleration, tilt=None, joints=None)
        independent: Callable[..., Array] = planned_heights
        heights = independent(self.model.container, felt, turned)
        return max(
            *shares,
            float(np.linalg.norm(acceleration, axis=1).max()) / limits.acceleration,
            float(np.linalg.norm(differences(place, 3), axis=1).max()) / limits.jerk,
            float(heights.max()) / limits.height,
            float(heights[len(place) - 1 :].max()) / limits.residual,
        ) - 1.0  # fmt: skip


def differences(place: Array, order: int) -> Array:
    """Returns a time derivative of sampled positions, for a motion between two rests."""
    still = np.repeat(place[[0, -1]], 2, axis=0)
    padded = np.concatenate([still[:2], place, still[2:]])
    return np.diff(padded, order, axis=0) / STEP**order


def free_task(name: str, points: Array) -> Task:
    """Creates the task of a cup that moves freely along a path."""
    route = path_through(points)
    return Task(name, CUP, route, route)


class Robot:
    """A robot that carries the cup upright.

    Args:
        name: one of MACHINES.
    """

    def __init__(self, name: str) -> None:
        machine = MACHINES[name]
        text = description(machine)
        self.arm = Arm(text, "cup", name)
        self._hand = Kinematics(text, machine.joints)
        own = {joint: {"acceleration": ACCELERATION, "jerk": JERK} for joint in machine.joints}
        self._limits = limits_of(self.arm, machine.joints, own)

    def task(self, name: str, points: Array) -> Task:
        """Creates the task of a path of the cup, placed within the robot's reach."""
        joints = self._joints(path_through(points))
        smooth = replace(self._limits, jerk=np.full(len(self._limits.names), LARGEST))
        route, other = (joint_path(self.arm, one, joints) for one in (self._limits, smooth))
        return Task(name, CUP.with_gravity_tilt(), route, other, self.arm)

    def _joints(self, route: Route) -> Array:
        """Returns joint positions (N, J) along a path, at the first reachable trial position."""
        parts = [leg.at(np.linspace(0.0, leg.length, POINTS), 0)[0] for leg in route.legs]
        way = np.concatenate([parts[0], *(part[1:] for part in parts[1:])])
        middle = 0.5 * (way.min(axis=0) + way.max(axis=0))
        lower, upper = self._hand.lower, self._hand.upper
        reach = np.minimum(upper - lower, 4.0)
        rng = np.random.default_rng(39)
        for _ in range(TRIALS):
            place = rng.uniform([-0.6, -0.6, 0.1], [0.6, 0.6, 0.7]) - middle
            q = 0.5 * (lower + upper) + 0.35 * reach * rng.uniform(-1, 1, len(lower))
            yaw = rng.uniform(-3.0, 3.0)
            found = self._hand.along(q, ((place + point, yaw, 0.0) for point in way), JUMP)
            if found is not None:
                return found
        raise RuntimeError(f"the path is reached from none of {TRIALS} places")


@dataclass(frozen=True, slots=True, eq=False)
class FoundLaw:
    """Time law of toppra along a leg, with constant second derivative between grid points.

    Attributes:
        grid, rate: path length [m or rad] and its rate of change, at the grid points.
    """

    grid: Array
    rate: Array

    def times(self) -> Array:
        """Times of the grid points [s]."""
        return np.concatenate(
            [[0.0], np.cumsum(2.0 * np.diff(self.grid) / (self.rate[1:] + self.rate[:-1]))]
        )

    def slowed(self, factor: float) -> Law:
        """Returns the time law, uniformly slowed."""
        moments = self.times()
        change = np.diff(self.rate) / np.diff(moments)

        def law(t: Array) -> tuple[Array, Array, Array]:
            since = np.clip(t / factor, 0.0, moments[-1])
            row = np.clip(np.searchsorted(moments, since, side="right") - 1, 0, len(change) - 1)
            rest, a = since - moments[row], change[row]
            v = self.rate[row] + a * rest
            s = self.grid[row] + rest * (self.rate[row] + 0.5 * a * rest)
            return s, v / factor, a / factor**2

        return law


def found_law(leg: Leg, arm: Arm | None, limits: PlanLimits) -> FoundLaw:
    """Computes the fastest time law along a leg by toppra, ignoring the liquid."""
    ta: Any = importlib.import_module("toppra")
    ta.setup_logging("ERROR")
    grid = np.linspace(0.0, leg.length, 400)
    if isinstance(leg, JointLeg):
        assert arm is not None
        assert leg.demands is not None
        curve = ta.SplineInterpolator(grid, leg.joint_derivative(grid, 0))
        constraints = joint_constraints(arm, leg.demands.limits)
    else:
        # toppra knows limits of each joint alone: the acceleration along many directions is one.
        around = sphere(DIRECTIONS)
        curve = ta.SplineInterpolator(grid, leg.at(grid, 0)[0] @ around.T)
        most = np.full(DIRECTIONS, limits.acceleration)
        constraints = [ta.constraint.JointAccelerationConstraint(np.column_stack([-most, most]))]
    method = ta.algorithm.TOPPRA(constraints, curve, gridpoints=grid)
    _, rate, _ = method.compute_parameterization(0.0, 0.0)
    return FoundLaw(grid, np.asarray(rate))


def sphere(count: int) -> Array:
    """Returns evenly spread unit vectors (count, 3) over half a sphere."""
    n = np.arange(count) + 0.5
    z, turn = n / count, math.pi * (1.0 + math.sqrt(5.0)) * n
    flat = np.sqrt(1.0 - z**2)
    return np.column_stack([flat * np.cos(turn), flat * np.sin(turn), z])


def ways(task: Task) -> tuple[dict[str, Make], list[FoundLaw]]:
    """Returns functions from duration to motion for each method, and toppra's time laws."""
    route, period = task.route, 2.0 * math.pi / task.model.mode_constants()[0].natural_frequency
    found = [found_law(leg, task.arm, LIMITS) for leg in task.smooth.legs]
    whole = sum(float(one.times()[-1]) for one in found)

    def slowed(duration: float, step: float) -> PlannedMotion:
        factor = duration / whole
        durations = [factor * float(one.times()[-1]) for one in found]
        return motion_along(task.smooth, [one.slowed(factor) for one in found], durations, step)

    def uniform(duration: float, step: float) -> PlannedMotion:
        if task.arm is None and task.name in MOTIONS:
            return by_parameter(task.name, UNIT_LAWS["modified trapezoidal"], duration, step)
        return known_laws(route)["modified trapezoidal"].motion(duration, step)

    def filtered(duration: float, step: float) -> PlannedMotion:
        return shaped(route, period, UNIT_LAWS["quintic"], duration, step)

    return dict(zip(WAYS, (uniform, slowed, filtered), strict=False)), found


def measure(carrier: str, task: Task) -> Row:
    """Plans one case with all methods and returns its results."""
    made, laws = ways(task)
    check, times, excess = Checker(task.model), dict[str, float](), dict[str, float]()
    toppra = replace(LIMITS, jerk=LARGEST)
    for way, make in made.items():
        limits = toppra if way.startswith("toppra") else LIMITS
        found = fastest(check, make, limits, LONGEST)
        if found is not None:
            times[way] = found.motion.duration
            # Where the acceleration jumps, its differences at rows are halves.
            excess[way] = task.excess(found.motion, limits)
    answer = plan(task.model, task.route, LIMITS, time_limit=TIME_LIMIT)
    for way, motion in zip(WAYS[-2:], (answer.scaled.found.motion, answer.found.motion),
                           strict=True):  # fmt: skip
        times[way], excess[way] = motion.duration, task.excess(motion, LIMITS)
    whole = sum(float(one.times()[-1]) for one in laws)
    alone = made[WAYS[1]](STEP * math.ceil(whole / STEP), STEP)
    height = check([alone])[0].peak
    return Row(carrier, task.name, times, excess, answer.method, whole, height)


def table(rows: Sequence[Row]) -> str:
    """Formats the results as a table, with medians of the random paths."""
    heads = ("carrier", "path", "toppra without the liquid [s]", "its height [mm]",
             *(f"{way} [s]" for way in WAYS), "planned above a limit")  # fmt: skip
    lines = [f"| {' | '.join(heads)} |", f"|---|---|{'--:|' * (len(heads) - 2)}"]
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in sorted(rows, key=lambda row: CARRIERS.index(row.carrier)):
        kind = "random" if row.name.startswith("random") else row.name
        groups.setdefault((row.carrier, kind), []).append(row)
    for (carrier, kind), own in groups.items():
        heights = [1e3 * row.height for row in own]
        cells = [f"{statistics.median(row.fastest for row in own):.2f}", spread(heights)]
        for way in WAYS:
            times = [row.times.get(way, math.inf) for row in own]
            cells.append(f"{statistics.median(times):.2f}")
        cells.append(f"{sum(row.excess[PLANNED] > TOLERANCE for row in own)} of {len(own)}")
        name = f"{len(own)} random" if kind == "random" else kind
        lines.append(f"| {carrier} | {name} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n\n" + closing(rows)


def spread(values: Sequence[float]) -> str:
    """Formats the smallest and the largest of some values."""
    low, high = min(values), max(values)
    return f"{low:.0f}" if len(values) == 1 else f"{low:.0f} to {high:.0f}"


def closing(rows: Sequence[Row]) -> str:
    """Formats the median ratios of times and the largest excess in two sentences."""
    over = sum(row.excess[PLANNED] > TOLERANCE for row in rows)
    worst = max(row.excess[PLANNED] for row in rows)
    shares = ", ".join(f"{ratio(rows, way):.2f} ({way})" for way in WAYS[:-1])
    return (
        f"{over} of {len(rows)} plans exceed a limit (at most {100.0 * max(worst, 0.0):.2f} %). "
        f"Median of their times by others: {shares}."
    )


def ratio(rows: Sequence[Row], way: str) -> float:
    """Returns the median ratio of the planned time to that of another method."""
    return statistics.median(row.times[PLANNED] / row.times.get(way, math.inf) for row in rows)


def main() -> int:
    """Plans missing cases and prints the table; returns 1 if a plan exceeds a limit."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rows", type=Path, help="measured rows, JSON lines; grows")
    parser.add_argument("--paths", type=int, default=20, help="random paths (default: 20)")
    parser.add_argument("--docs", action="store_true", help=f"write the table into {PAGE.name}")
    given = parser.parse_args()
    lines = given.rows.read_text(encoding="utf-8").splitlines() if given.rows.exists() else []
    rows = {row.case: row for row in (Row(**json.loads(line)) for line in lines)}
    makers = {FREE: free_task} | {name: Robot(name).task for name in CARRIERS[1:]}
    for name, points in cases(given.paths).items():
        for carrier, make in makers.items():
            if (carrier, name) in rows:
                continue
            row = measure(carrier, make(name, points))
            rows[row.case] = row
            with given.rows.open("a", encoding="utf-8") as file:
                file.write(json.dumps(asdict(row)) + "\n")
            print(row, file=sys.stderr, flush=True)
    text = table(list(rows.values()))
    print(text)
    if given.docs:
        fill(PAGE, "peers", text)
    return int(any(row.excess[PLANNED] > TOLERANCE for row in rows.values()))


if __name__ == "__main__":
    sys.exit(main())
