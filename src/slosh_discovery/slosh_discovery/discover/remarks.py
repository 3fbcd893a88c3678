"""Remarks on the result of a discovery, one sentence each."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from slosh_discovery.discover.finding import HeightGap, MotionFinding, Role
from slosh_discovery.discover.motion import MeasuredMotion
from slosh_discovery.discover.verdict import ChosenExplanation


def campaign_remarks(cases: Sequence[MotionFinding]) -> tuple[str, ...]:
    """Lists the groups of motions that the discovery found."""
    groups: dict[str, list[str]] = {}
    for case in cases:
        if case.role is Role.FIT and case.motion.group is not None:
            groups.setdefault(case.motion.group, []).append(case.motion.name)
    listed = "; ".join(f"{group}: {', '.join(names)}" for group, names in sorted(groups.items()))
    remarks = [
        f"The heights show {len(groups)} set-ups of the sensor: {listed}. If you know which "
        "motions belong together, give them with --group."
    ]
    if any(case.role is Role.HOLDOUT for case in cases):
        remarks.append(
            "Each held-out motion is assigned to the set-up that fits its heights best."
        )
    return tuple(remarks)


def rejection_remarks(judgement: ChosenExplanation, gap: HeightGap) -> tuple[str, ...]:
    """Explains why the most probable effects are not added to the model."""
    names = " + ".join(judgement.chosen.explanation.effects)
    if not math.isfinite(gap.holdout_after):
        return (
            f"{names} explains the fitted motions best, but has no finite solution for a motion "
            "held out: it is not the missing effect and not added. Check that motion's units.",
        )
    return (
        f"{names} explains the fitted motions best, but changes the rms residual of the "
        f"held-out ones from {1e3 * gap.holdout_before:.2f} to {1e3 * gap.holdout_after:.2f} mm: "
        "it is not the missing effect, and not added.",
    )


def answer_remarks(cases: Sequence[MotionFinding]) -> tuple[str, ...]:
    """Lists the motions for which the base model has no solution."""
    return tuple(
        f"{unanswered(case.motion)}." for case in cases if not math.isfinite(case.before.rms)
    )


def unanswered(motion: MeasuredMotion) -> str:
    """Explains why a model has no solution for a motion."""
    highest = float(np.linalg.norm(motion.inputs.acceleration, axis=1).max())
    return (
        f"{motion.name}: the model has no finite solution for this motion, whose acceleration "
        f"reaches {highest:.3g} m/s²; check its unit"
    )


def judgement_remarks(judgement: ChosenExplanation) -> tuple[str, ...]:
    """Lists doubts that follow from the measured heights themselves."""
    remarks = []
    if judgement.unseen:
        remarks.append(
            "The measured heights hardly change although the model predicts motion: check the "
            "camera first."
        )
    elif judgement.elsewhere is not None:
        remarks.append(judgement.elsewhere.text())
    elif judgement.hidden:
        remarks.append(
            "The most probable explanation improves the fit by less than the sensor's standard "
            "deviation: it cannot be verified, and nothing is added."
        )
    elif judgement.change is not None:
        remarks.append(judgement.change.text())
    elif judgement.trust < 1.0:
        remarks.append(
            "The best explanation leaves more than noise: another effect acts as well, or its "
            "equation is inaccurate."
        )
    return tuple(remarks)
