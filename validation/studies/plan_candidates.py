"""Compares plans with plain and slowed laws, which they must never be slower than.

    tools/run python -m pip install --no-deps -r requirements/robots.txt
    tools/run python validation/studies/plan_candidates.py ROWS.jsonl [--cases 24] [--docs]

Random trays of two to four cups, random paths of a cup and random paths of a UR5's or a Panda's
joints, with random fills, limits and times of the waypoints. Each plan is compared with seven
S-curves from a nearly trapezoidal speed to no coasting, six smooth laws, the fastest motion
without a liquid and the waypoints' own times, each at its shortest safe duration, in steps of
0.3 %. Settings were chosen on even seeds; the table has the odd ones. Rows that ROWS.jsonl holds
are not measured again.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import with_tools  # noqa: F401
from joint_plan_tables import ACCELERATION, JERK, MACHINES, Kinematics, description, random_path
from numpy.typing import NDArray
from plan_tables import random_points
from result_tables import fill

from slosh_model import Cylinder, Model, Rectangle
from slosh_model.tray import Tray, TrayContainer
from slosh_plan import SloshPlanError
from slosh_plan.joints import Arm
from slosh_plan.planning.checked import AllContainers, Checker
from slosh_plan.planning.given_law import all_laws
from slosh_plan.planning.joint_limits import limits_of as joint_limits_of
from slosh_plan.planning.joint_path import joint_path
from slosh_plan.planning.known_laws import TimeLaw, leg_durations, shortest
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.planning.path import Path as Route
from slosh_plan.planning.path import path_through
from slosh_plan.planning.plan import model_for
from slosh_plan.planning.plan_tray import plan_container
from slosh_plan.planning.time_law import STEP, JerkLaw, PlannedMotion, motion_along, whole_rows
from slosh_plan.tray import limits_of

Array = NDArray[np.float64]
PAGE = Path(__file__).resolve().parents[2] / "docs" / "plan.md"
KINDS = ("tray", "path", "UR5", "Panda")
CURVES = ((1, 19, 0), (1, 9, 18), (1, 3, 30), (2, 8, 16), (4, 6, 12), (5, 10, 0), (10, 0, 0))
"""Fortieths of the duration: of each change of the acceleration, of its holds, of coasting."""
RATIO = 1.003
"""Of two durations that are tried in turn."""
TOGETHER = 16
SEARCHED = 300.0
"""Time for the fastest motion without a liquid [s]: enough on a busy machine."""


@dataclass(frozen=True, slots=True)
class Row:
    """Results of one case.

    Attributes:
        kind, seed: the case.
        planned: duration of the plan [s].
        method: of the plan.
        best: of the fastest law [s]; the plan's where none is faster.
        law: its name; empty: none is faster.
        seconds: that planning took.
    """

    kind: str
    seed: int
    planned: float
    method: str
    best: float
    law: str
    seconds: float

    @property
    def ratio(self) -> float:
        """Duration of the plan by that of the fastest law."""
        return self.planned / self.best


@dataclass(frozen=True, slots=True)
class SCurve:
    """An S-curve of the place along each leg, for any duration."""

    path: Route
    parts: tuple[int, int, int]

    def motion(self, duration: float, step: float = STEP) -> PlannedMotion:
        """Creates the motion with a total duration and a sample interval [s]."""
        ramp, hold, coast = self.parts
        push = [1.0] * ramp + [0.0] * hold + [-1.0] * ramp
        jerk = np.array([*push, *([0.0] * coast), *(-one for one in push)])
        durations = leg_durations(self.path, duration)
        laws = []
        for leg, time in zip(self.path.legs, durations, strict=True):
            reached = float(JerkLaw(time, jerk).nodes()[-1, 0])
            laws.append(JerkLaw(time, jerk * leg.length / reached))
        return motion_along(self.path, laws, durations, step)


def random_cup(random: np.random.Generator) -> Model:
    """Returns the nonlinear model of a cup or a box with a random size and fill."""
    size = random.uniform(0.025, 0.05)
    fill = random.uniform(1.0, 2.0) * size
    if random.random() < 0.25:
        shape = Rectangle(2.0 * size, random.uniform(1.2, 2.0) * size, fill)
        return Model(shape).spatial().nonlinear()
    return Model(Cylinder(size, fill)).spatial().nonlinear()


def case_of(kind: str, seed: int) -> tuple[Tray, Route, PlanLimits]:
    """Returns the tray (of a model: of one), path and limits of a case."""
    random = np.random.default_rng([KINDS.index(kind), seed])
    height = float(random.choice([0.005, 0.01, 0.015, 0.02]))
    limits = PlanLimits(height, float(random.choice([0.15, 0.5])) * height)
    cups = [TrayContainer("", random_cup(random))]
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
        answer = plan_container(tray, route, limits).plan
    except SloshPlanError as error:
        print(kind, seed, error, flush=True)
        return None
    check = AllContainers(
        tuple(
            (Checker(model_for(one.placed, limits, route)),
             limits_of(one, limits).under_rim(one.placed))
            for one in tray.present
        )
    )  # fmt: skip
    laws: dict[str, TimeLaw | SCurve] = {**all_laws(route, limits, SEARCHED)}
    laws |= {f"S-curve {parts}": SCurve(route, parts) for parts in CURVES}
    planned = answer.found.motion.duration
    best, name = fastest(check, laws, planned)
    return Row(kind, seed, planned, answer.method, best, name, answer.seconds)


def fastest(
    check: AllContainers, laws: Mapping[str, TimeLaw | SCurve], longest: float
) -> tuple[float, str]:
    """Returns the shortest safe duration below a longest one [s], and the law; '' if none is."""
    found, kept = "", check.each[0][1]
    for name, law in laws.items():
        least = whole_rows(shortest(law.motion, kept))
        count = math.floor(math.log(max(longest / least, 1.0)) / math.log(RATIO))
        durations = [whole_rows(least * RATIO**n) for n in range(count + 1)]
        durations = [one for one in dict.fromkeys(durations) if one < longest]
        for at in range(0, len(durations), TOGETHER):
            some = [law.motion(one) for one in durations[at : at + TOGETHER]]
            safe = [one for one in check(some) if one.keeps(kept)]
            if safe:
                longest, found = safe[0].motion.duration, name
                break
    return longest, found


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
    parser.add_argument("--cases", type=int, default=24, help="number of cases of each kind")
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
