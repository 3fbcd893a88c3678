"""Measures how fast planned motions are, and fills the table in docs/plan.md.

    tools/run python validation/studies/plan_tables.py ROWS.jsonl [--paths 20] [--docs]

For DL22's spatial motions, a straight line of 0.4 m and random smooth paths, in three containers,
at three limits: the time of the optimal law, of DL22's law and of the best of known laws, all
scaled until the simulation keeps every limit. Rows that ROWS.jsonl holds are not measured again.
"""

from __future__ import annotations

import argparse
import json
import random
import statistics
import sys
import time
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import numpy as np
import with_tools  # noqa: F401
from numpy.typing import NDArray
from result_tables import fill
from scipy.interpolate import make_interp_spline

from slosh_bringup.cell.motions import MOTIONS, PATHS, make_motion
from slosh_model import Cylinder, Model, Rectangle
from slosh_plan.planning.checked import Checker
from slosh_plan.planning.known_laws import (
    LONGEST,
    Make,
    fastest,
    known_laws,
    leg_durations,
)
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.planning.path import Leg, path_through
from slosh_plan.planning.path import Path as Route
from slosh_plan.planning.plan import NoSafeMotionError, plan
from slosh_plan.planning.time_law import PlannedMotion, motion_along
from slosh_plan.planning.unit_laws import UNIT_LAWS, UnitLaw

Array = NDArray[np.float64]

PAGE = Path(__file__).resolve().parents[2] / "docs" / "plan.md"
CONTAINERS = {
    "cylinder R 50, h 70": Model(Cylinder(0.05, 0.07)).spatial().nonlinear(),
    "cylinder R 35, h 90": Model(Cylinder(0.035, 0.09)).spatial().nonlinear(),
    "rectangle 80 × 60, h 70": Model(Rectangle(0.08, 0.06, 0.07)).spatial().nonlinear(),
}
LIMITS = (0.005, 0.015, 0.025)
RESIDUAL = 0.002
SMOOTHEST_TURN = 0.6
"""Cosine of the sharpest turn of a random path."""


@dataclass(frozen=True, slots=True)
class Row:
    """Results of one path: durations [s] by planning method, infinite if none is safe.

    `fallback` is by the best of the planner's own known laws, `best` by the best of these, of laws
    along DL22's parameter and of a shaped one.
    """

    container: str
    limit: float
    name: str
    optimal: float
    method: str
    best: float
    dl22: float
    fallback: float
    seconds: float

    @property
    def case(self) -> tuple[str, float, str]:
        """Container, limit and path, which identify the case."""
        return self.container, self.limit, self.name


def random_points(seed: int) -> Array:
    """Returns waypoints of two to five random steps that do not turn sharply."""
    generator = np.random.default_rng(seed)
    while True:
        steps = generator.normal(size=(generator.integers(2, 6), 3)) * [0.12, 0.12, 0.05]
        directions = steps / np.linalg.norm(steps, axis=1, keepdims=True)
        cosines = np.einsum("ij,ij->i", directions[:-1], directions[1:])
        if (cosines > SMOOTHEST_TURN).all():
            return np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])


def cases(count: int) -> dict[str, Array]:
    """Returns the waypoints of all paths by name."""
    named = {name: make_motion(name).position for name in ("l3", "e3", "c3")}
    named["p2p"] = np.array([[0.0, 0.0, 0.0], [0.4, 0.0, 0.0]])
    return named | {f"random {seed}": random_points(seed) for seed in range(count)}


def by_parameter(name: str, law: UnitLaw, duration: float, step: float) -> PlannedMotion:
    """Creates a motion whose time law acts on DL22's path parameter, not on path length."""
    spec = MOTIONS[name]
    sigma = np.linspace(0.0, 1.0, 4001)
    columns = [path(sigma)[0] for path in PATHS[spec.path]]
    made = make_motion(name)
    height = float(np.ptp(made.position[:, 2]))
    columns.append(0.5 * height * (1.0 - np.cos(4.0 * np.pi * sigma)))
    points = np.column_stack(columns)
    u = np.arange(round(duration / step) + 1) / round(duration / step)
    curve = make_interp_spline(sigma, points, k=5)
    place, rate, change = law(u)
    acceleration = curve.derivative(2)(place) * (rate**2)[:, None]
    acceleration += curve.derivative(1)(place) * change[:, None]
    acceleration /= duration**2
    acceleration[[0, -1]] = 0.0
    return PlannedMotion(u * duration, curve(place), acceleration, rate)


def shaped(
    route: Route, period: float, law: UnitLaw, duration: float, step: float
) -> PlannedMotion:
    """Creates a motion in which each leg is shaped by ZV: two halves, half a period apart."""
    lag, durations = 0.5 * period, leg_durations(route, duration)

    def halves(leg: Leg, time: float, t: Array) -> tuple[Array, Array, Array]:
        rest = max(time - lag, 1e-3)
        first, second = law(t / rest), law((t - lag) / rest)
        s, v, a = (0.5 * (x + y) for x, y in zip(first, second, strict=True))
        return leg.length * s, leg.length * v / rest, leg.length * a / rest**2

    pairs = zip(route.legs, durations, strict=True)
    return motion_along(route, [partial(halves, *pair) for pair in pairs], durations, step)


def scaled_times(model: Model, name: str, route: Route, limits: PlanLimits) -> tuple[float, float]:
    """Returns the shortest safe durations [s] of the best standard law and of DL22's law."""
    makers: dict[str, Make] = {law: known.motion for law, known in known_laws(route).items()}
    dl22 = "modified trapezoidal"
    if name in MOTIONS:
        makers |= {f"{law}, σ": partial(by_parameter, name, UNIT_LAWS[law]) for law in UNIT_LAWS}
        dl22 = "modified trapezoidal, σ"
    if len(route.legs) == 1:
        period = 2.0 * np.pi / model.mode_constants()[0].natural_frequency
        makers["ZV"] = partial(shaped, route, period, UNIT_LAWS["quintic"])
    own = _time(model, makers.pop(dl22), limits, LONGEST)
    best = own
    for make in makers.values():
        best = min(best, _time(model, make, limits, min(best, LONGEST)))
    return best, own


def _time(model: Model, make: Make, limits: PlanLimits, longest: float) -> float:
    found = fastest(Checker(model), make, limits, longest)
    return np.inf if found is None else found.motion.duration


def measure(container: str, limit: float, name: str, points: Array) -> Row:
    """Plans one path with all methods and returns the results."""
    model = CONTAINERS[container]
    limits = PlanLimits(limit, RESIDUAL, 9.5, 74.0)
    route = path_through(points)
    started = time.monotonic()
    try:
        answer = plan(model, route, limits)
    except NoSafeMotionError:
        return Row(container, limit, name, *(np.inf, "none", np.inf, np.inf, np.inf, 0.0))
    seconds = time.monotonic() - started
    best, dl22 = scaled_times(model, name, route, limits)
    return Row(
        container, limit, name, answer.found.motion.duration, answer.method, best, dl22,
        answer.scaled.found.motion.duration, seconds,
    )  # fmt: skip


def table(rows: list[Row]) -> str:
    """Formats the results as a table, with medians of the random paths."""
    heads = (
        "container [mm]", "path", "DL22's law [s]", "best known law [s]", "fallback [s]",
        "planned [s]", "planning [s]",
    )  # fmt: skip
    lines = [f"| {' | '.join(heads)} |", f"|---|---|{'--:|' * (len(heads) - 2)}"]
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in sorted(rows, key=lambda row: (row.name.split()[0], row.container)):
        kind = "random" if row.name.startswith("random") else row.name
        groups.setdefault((row.container, kind), []).append(row)
    for (container, kind), group in groups.items():
        by_limit = [[row for row in group if row.limit == limit] for limit in LIMITS]
        name = f"{len(by_limit[0])} random" if kind == "random" else kind
        figures = (
            ("2f", [[row.dl22 for row in own] for own in by_limit]),
            ("2f", [[row.best for row in own] for own in by_limit]),
            ("2f", [[row.fallback for row in own] for own in by_limit]),
            ("2f", [[row.optimal for row in own] for own in by_limit]),
            ("1f", [[row.seconds for row in own] for own in by_limit]),
        )
        cells = [
            ", ".join(f"{statistics.median(own):.{form}}" if own else "–" for own in values)
            for form, values in figures
        ]
        lines.append(f"| {container} | {name} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n\n" + closing(rows)


def closing(rows: list[Row]) -> str:
    """Describes the median results in a sentence."""
    to_best = statistics.median(row.optimal / row.best for row in rows)
    to_dl22 = statistics.median(row.optimal / row.dl22 for row in rows)
    to_fallback = statistics.median(row.optimal / row.fallback for row in rows)
    seconds = sorted(row.seconds for row in rows)
    optimal = sum(row.method == "optimal" for row in rows)
    return (
        f"{optimal} of {len(rows)} by an optimal law. Median time {to_best:.2f} of the best known "
        f"law's, {to_fallback:.2f} of the fallback's, {to_dl22:.2f} of DL22's; planning "
        f"{statistics.median(seconds):.1f} s, longest {seconds[-1]:.1f} s.\n"
    )


def read_rows(path: Path) -> list[Row]:
    """Reads the results of earlier runs."""
    if not path.exists():
        return []
    return [Row(**json.loads(line)) for line in path.read_text(encoding="utf-8").splitlines()]


def main() -> int:
    """Plans as many cases as the time allows, in mixed order, and prints the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "rows", type=Path, help="file of results as JSON lines, extended by each run"
    )
    parser.add_argument("--paths", type=int, default=20, help="random paths")
    parser.add_argument(
        "--seconds", type=float, default=1e9, help="time after which no new case is begun [s]"
    )
    parser.add_argument("--docs", action="store_true", help="write docs/plan.md")
    arguments = parser.parse_args()
    todo = [
        (container, limit, name, points)
        for name, points in cases(arguments.paths).items()
        for container in CONTAINERS
        for limit in LIMITS
    ]
    # In an order that mixes them, for who has not the time for all.
    random.Random(1).shuffle(todo)
    rows = read_rows(arguments.rows)
    known = {row.case for row in rows}
    began = time.monotonic()
    for case in todo:
        if case[:3] in known:
            continue
        if time.monotonic() - began > arguments.seconds:
            break
        rows.append(measure(*case))
        with arguments.rows.open("a", encoding="utf-8") as file:
            file.write(json.dumps(asdict(rows[-1])) + "\n")
        print(rows[-1], flush=True)
    print(table(rows))
    if arguments.docs:
        fill(PAGE, "durations", table(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
