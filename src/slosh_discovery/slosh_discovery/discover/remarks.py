"""What the reader of a finding must know beside its numbers, a sentence each."""

from __future__ import annotations

from collections.abc import Sequence

from slosh_discovery.discover.finding import Gap, MotionFinding, Role
from slosh_discovery.discover.verdict import Judgement


def campaign_remarks(cases: Sequence[MotionFinding]) -> tuple[str, ...]:
    """Which motions were found to belong together."""
    groups: dict[str, list[str]] = {}
    for case in cases:
        if case.role is Role.FIT and case.motion.group is not None:
            groups.setdefault(case.motion.group, []).append(case.motion.name)
    listed = "; ".join(f"{group}: {', '.join(names)}" for group, names in sorted(groups.items()))
    remarks = [
        f"The heights show {len(groups)} set-ups of the sensor: {listed}. Where you know which "
        "motions belong together, say so (--group)."
    ]
    if any(case.role is Role.HOLDOUT for case in cases):
        remarks.append(
            "Each held-out motion is taken for one of the set-up that its own heights fit best."
        )
    return tuple(remarks)


def rejection_remarks(judgement: Judgement, gap: Gap) -> tuple[str, ...]:
    """Why the likeliest explanation is not added."""
    names = " + ".join(judgement.chosen.explanation.effects)
    return (
        f"{names} explains the fitted motions best, but takes those held out from "
        f"{1e3 * gap.holdout_before:.2f} to {1e3 * gap.holdout_after:.2f} mm rms: it is not what "
        "is missing, and not added.",
    )


def judgement_remarks(judgement: Judgement) -> tuple[str, ...]:
    """What the heights themselves leave in doubt."""
    remarks = []
    if judgement.unseen:
        remarks.append(
            "The measured heights hardly move while the model says that the liquid does: look at "
            "the camera first."
        )
    elif judgement.trust < 1.0:
        remarks.append(
            "The best explanation leaves more than noise: something else is at work, too, or its "
            "equation is not quite what the liquid does."
        )
    return tuple(remarks)
