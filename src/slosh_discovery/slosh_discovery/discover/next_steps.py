"""What to do next: a motion that separates rivals, or a term that the list of effects lacks."""

from __future__ import annotations

from collections.abc import Sequence

from slosh_discovery.discover.finding import Proposal, SeparatingMotion, Verdict
from slosh_discovery.discover.fitting import Fit
from slosh_discovery.discover.problem import PreparedMotion
from slosh_discovery.discover.propose import propose
from slosh_discovery.discover.separate import separating_motion
from slosh_discovery.discover.verdict import RIVAL, Judgement
from slosh_discovery.errors import SloshDiscoveryError
from slosh_model.errors import SloshModelError

MOST_RIVALS = 2


def separating_motions(
    judgement: Judgement, motions: Sequence[PreparedMotion]
) -> tuple[SeparatingMotion, ...]:
    """For an ambiguous verdict: what would tell the best explanation from each rival."""
    if judgement.verdict is not Verdict.AMBIGUOUS:
        return ()
    best, share = judgement.ranked[0]
    rivals = [one for one, other in judgement.ranked[1:] if other >= RIVAL * share]
    azimuths = motions[0].azimuths
    found = []
    for rival in rivals[:MOST_RIVALS]:
        first, second = best.model, rival.model
        try:
            motion = separating_motion(
                first,
                second,
                [one.motion.inputs for one in motions],
                first.limits.acceleration,
                names=(_name(best), _name(rival)),
                azimuths=None if azimuths is None else azimuths.tolist(),
            )
        except (SloshDiscoveryError, SloshModelError):
            continue  # no motion within the limits tells them apart
        found.append(motion)
    return tuple(found)


def proposal(judgement: Judgement, motions: Sequence[PreparedMotion]) -> Proposal | None:
    """For an unexplained gap: a generic term, on top of the best of the listed effects."""
    if judgement.verdict is not Verdict.UNEXPLAINED or judgement.elsewhere is not None:
        return None
    return propose(
        [one.motion for one in motions],
        judgement.chosen.model,
        clock_offsets=judgement.chosen.clock_offsets,
    )


def _name(one: Fit) -> str:
    return " + ".join(one.explanation.effects) or "the model as it is"
