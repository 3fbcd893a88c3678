"""Compares plans with plain and slowed laws, which they must never be slower than.

    tools/run python -m pip install --no-deps -r requirements/robots.txt
    tools/run python validation/studies/plan_candidates.py ROWS.jsonl [--cases 8] [--docs]

Random lines and paths of a cup, trays of two to four cups, paths of a UR5's or a Panda's joints,
and paths of a cup of unknown frequency, with random fills, limits and times of the waypoints. Each
plan is compared with the minimum-jerk law, seven S-curves from a nearly trapezoidal speed to no
coasting, and with the laws that the plan had and slowed, each at its shortest safe duration in
steps of 0.6 %. Which duration is safe is judged here alone: liquids by `independent_liquid`,
joints by differences of their places. A faster law counts where it uses at most 99.8 % of each
limit at 1 kHz. Settings were chosen on even seeds; the table has the odd ones. Rows that
ROWS.jsonl holds are not measured again.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import with_tools  # noqa: F401
from independent_liquid import GRAVITY, Liquids, Vessel
from joint_plan_tables import ACCELERATION, JERK, MACHINES, Kinematics, description, random_path
from numpy.typing import NDArray
from plan_tables import random_points
from result_tables import fill
from scipy.spatial.transform import Rotation

from slosh_model import Cylinder, Model, Rectangle
from slosh_model.covariance import covariance_of
from slosh_model.parameters import parameter_value
from slosh_model.tray import Tray, TrayContainer
from slosh_plan import SloshPlanError
from slosh_plan.joints import Arm
from slosh_plan.planning.joint_limits import limits_of as joint_limits_of
from slosh_plan.planning.joint_path import joint_path
from slosh_plan.planning.known_laws import leg_durations
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.planning.path import Path as Route
from slosh_plan.planning.path import path_through
from slosh_plan.planning.plan_tray import plan_container
from slosh_plan.planning.time_law import (
    STEP,
    JerkLaw,
    Law,
    PlannedMotion,
    TimeLaw,
    motion_along,
)
from slosh_plan.tray import limits_of

Array = NDArray[np.float64]
PAGE = Path(__file__).resolve().parents[2] / "docs" / "plan.md"
KINDS = ("line", "tray", "path", "UR5", "Panda", "robust")
CURVES = ((1, 19, 0), (1, 9, 18), (1, 3, 30), (2, 8, 16), (4, 6, 12), (5, 10, 0), (10, 0, 0))
"""Fortieths of the duration: of each change of the acceleration, of its holds, of coasting."""
RATIO = 1.006
"""Of two durations that are tried in turn."""
TOGETHER = 128
COARSE = 4e-3
"""Rows of motions whose liquids are tried first; durations are multiples of it [s]."""
LEFT, DOUBT = 0.998, 0.005
"""Part of a limit that a faster law uses at most; what coarse rows may be wrong by."""
AFTER = 2.0
"""Time after the end in which the liquid is looked at [s]."""
FREQUENCY_ERROR = 0.01
"""Relative standard error of the frequency where a plan is robust."""
LIKELY = 1.96
"""Half width of the region of a robust plan, in standard errors of the frequency."""


@dataclass(frozen=True, slots=True)
class Row:
    """Results of one case.

    Attributes:
        kind, seed: the case.
        planned: duration of the plan [s].
        method: of the plan.
        best: of the fastest law [s]; the plan's where none is faster.
        law: its name; empty: none is faster.
        laws: number of laws.
        seconds: that planning took.
    """

    kind: str
    seed: int
    planned: float
    method: str
    best: float
    law: str
    laws: int
    seconds: float

    @property
    def ratio(self) -> float:
        """Duration of the plan by that of the fastest law."""
        return self.planned / self.best


def minimum_jerk(t: Array, duration: float, length: float) -> tuple[Array, Array, Array]:
    """Returns place, speed and acceleration of 10u³ − 15u⁴ + 6u⁵ along a leg."""
    u = np.clip(t / duration, 0.0, 1.0)
    place = u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
    rate, change = 30.0 * (u * (1.0 - u)) ** 2, 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u)
    return length * place, length * rate / duration, length * change / duration**2


@dataclass(frozen=True, slots=True)
class PlainLaw:
    """A law of the place along each leg, for any duration.

    Attributes:
        path: the path.
        parts: of an S-curve, as in `CURVES`; empty: the minimum-jerk law.
    """

    path: Route
    parts: tuple[int, ...] = ()

    def motion(self, duration: float, step: float = STEP) -> PlannedMotion:
        """Creates the motion with a total duration and a sample interval [s]."""
        durations = leg_durations(self.path, duration)
        each = zip(self.path.legs, durations, strict=True)
        laws = [self._law(leg.length, time) for leg, time in each]
        return motion_along(self.path, laws, durations, step)

    def _law(self, length: float, duration: float) -> Law:
        if not self.parts:
            return lambda t: minimum_jerk(t, duration, length)
        ramp, hold, coast = self.parts
        push = [1.0] * ramp + [0.0] * hold + [-1.0] * ramp
        jerk = np.array([*push, *([0.0] * coast), *(-one for one in push)])
        reached = float(JerkLaw(duration, jerk).nodes()[-1, 0])
        return JerkLaw(duration, jerk * length / reached)


class Held(NamedTuple):
    """A container, its limits [m] and its possible liquids, as the judge needs them.

    Attributes:
        vessel: the container.
        damping: ratio of the liquid [1].
        factors: (N, 2) of frequency and damping of each possible liquid.
        height, residual: limits [m].
    """

    vessel: Vessel
    damping: float
    factors: Array
    height: float
    residual: float

    @classmethod
    def of(cls, one: TrayContainer, limits: PlanLimits) -> Held:
        """Returns a container of a tray."""
        shape, kept = one.model.container, limits_of(one, limits).under_rim(one.placed)
        if isinstance(shape, Cylinder):
            vessel = Vessel(shape.fill_height, radius=shape.radius)
        else:
            assert isinstance(shape, Rectangle)
            vessel = Vessel(shape.fill_height, width=shape.width, depth=shape.depth)
        factors = np.ones((1, 2))
        if one.model.covariance is not None:
            shares = LIKELY * FREQUENCY_ERROR * np.linspace(-1.0, 1.0, 9)
            factors = np.column_stack([1.0 + shares, np.ones(9)])
        zeta = float(one.model.mode_constants()[0].damping_ratio)
        return cls(vessel, zeta, factors, kept.height, kept.residual)

    def use(self, motions: Sequence[PlannedMotion]) -> Array:
        """Returns the largest share of its limits that each motion uses (M,), of equal steps."""
        count, many = len(motions), len(self.factors)
        liquids = Liquids(self.vessel, self.damping, np.tile(self.factors, (count, 1)))
        step, ends = motions[0].step, np.array([len(one.t) - 1 for one in motions])
        rows = int(ends.max() + math.ceil(AFTER / step)) + 1
        felt = np.zeros((rows, count, 3))
        for n, one in enumerate(motions):
            own = apparent(one)
            felt[: len(own), n], felt[len(own) :, n] = own, own[-1]
        found = np.zeros(count)
        for row in range(rows):
            high = liquids.heights.reshape(count, many).max(axis=1)
            limit = np.where(row >= ends, min(self.residual, self.height), self.height)
            found = np.maximum(found, high / limit)
            if row + 1 < rows:
                begin, end = (np.repeat(felt[k], many, axis=0) for k in (row, row + 1))
                liquids.move(step, begin, end)
        return found


def apparent(motion: PlannedMotion) -> Array:
    """Returns the acceleration Rᵀ(a + g ẑ) − g ẑ in the container's axes (N, 3) [m/s²]."""
    if motion.attitude is None:
        return motion.acceleration
    weight = np.array([0.0, 0.0, GRAVITY])
    turned = Rotation.from_quat(motion.attitude)
    found: Array = turned.inv().apply(motion.acceleration + weight) - weight
    return found


def mechanical_use(motion: PlannedMotion, limits: PlanLimits) -> dict[int, float]:
    """Returns the largest shares of limits of first, second and third derivatives by order."""
    size = np.linalg.norm(motion.acceleration, axis=1).max() / limits.acceleration
    steps = np.linalg.norm(np.diff(motion.acceleration, axis=0), axis=1).max()
    found = {1: 0.0, 2: float(size), 3: float(steps / motion.step / limits.jerk)}
    if motion.joints is not None:
        q, own = motion.joints.position, motion.joints.limits
        most = {1: own.velocity, 2: own.acceleration, 3: own.jerk}
        for order, limit in most.items():
            still = np.concatenate([np.tile(q[:1], (order, 1)), q, np.tile(q[-1:], (order, 1))])
            used = np.abs(np.diff(still, order, axis=0)).max(axis=0) / motion.step**order / limit
            found[order] = max(found[order], float(used.max()))
    return found


def random_cup(random: np.random.Generator) -> Model:
    """Returns the nonlinear model of a cup or a box with a random size and fill."""
    size = random.uniform(0.025, 0.05)
    fill = random.uniform(1.0, 2.0) * size
    if random.random() < 0.25:
        shape = Rectangle(2.0 * size, random.uniform(1.2, 2.0) * size, fill)
        return Model(shape).spatial().nonlinear()
    return Model(Cylinder(size, fill)).spatial().nonlinear()


def doubtful(model: Model) -> Model:
    """Returns the model with a covariance of its frequency."""
    error = FREQUENCY_ERROR * parameter_value(model, "natural_frequency")
    return replace(model, covariance=covariance_of(("natural_frequency",), np.array([[error**2]])))


def case_of(kind: str, seed: int) -> tuple[Tray, Route, PlanLimits]:
    """Returns the tray (of a model: of one), path and limits of a case."""
    random = np.random.default_rng([sum(map(ord, kind)), seed])
    height = float(random.choice([0.005, 0.01, 0.015, 0.02]))
    limits = PlanLimits(height, float(random.choice([0.15, 0.5])) * height)
    cups = [TrayContainer("", random_cup(random))]
    if kind == "robust":
        cups = [TrayContainer("", doubtful(cups[0].model))]
    if kind == "tray":
        cups = [
            TrayContainer(
                f"cup {n}", random_cup(random),
                tuple((random.uniform(-0.2, 0.2, size=3) * [1.0, 1.0, 0.0]).tolist()),
                float(random.uniform(0.005, 0.02)),
            )
            for n in range(int(random.integers(2, 5)))
        ]  # fmt: skip
    if kind not in MACHINES:
        points = random_points(seed)
        if kind == "line":
            points = np.array([np.zeros(3), random.uniform(-0.4, 0.4, 3) * [1.0, 1.0, 0.3]])
        ways = np.linalg.norm(np.diff(points, axis=0), axis=1)
        times = np.concatenate([[0.0], np.cumsum(ways * random.uniform(0.8, 1.2, len(ways)))])
        return Tray(tuple(cups)), path_through(points, times=times), limits
    machine = MACHINES[kind]
    text = description(machine)
    arm = Arm(text, "cup", kind)
    own = {joint: {"acceleration": ACCELERATION, "jerk": JERK} for joint in machine.joints}
    points, _ = random_path(Kinematics(text, machine.joints), seed)
    times = np.linspace(0.0, 2.0, len(points))
    route = joint_path(arm, joint_limits_of(arm, machine.joints, own), points, times=times)
    return Tray(tuple(cups)), route, limits


def measured(kind: str, seed: int) -> Row | None:
    """Plans a case and looks for a faster law; None where no motion is safe."""
    try:
        tray, route, limits = case_of(kind, seed)
        answer = plan_container(tray, route, limits, robust=kind == "robust").plan
    except SloshPlanError as error:
        print(kind, seed, error, flush=True)
        return None
    held = [Held.of(one, limits) for one in tray.present]
    laws: dict[str, TimeLaw | PlainLaw] = {"minimum jerk": PlainLaw(route), **answer.laws}
    laws |= {f"S-curve {parts}": PlainLaw(route, parts) for parts in CURVES}
    planned = answer.found.motion.duration
    best, name = fastest(held, limits, laws, planned)
    return Row(kind, seed, planned, answer.method, best, name, len(laws), answer.seconds)


def fastest(
    held: Sequence[Held],
    limits: PlanLimits,
    laws: Mapping[str, TimeLaw | PlainLaw],
    longest: float,
) -> tuple[float, str]:
    """Returns the shortest safe duration below a longest one [s], and the law; '' if none is."""
    found = ""
    for name, law in laws.items():
        trial = law.motion(2.0)
        least = max(2.0 * used ** (1.0 / n) for n, used in mechanical_use(trial, limits).items())
        count = math.floor(math.log(max(longest / least, 1.0)) / math.log(RATIO))
        durations = [COARSE * math.ceil(least * RATIO**n / COARSE) for n in range(count + 1)]
        durations = [one for one in dict.fromkeys(durations) if one * RATIO < longest]
        for at in range(0, len(durations), TOGETHER):
            some = durations[at : at + TOGETHER]
            coarse = [law.motion(one, COARSE) for one in some]
            uses = np.max([one.use(coarse) for one in held], axis=0)
            near = (one for one, use in zip(some, uses, strict=True) if use < LEFT + DOUBT)
            safe = next((one for one in near if _kept(held, limits, law.motion(one))), None)
            if safe is not None:
                longest, found = safe, name
                break
    return longest, found


def _kept(held: Sequence[Held], limits: PlanLimits, motion: PlannedMotion) -> bool:
    """Returns whether a motion at 1 kHz keeps all limits."""
    if max(mechanical_use(motion, limits).values()) > 1.0 + 1e-6:
        return False
    return all(float(one.use([motion])[0]) <= LEFT for one in held)


def table(rows: list[Row]) -> str:
    """Formats the results by kind as a table."""
    lines = [
        "| kind | cases | optimal law | slower than a law | longest time / fastest law | "
        "planning, median [s] | longest [s] |",
        "|---|" + "--:|" * 6,
    ]
    for kind in KINDS:
        own = [row for row in rows if row.kind == kind]
        if own:
            seconds = [row.seconds for row in own]
            lines.append(
                f"| {kind} | {len(own)} | {sum(row.method == 'optimal' for row in own)} "
                f"| {sum(row.ratio > RATIO for row in own)} "
                f"| {max(row.ratio for row in own):.3f} "
                f"| {statistics.median(seconds):.1f} | {max(seconds):.1f} |"
            )
    return "\n".join(lines)


def main() -> int:
    """Measures the missing cases and prints the table of odd seeds."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "rows", type=Path, help="file of results as JSON lines, extended by each run"
    )
    parser.add_argument("--cases", type=int, default=8, help="number of cases of each kind")
    parser.add_argument("--first", type=int, default=1, help="first seed; every second is used")
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=KINDS, help="of cases")
    parser.add_argument("--docs", action="store_true", help=f"write the table into {PAGE.name}")
    given = parser.parse_args()
    lines = given.rows.read_text(encoding="utf-8").splitlines() if given.rows.exists() else []
    rows = {(row.kind, row.seed): row for row in (Row(**json.loads(line)) for line in lines)}
    for seed in range(given.first, given.first + 2 * given.cases, 2):
        for kind in given.kinds:
            row = None if (kind, seed) in rows else measured(kind, seed)
            if row is not None:
                rows[kind, seed] = row
                with given.rows.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(asdict(row)) + "\n")
                print(row, flush=True)
    text = table([row for row in rows.values() if row.seed % 2])
    print(text)
    if given.docs:
        fill(PAGE, "candidates", text)
    return int(any(row.ratio > RATIO for row in rows.values()))


if __name__ == "__main__":
    sys.exit(main())
