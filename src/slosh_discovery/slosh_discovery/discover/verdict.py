"""From fitted explanations to a verdict with its confidence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slosh_discovery.discover.evidence import log_evidence, probabilities
from slosh_discovery.discover.finding import Verdict
from slosh_discovery.discover.fitting import Fit
from slosh_discovery.discover.problem import PreparedMotion
from slosh_discovery.discover.search import Pool, adequate, leftover

Array = NDArray[np.float64]

SURE_ENOUGH = 0.8
"""An explanation at least this likely is named; below, it is one of several."""
RIVAL = 0.05
"""An explanation this likely, relative to the best, is worth telling."""
CLOSED = 0.5
"""An explanation that closes less than this share of the removable gap explains nothing."""
NEGLIGIBLE = 0.06
"""An effect that lowers the mean squared residual by less than this share of the noise's,"""
NEGLIGIBLE_SHARE = 0.004
"""or of the removable gap, is not worth a name."""
TRUST = 2.0
"""Where more than noise is left, confidence falls by this times the rest's share in amplitude,"""
LEAST_TRUST = 0.85
"""but not below this times the share of the gap that is closed."""


@dataclass(frozen=True, slots=True, eq=False)
class Judgement:
    """Which explanation is chosen, and how sure that is.

    Attributes:
        verdict: how the discovery ends.
        chosen: the chosen explanation's fit; the base's for NONE and UNEXPLAINED.
        best: the likeliest explanation that is worth its effects, whatever the verdict.
        confidence: of the whole set of effects.
        confidences: of each effect.
        rivals: by effect: what explains the data in its place, the likeliest first.
        ranked: every fit, the likeliest first, with its probability.
        temperature: of the data; see `evidence`.
        trust: probability that the cause is a listed one, from what is left.
    """

    verdict: Verdict
    chosen: Fit
    best: Fit
    confidence: float
    confidences: dict[str, float]
    rivals: dict[str, tuple[str, ...]]
    ranked: tuple[tuple[Fit, float], ...]
    temperature: float
    trust: float


def judge(pool: Pool, motions: Sequence[PreparedMotion]) -> Judgement:
    """Weighs the fitted explanations against each other."""
    heat = pool.temperature
    fits = list(pool.fits.values())
    logs = [-np.inf if _negligible_part(one, pool) else log_evidence(one, heat) for one in fits]
    shares = probabilities(logs)
    order = sorted(range(len(fits)), key=lambda i: (-shares[i], fits[i].chi_square))
    ranked = tuple((fits[i], float(shares[i])) for i in order)
    best, base = ranked[0][0], pool.fits[()]
    trust = _trust(best, base, motions)
    likely = sum(
        share
        for one, share in ranked
        if set(one.explanation.effects) >= set(best.explanation.effects)
    )
    confidence = trust * (likely if best.explanation.effects else ranked[0][1])
    verdict = _verdict(best, base, confidence / max(trust, 1e-12), motions)
    named = verdict in (Verdict.NAMED, Verdict.AMBIGUOUS)
    names = best.explanation.effects if named else ()
    return Judgement(
        verdict=verdict,
        chosen=best if named else base,
        best=best,
        confidence=confidence,
        confidences={
            name: trust * sum(s for one, s in ranked if name in one.explanation.effects)
            for name in names
        },
        rivals={name: _rivals(name, ranked) for name in names},
        ranked=ranked,
        temperature=heat,
        trust=trust,
    )


def _verdict(best: Fit, base: Fit, likely: float, motions: Sequence[PreparedMotion]) -> Verdict:
    if not best.explanation.effects:
        return Verdict.NONE if adequate(base, motions) else Verdict.UNEXPLAINED
    before, after = leftover(base, motions)[0], leftover(best, motions)[0]
    if not adequate(best, motions) and after > (1.0 - CLOSED) * before:
        return Verdict.UNEXPLAINED
    return Verdict.NAMED if likely >= SURE_ENOUGH else Verdict.AMBIGUOUS


def _negligible_part(one: Fit, pool: Pool) -> bool:
    """Whether one of its effects could go and hardly anything would change."""
    base = pool.fits[()]
    count = len(one.residual)
    # What chi² per sample is noise, as far as the best fit tells.
    noise = min(fit.chi_square for fit in pool.fits.values()) / count
    gap = max(base.chi_square / count - noise, 0.0)
    least = max(NEGLIGIBLE * noise, NEGLIGIBLE_SHARE * gap) * count
    for name in one.explanation.effects:
        smaller = pool.fits.get(
            tuple(effect for effect in one.explanation.effects if effect != name)
        )
        if smaller is not None and smaller.chi_square - one.chi_square < least:
            return True
    return False


def _trust(best: Fit, base: Fit, motions: Sequence[PreparedMotion]) -> float:
    """Probability that the cause is a listed one, from the share of the gap that is left."""
    after, stddev = leftover(best, motions)
    before = leftover(base, motions)[0]
    sure_rest = max(after - 2.0 * stddev, 0.0)
    if before <= 0.0 or sure_rest == 0.0 or adequate(best, motions):
        return 1.0
    share = min(sure_rest / before, 1.0)
    return float(max(1.0 - TRUST * np.sqrt(share), LEAST_TRUST * (1.0 - share)))


def _rivals(name: str, ranked: Sequence[tuple[Fit, float]]) -> tuple[str, ...]:
    """Effects that stand in an effect's place in explanations about as likely."""
    best, share = ranked[0]
    others = set(best.explanation.effects) - {name}
    found: list[str] = []
    for one, other_share in ranked[1:]:
        effects = set(one.explanation.effects)
        if other_share >= RIVAL * share and len(effects - others) == 1 and effects >= others:
            (rival,) = effects - others
            if rival != name and rival not in found:
                found.append(rival)
    return tuple(found)
