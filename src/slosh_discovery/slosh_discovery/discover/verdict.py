"""Derives the result of a discovery and its confidence from the fitted candidate models."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from slosh_base.types import Array
from slosh_discovery.discover.crosscheck import HeldOut, held_out
from slosh_discovery.discover.evidence import (
    discounted,
    log_evidence,
    log_prior,
    parts_of,
    probabilities,
)
from slosh_discovery.discover.explanation import Explanation, Key
from slosh_discovery.discover.finding import Verdict
from slosh_discovery.discover.fitting import Fit
from slosh_discovery.discover.noise import removable
from slosh_discovery.discover.problem import PreparedMotion, claimed_noise, simulate_all
from slosh_discovery.discover.search import Leftover, Pool, leftover
from slosh_discovery.discover.steadiness import Change, change_with_time
from slosh_discovery.discover.tuning import TUNING

EFFECT = "frequency_mismatch"
FACTORS = np.geomspace(0.5, 2.0, 49)
"""Of the model's frequencies that are tried."""
FAR = 1.2
"""Fill, tension and walls shift a frequency by less than this factor."""
NEAR = 1.1
"""About the model's frequency the heights are compared with within this factor."""
ALIKE = 0.5
"""Share of the heights' power that a wave at the right frequency explains."""
CLEARLY = 0.5
"""What it leaves is at most this share of what the best one near the model's frequency does."""


@dataclass(frozen=True, slots=True, eq=False)
class ChosenExplanation:
    """The chosen candidate model and its probability.

    Attributes:
        verdict: how the discovery ends.
        chosen: the chosen explanation's fit; the base's where nothing is added.
        confidence: of the whole set of effects.
        confidences: of each effect.
        rivals: by effect: what explains the data in its place, the likeliest first.
        ranked: every fit, the likeliest first, with its probability.
        held_out: by explanation: how well explanations predict motions left out of their fit.
        temperature: of the data; see `evidence`.
        trust: probability that the cause is a listed one, from what is left.
        unseen: whether the measured heights hardly move while the base says that the liquid does.
        elsewhere: another frequency at which the liquid swings: another container's.
        hidden: whether the best explanation's gain is less than the sensor claims of its noise.
        change: how the best explanation would have to change with time; it is none, then.
    """

    verdict: Verdict
    chosen: Fit
    confidence: float
    confidences: Mapping[str, float]
    rivals: Mapping[str, tuple[str, ...]]
    ranked: tuple[tuple[Fit, float], ...]
    held_out: Mapping[Key, HeldOut]
    temperature: float
    trust: float
    unseen: bool
    hidden: bool = False
    elsewhere: OtherFrequency | None = None
    change: Change | None = None


def judge(pool: Pool, motions: Sequence[PreparedMotion]) -> ChosenExplanation:
    """Compares the fitted candidate models and chooses one.

    Where the likeliest leaves nothing but noise, the evidence decides. Where even that leaves
    more, every explanation is wrong, and better ones than others are those that predict motions
    which they were not fitted to.
    """
    temperature, base = pool.temperature, pool.base
    unseen, before = _unseen(base, motions), leftover(base, motions)
    # What sensor and inputs explain needs no other cause, whatever a fit gains.
    worthy = (
        [base]
        if unseen or before.adequate
        else _worthy(pool.ranked(), pool, TUNING.negligible_share)
    )
    logs = {one.explanation.key: log_evidence(one, temperature) for one in worthy}
    tabled: dict[Key, HeldOut] = {}
    if not leftover(worthy[0], motions).adequate:
        likeliest = _worthy(worthy, pool, TUNING.cosmetic_share)
        contenders = _worthy(_contenders(likeliest, pool), pool, TUNING.cosmetic_share)
        tabled = {one.explanation.key: held_out(one, motions) for one in contenders}
        logs = {
            one.explanation.key: -0.5 * tabled[one.explanation.key].chi_square / temperature
            + log_prior(one)
            for one in contenders
        }
    else:
        logs = discounted(logs, pool.fits, temperature)
    ranked = _ranked(pool, logs)
    best = ranked[0][0]
    hidden = _hidden(base, best, motions)
    after = leftover(best, motions)
    trust = trust_in(before, after)
    effects = set(best.explanation.effects)
    likely = sum(share for one, share in ranked if effects <= set(one.explanation.effects))
    likely = likely if effects else ranked[0][1]
    elsewhere = None if unseen or after.adequate else other_frequency(base, motions)
    change = change_with_time(pool, motions, temperature) if effects else None
    verdict, added = (
        _verdict(likely, before, after)
        if effects and not hidden and elsewhere is None and change is None
        else (_without_effects(before), False)
    )
    names = best.explanation.effects if added else ()
    return ChosenExplanation(
        verdict=verdict,
        chosen=best if added else base,
        confidence=trust * likely,
        confidences={
            name: trust * sum(s for one, s in ranked if name in one.explanation.effects)
            for name in names
        },
        rivals={name: _rivals(name, ranked) for name in names},
        ranked=ranked,
        held_out=tabled,
        temperature=temperature,
        trust=trust,
        unseen=unseen,
        hidden=hidden,
        elsewhere=elsewhere,
        change=change,
    )


def rejected(judgement: ChosenExplanation, base: Fit) -> ChosenExplanation:
    """Returns the judgement after the chosen model was rejected: unexplained, no effect added."""
    return replace(judgement, verdict=Verdict.UNEXPLAINED, chosen=base, confidences={}, rivals={})


def _contenders(worthy: Sequence[Fit], pool: Pool) -> list[Fit]:
    """Returns the best candidate models, with all subsets of their effects and the base model."""
    chosen: dict[Key, Fit] = {pool.base.explanation.key: pool.base}
    for one in worthy[: TUNING.contenders]:
        effects = one.explanation.effects
        for size in range(1, len(effects) + 1):
            for names in itertools.combinations(effects, size):
                part = one.explanation.only(names)
                for known in map(pool.find, (part, *map(part.shared, part.per_group))):
                    if known is not None:
                        chosen[known.explanation.key] = known
    return list(chosen.values())


def _ranked(pool: Pool, logs: Mapping[Key, float]) -> tuple[tuple[Fit, float], ...]:
    shares = dict(zip(logs, probabilities(list(logs.values())).tolist(), strict=True))
    pairs = [(one, shares.get(key, 0.0)) for key, one in pool.fits.items()]
    return tuple(sorted(pairs, key=lambda pair: (-pair[1], pair[0].chi_square)))


def _without_effects(before: Leftover) -> Verdict:
    """Returns the verdict if no candidate model is better than the base model."""
    return Verdict.NONE if before.adequate else Verdict.UNEXPLAINED


def _verdict(likely: float, before: Leftover, after: Leftover) -> tuple[Verdict, bool]:
    """Returns the verdict, and whether the best effects are added to the model."""
    if not after.adequate:
        closed = 1.0 - after.mean_square / before.mean_square
        if closed < TUNING.closed:
            return Verdict.UNEXPLAINED, closed >= TUNING.partly
    return (Verdict.NAMED if likely >= TUNING.sure_enough else Verdict.AMBIGUOUS), True


def _worthy(fits: Sequence[Fit], pool: Pool, share: float) -> list[Fit]:
    """Returns the fits in which every effect removes more than a minimum fraction of the error.

    Nor could any be the same for all groups where it is fitted for each.
    """
    count = len(pool.base.residual)
    # What chi² per sample is noise, as far as the best fit tells.
    noise = min(one.chi_square for one in pool.fits.values()) / count
    gap = max(pool.base.chi_square / count - noise, 0.0)
    least = max(TUNING.negligible * noise, share * gap) * count

    def comes_back(one: Fit, simpler: Explanation) -> float:
        known = pool.find(simpler)
        return np.inf if known is None else known.chi_square - one.chi_square

    return [
        one
        for one in fits
        if all(comes_back(one, simpler) >= least for simpler in one.explanation.simpler())
    ]


def _unseen(base: Fit, motions: Sequence[PreparedMotion]) -> bool:
    """Returns whether the measured heights hardly move although the base model predicts motion.

    A flat line is what many an effect can make of any wave, and none is the reason.
    """
    seen, expected = 0.0, 0.0
    for motion, residual in zip(motions, parts_of(base.residual, motions), strict=True):
        samples = int(motion.kept.sum())
        heights = np.where(motion.kept, motion.heights, np.nan)
        found = removable(motion.t, _without_mean(heights))
        seen += samples * (found.mean_square - 2.0 * found.mean_square_stddev)
        predicted = _without_mean(heights - motion.laid(motion.in_metres(residual)))
        expected += float(np.nansum(predicted**2))
    return seen < TUNING.unseen**2 * expected


def _hidden(base: Fit, best: Fit, motions: Sequence[PreparedMotion]) -> bool:
    """Returns whether a fit's improvement is below the noise that the sensor states."""
    gained, claimed = 0.0, 0.0
    parts = (parts_of(one.residual, motions) for one in (base, best))
    for motion, before, after in zip(motions, *parts, strict=True):
        squares = [np.sum(motion.in_metres(part) ** 2) for part in (before, after)]
        gained += float(squares[0] - squares[1])
        claimed += len(before) * claimed_noise(motion.motion) ** 2
    return best is not base and gained < claimed


def _without_mean(heights: Array) -> Array:
    centred: Array = heights - np.nanmean(heights, axis=0)
    return centred


def trust_in(before: Leftover, after: Leftover) -> float:
    """Returns the probability that a listed effect is the cause, given the remaining error.

    Also where what is left is little beside the noise: of a small gap it may be a large part, and
    a law that is nearly the right one leaves no more.
    """
    sure_rest = max(after.mean_square - 2.0 * after.stddev, 0.0)
    if before.adequate or sure_rest == 0.0:
        return 1.0
    share = min(sure_rest / before.mean_square, 1.0)
    return float(max(1.0 - TUNING.trust * np.sqrt(share), TUNING.least_trust * (1.0 - share)))


def _rivals(name: str, ranked: Sequence[tuple[Fit, float]]) -> tuple[str, ...]:
    """Returns the effects that could replace a found effect with about the same probability."""
    best, share = ranked[0]
    others = set(best.explanation.effects) - {name}
    found: list[str] = []
    for one, other_share in ranked[1:]:
        effects = set(one.explanation.effects)
        if (
            other_share >= TUNING.rival * share
            and len(effects - others) == 1
            and effects >= others
        ):
            (rival,) = effects - others
            if rival != name and rival not in found:
                found.append(rival)
    return tuple(found)


@dataclass(frozen=True, slots=True)
class OtherFrequency:
    """A sloshing frequency in the data that differs from the model's.

    Attributes:
        expected: the model's first natural frequency [Hz].
        seen: that of the heights [Hz].
    """

    expected: float
    seen: float

    def text(self) -> str:
        """Asks the user, in one sentence, whether the model describes the right container."""
        apart = 100.0 * (self.seen / self.expected - 1.0)
        return (
            f"Is this the right container? The liquid oscillates at {self.seen:.2f} Hz, the "
            f"model at {self.expected:.2f} Hz ({apart:+.0f} %): compare shape, size and fill "
            "height with the model, and the unit of time with the data; then run this again."
        )


def other_frequency(base: Fit, motions: Sequence[PreparedMotion]) -> OtherFrequency | None:
    """Returns a frequency of the heights that clearly differs from the model's; None if none does.

    A model of another container is wrong in everything at once, and a few effects can make
    something of any wave: the container is asked for before effects are named.

    Args:
        base: the model as it is, with the motions' clock offsets.
        motions: the data.
    """
    model = base.model
    if model.has(EFFECT):
        return None
    left = np.array([_unlike(base, motions, float(factor)) for factor in FACTORS])
    best = int(np.argmin(left))
    near = np.abs(np.log(FACTORS)) <= math.log(NEAR)
    far = abs(math.log(FACTORS[best])) > math.log(FAR)
    if not far or left[best] > min(1.0 - ALIKE, CLEARLY * float(left[near].min())):
        return None
    first = model.mode_constants()[0].natural_frequency / (2.0 * math.pi)
    return OtherFrequency(first, first * float(FACTORS[best]))


def _unlike(base: Fit, motions: Sequence[PreparedMotion], factor: float) -> float:
    """Returns the fraction of the heights' power that a scaled natural frequency leaves over."""
    models = [
        base.model_of(one.motion.group).with_effect(EFFECT, factor=factor) for one in motions
    ]
    answers = simulate_all(list(zip(models, motions, strict=True)))
    left, power = 0.0, 0.0
    for one, answer, offset in zip(motions, answers, base.clock_offsets, strict=True):
        heights = one.heights[one.kept]
        heights = heights if one.motion.level_known else heights - heights.mean()
        power += float(heights @ heights)
        left += float(heights @ heights)
        if answer is None:
            continue
        wave = answer.at(one.t, offset)[one.kept]
        wave = wave if one.motion.level_known else wave - wave.mean()
        size = float(wave @ wave)
        left -= max(float(wave @ heights), 0.0) ** 2 / size if size > 0.0 else 0.0
    return left / power if power > 0.0 else 1.0
