"""A plan's results in lines of text, and as values for programs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

from slosh_base.files.plain_text import plain_line
from slosh_plan.limits import rim_words
from slosh_plan.planning.given_law import in_words
from slosh_plan.planning.plan import Plan
from slosh_plan.planning.plan_tray import TrayPlan
from slosh_plan.planning.robust import LikelyHeights
from slosh_plan.planning.tolerance import ERRORS, USUAL, Tolerance
from slosh_plan.tray import TrayPrediction
from slosh_report.document import Document, Lines


def likely_words(answer: Plan, likely: LikelyHeights) -> str:
    """Describes peak heights over all likely model parameters, and the duration they require."""
    duration, limits = answer.found.motion.duration, answer.limits
    return (
        f"with {likely.count} likely models ({', '.join(likely.parameters)}; 95 %) up to "
        f"{1e3 * likely.peak:.2f} of {1e3 * limits.height:.4g} mm, after the end "
        f"{1e3 * likely.residual:.2f} of {1e3 * limits.residual:.4g} mm; "
        f"{likely.nominal_duration:.3f} s would do for the model's own parameters "
        f"({100.0 * (duration / likely.nominal_duration - 1.0):+.1f} %)"
    )


def tray_lines(name: str, found: TrayPrediction) -> list[str]:
    """Describes which container limits the plan, and the heights in the other containers."""
    heights = [
        f"{other} {1e3 * each.nonlinear.peak:.2f} of {1e3 * each.limits.height:g} mm"
        for other, each in found.containers.items()
    ]
    return [f"planned for container {name}: {', '.join(heights)}", *found.loose_words]


def tray_facts(planned: TrayPlan, borne: Tolerance) -> dict[str, object]:
    """Returns the planned motion's results as a dictionary in SI units."""
    own: dict[str, object] = {}
    if planned.one.name:
        own["container"] = planned.one.name
    if planned.likely is not None:
        own["likely"] = asdict(planned.likely)
    return plan_facts(planned.plan, borne) | own


def plan_facts(answer: Plan, borne: Tolerance) -> dict[str, object]:
    """Returns a plan's results as a dictionary, without results for a tray or likely models."""
    found, scaled = answer.found, answer.scaled
    return {
        "duration": found.motion.duration,
        "method": answer.method,
        "reason": answer.reason or None,
        "height_limit": answer.limits.height,
        "limited_by": answer.limits.height_name,
        "distance_to_rim": answer.distance_to_rim,
        "peak": found.peak,
        "residual": found.residual,
        "acceleration": found.acceleration,
        "jerk": found.jerk,
        "joints": dict(found.joints),
        "tilt": found.tilt,
        "tilt_rate": found.tilt_rate,
        "tilt_acceleration": found.tilt_acceleration,
        "margin": answer.margin,
        "sigma": answer.error and answer.error.sigma,
        "epsilon": answer.error and answer.error.epsilon,
        "error_margin": found.upper - found.peak,
        "residual_error_margin": found.residual_upper - found.residual,
        "upper": answer.upper and answer.upper[0],
        "residual_upper": answer.upper and answer.upper[1],
        "scaled": {"law": scaled.law, "duration": scaled.found.motion.duration},
        "frequency_tolerance": borne.error,
        "peak_at_one_percent": borne.peak,
        "residual_at_one_percent": borne.residual,
        "length": answer.path.length,
        "stops": len(answer.path.legs) - 1,
        "departure": answer.path.departure,
        "seconds": answer.seconds,
    }


def law_words(answer: Plan) -> str:
    """Describes by which law the motion runs, and the fastest known law beside it."""
    duration = answer.found.motion.duration
    other = f"{answer.scaled.found.motion.duration:.3f} s by {in_words(answer.scaled.law)}"
    reason = answer.reason
    if answer.method == "optimal":
        return f"{duration:.3f} s, {answer.law} ({other}, scaled)" + f"; {reason}" * bool(reason)
    if answer.method == answer.scaled.law:
        return f"{other}, scaled: {reason}"
    return f"{duration:.3f} s by {answer.law} ({other}, scaled): {reason}"


def law_lines(planned: TrayPlan) -> list[str]:
    """Describes the container that limits a plan, likely models, and the law of the motion."""
    answer = planned.plan
    return [
        *([] if planned.found is None else tray_lines(planned.one.name, planned.found)),
        *([] if planned.likely is None else [likely_words(answer, planned.likely)]),
        law_words(answer),
    ]


def further_lines(planned: TrayPlan) -> list[str]:
    """Describes what a page's table and charts do not tell: law, containers, tilt, joints."""
    answer = planned.plan
    return [*law_lines(planned), *tilted(answer), *joints_used(answer)]


def answer_document(
    planned: TrayPlan, output: Path | None, borne: Tolerance, remarks: Sequence[str]
) -> Document:
    """Returns what `slosh plan` prints; see plan_lines."""
    lines = plan_lines(planned, output, borne, remarks)
    facts = tray_facts(planned, borne) | {"remarks": remarks}
    return Document(lines[0], data=facts, brief=(Lines(tuple(lines)),))


def plan_lines(
    planned: TrayPlan, output: Path | None, borne: Tolerance, remarks: Sequence[str] = ()
) -> list[str]:
    """Describes the planned motion's results in a few lines.

    Args:
        planned: the motion.
        output: where it is written; None: nowhere.
        borne: which error of the frequency it bears.
        remarks: what `slosh predict` remarks on the same motion.
    """
    answer = planned.plan
    found, limits = answer.found, answer.limits
    count = len(found.motion.t)
    rows = f"{count} rows in {plain_line(output)}" if output else "not written (-o FILE.csv)"
    return [
        *law_lines(planned),
        f"height {1e3 * found.peak:.2f} of {1e3 * limits.height:.4g} mm"
        + (f" (the {limits.height_name})" if limits.at_rim else "")
        + rim_words(answer.distance_to_rim)
        + ", after the end "
        f"{1e3 * found.residual:.2f} of {1e3 * limits.residual:.4g} mm, margin "
        + (f"{1e3 * answer.margin:g} mm" if answer.margin else "none"),
        interval(answer),
        tolerance(borne),
        f"acceleration {found.acceleration:.2f} of {limits.acceleration:g} m/s², "
        f"jerk {found.jerk:.1f} of {limits.jerk:g} m/s³",
        *tilted(answer),
        *joints_used(answer),
        path_words(answer),
        *([f"remarks: {'; '.join(remarks)}"] if remarks else []),
        f"{rows}, planned in {answer.seconds:.1f} s",
    ]


def tilted(answer: Plan) -> list[str]:
    """Describes the container's tilt, as text lines; empty if tilting is not allowed."""
    found, limits = answer.found, answer.limits
    if limits.tilt == 0.0:
        return []
    pairs = (
        (found.tilt, limits.tilt, "°"),
        (found.tilt_rate, limits.tilt_rate, "°/s"),
        (found.tilt_acceleration, limits.tilt_acceleration, "°/s²"),
    )
    words = (f"{math.degrees(x):.3g} of {math.degrees(most):.3g}{unit}" for x, most, unit in pairs)
    return ["tilt " + ", ".join(words)]


def joints_used(answer: Plan) -> list[str]:
    """Describes how close a joint motion comes to the robot's joint limits."""
    used = answer.found.joints
    if not used:
        return []
    words = (f"{name.removeprefix('joint_')} {100.0 * share:.0f} %" for name, share in used.items()
             if share > 0.0)  # fmt: skip
    return ["joints use of their limits: " + ", ".join(words)]


def path_words(answer: Plan) -> str:
    """Describes the path: its length, its stops and its distance from straight lines."""
    path, motion = answer.path, answer.found.motion
    length, unit = path.length, "mm"
    if motion.joints is not None:
        length = float(np.linalg.norm(np.diff(motion.position, axis=0), axis=1).sum())
        unit = "mrad"
    return (
        f"path {length:.3f} m, {_stops(len(path.legs) - 1)}, up to "
        f"{1e3 * path.departure:.2f} {unit} from straight lines between the waypoints"
    )


def interval(answer: Plan) -> str:
    """Describes the interval of peak heights due to model error and parameter covariance."""
    if answer.upper is None:
        return "the model has no covariance of its parameters: no interval"
    (peak, residual), found, error = answer.upper, answer.found, answer.error
    if error is not None:
        return (
            f"{1e3 * (peak - found.peak):.2f} mm of the limit, and "
            f"{1e3 * (residual - found.residual):.2f} mm of the limit after the end, are "
            f"reserved for the model's error (MAE {1e3 * error.sigma:.3g} mm, ε "
            f"{100.0 * error.epsilon:.3g} %, its covariance; 95 %): up to {1e3 * peak:.2f} "
            f"mm, after the end {1e3 * residual:.2f} mm"
        )
    limits = answer.limits
    missing = max(peak - limits.height, residual - limits.residual)
    kept = (
        "both limits are kept" if missing <= 0.0 else f"exceeds a limit by {1e3 * missing:.2f} mm"
    )
    return (
        f"with the covariance of the model's parameters up to {1e3 * peak:.2f} mm, after the end "
        f"{1e3 * residual:.2f} mm (95 %): {kept}"
    )


def tolerance(borne: Tolerance) -> str:
    """Describes how large a natural-frequency error would make heights exceed their limit."""
    usual = f"with a frequency {100.0 * USUAL:g} % off up to {1e3 * borne.peak:.2f} mm"
    after = f"after the end {1e3 * borne.residual:.2f} mm"
    if borne.error == 0.0:
        said = f"an error of {100.0 * ERRORS[0]:g} % already exceeds a limit"
    else:
        said = f"the limits hold for errors of up to {100.0 * borne.error:g} %"
    advice = "" if borne.error >= USUAL else "; --margin or --mae leave room for it"
    return f"{usual}, {after}: {said}{advice}"


def _stops(count: int) -> str:
    return {0: "no stop", 1: "1 stop"}.get(count, f"{count} stops")
