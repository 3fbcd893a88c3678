"""Compares robust with usual plans under parameter errors; fills docs/plan.md.

    tools/run python validation/studies/robust_plans.py [--cases 24] [--seed 1] [--docs]

Random paths, containers, limits and covariances of the model's parameters. The usual plan and the
robust one are simulated with 1,000 likely models that neither has seen.
"""

from __future__ import annotations

import argparse
import statistics
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import with_tools  # noqa: F401
from plan_tables import CONTAINERS, random_points
from result_tables import fill

from slosh_model import Model
from slosh_model.covariance import covariance_of
from slosh_model.parameters import parameter_value
from slosh_plan.planning.checked import heights_after
from slosh_plan.planning.likely import likely_models
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.planning.path import path_through
from slosh_plan.planning.plan import NoSafeMotionError, Plan, plan
from slosh_plan.planning.robust import plan_robust

PAGE = Path(__file__).resolve().parents[2] / "docs" / "plan.md"
FREQUENCY_ERRORS = (0.002, 0.005, 0.01, 0.02)
"""Relative standard errors of the natural frequency, in turn."""
TIME_LIMIT = 120.0
"""Of a plan [s]: enough on a busy machine."""
UNSEEN = 1618
"""Seed of the models that judge the plans."""


@dataclass(frozen=True, slots=True)
class Row:
    """Results of one case: durations [s] and relative excess over the limits."""

    frequency_error: float
    usual: float
    usual_excess: float
    robust: float
    robust_excess: float
    seconds: float


def doubtful(model: Model, frequency_error: float, rng: np.random.Generator) -> Model:
    """Returns the model with a random covariance of its parameters."""
    names = ["natural_frequency", "damping_ratio"]
    shares = [frequency_error, rng.uniform(0.05, 0.4)]
    if any(use.name == "surface_nonlinearity" for use in model.effects):
        names.append("surface_nonlinearity.alpha")
        shares.append(rng.uniform(0.05, 0.3))
    errors = np.array(
        [share * parameter_value(model, n) for share, n in zip(shares, names, strict=True)]
    )
    mix = np.eye(len(names)) + 0.4 * rng.standard_normal((len(names), len(names)))
    correlated = mix @ mix.T
    scale = np.sqrt(np.diag(correlated))
    matrix = correlated / np.outer(scale, scale) * np.outer(errors, errors)
    return replace(model, covariance=covariance_of(tuple(names), matrix))


def excess(model: Model, answer: Plan, limits: PlanLimits) -> float:
    """Returns the largest relative excess over a limit among models not used for planning."""
    motion = answer.found.motion
    heights = list(heights_after(likely_models(model, seed=UNSEEN).models, motion, None))
    end = len(motion.t) - 1
    peak = max(float(msh.max()) for msh in heights)
    residual = max(float(msh[end:].max()) for msh in heights)
    return max(peak / limits.height, residual / limits.residual) - 1.0


def measured(seed: int) -> Row | None:
    """Plans one random case; None if no motion keeps its limits for all parameters."""
    rng = np.random.default_rng(seed)
    frequency_error = FREQUENCY_ERRORS[seed // 2 % len(FREQUENCY_ERRORS)]
    bare = list(CONTAINERS.values())[int(rng.integers(len(CONTAINERS)))]
    model = doubtful(bare, frequency_error, rng)
    height = float(rng.choice([0.005, 0.015, 0.025]))
    limits = PlanLimits(height, float(rng.choice([0.002, 0.5 * height])))
    path = path_through(random_points(seed))
    try:
        answer, _ = plan_robust(model, path, limits, time_limit=TIME_LIMIT)
    except NoSafeMotionError as error:
        print(f"{seed}: {error}", flush=True)
        return None
    usual = plan(bare, path, limits)
    row = Row(
        frequency_error, usual.found.motion.duration, excess(model, usual, limits),
        answer.found.motion.duration, excess(model, answer, limits), answer.seconds,
    )  # fmt: skip
    print(seed, row, flush=True)
    return row


def table(rows: list[Row]) -> str:
    """Formats the results by the frequency's standard error as a Markdown table."""
    lines = [
        "| standard error of the frequency | cases | usual plan above a limit | its largest excess"
        " | robust plan above by 1 % | largest excess | longer by, median | most | planning |",
        "|--:|--:|--:|--:|--:|--:|--:|--:|--:|",
    ]  # fmt: skip
    for error in sorted({row.frequency_error for row in rows}):
        some = [row for row in rows if row.frequency_error == error]
        longer = [row.robust / row.usual - 1.0 for row in some]
        lines.append(
            f"| {100 * error:g} % | {len(some)} "
            f"| {sum(row.usual_excess > 0.01 for row in some)} "
            f"| {100 * max(row.usual_excess for row in some):.0f} % "
            f"| {sum(row.robust_excess > 0.01 for row in some)} "
            f"| {100 * max(max(row.robust_excess for row in some), 0.0):.2f} % "
            f"| {100 * statistics.median(longer):.1f} % | {100 * max(longer):.0f} % "
            f"| {statistics.median(row.seconds for row in some):.1f} s |"
        )
    return "\n".join(lines)


def main() -> None:
    """Plans all cases and prints or writes the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=24, help="number of cases")
    parser.add_argument("--seed", type=int, default=1, help="first seed; every second one is used")
    parser.add_argument("--docs", action="store_true", help="fill the table in docs/plan.md")
    arguments = parser.parse_args()
    seeds = range(arguments.seed, arguments.seed + 2 * arguments.cases, 2)
    found = [measured(seed) for seed in seeds]
    rows = [row for row in found if row is not None]
    text = table(rows)
    print(f"{len(found) - len(rows)} of {len(found)} without a plan\n{text}")
    if arguments.docs:
        fill(PAGE, "robust", text)


if __name__ == "__main__":
    main()
