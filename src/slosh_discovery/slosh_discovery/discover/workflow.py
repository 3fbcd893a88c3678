"""Runs a discovery from measured motions and a model to its result."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from slosh_base.types import Array
from slosh_discovery.discover.campaigns import find_campaigns, in_groups
from slosh_discovery.discover.clock import first_offset
from slosh_discovery.discover.crosscheck import held_out
from slosh_discovery.discover.evidence import log_evidence, parts_of, standard_errors
from slosh_discovery.discover.explanation import Explanation
from slosh_discovery.discover.finding import (
    Agreement,
    Candidate,
    Finding,
    FittedParameters,
    FoundEffect,
    HeightGap,
    MotionFinding,
    Proposal,
    Role,
    SeparatingMotion,
    Verdict,
)
from slosh_discovery.discover.fitting import Fit, fit
from slosh_discovery.discover.gap import is_worse, total_gap
from slosh_discovery.discover.motion import MeasuredMotion
from slosh_discovery.discover.problem import PreparedMotion, prepare
from slosh_discovery.discover.propose import propose
from slosh_discovery.discover.rounds import Searched, search_in_rounds, with_noise
from slosh_discovery.discover.search import Progress, leftover
from slosh_discovery.discover.separate import separating_motion
from slosh_discovery.discover.tuning import TUNING
from slosh_discovery.discover.verdict import ChosenExplanation, judge, rejected
from slosh_discovery.discover.where import where, worst_moments
from slosh_discovery.errors import SloshDiscoveryError
from slosh_discovery.sound_inputs import sound, sound_fit
from slosh_model.errors import SloshModelError
from slosh_model.measure import predicted_heights
from slosh_model.model import Model
from slosh_motion.signals.metrics import mean_absolute_error, peak_error, rms_error


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


NAN = float("nan")

NO_AGREEMENT = Agreement(rms=math.inf, sigma=NAN, epsilon=NAN, peak=NAN)
"""Of a model that has no finite answer."""


def discover(
    motions: Sequence[MeasuredMotion],
    base: Model,
    holdout: Sequence[MeasuredMotion] = (),
    *,
    progress: Progress | None = None,
    threads: int | None = None,
) -> Finding:
    """Finds which physical effect a model lacks to explain measured motions.

    Args:
        motions: what the fit sees.
        base: the model that disagrees.
        holdout: motions that the fit does not see; they show by how much the gap shrinks.
        progress: told what is done and the share of it in [0, 1].
        threads: fits at a time; None: one per core.

    Raises:
        SloshDiscoveryError, SloshReportError: no motions, none with a sound input, or one with
            which nothing can be done, as where the base has no finite solution;
            groups that some motions have and others have not.
    """
    if not motions:
        raise SloshDiscoveryError("no motion with measured heights: nothing to discover from")
    motions, faulty = sound_fit(motions)
    holdout, faulty_holdout = sound(holdout)
    _check_groups(motions, holdout)
    told = progress or (lambda text, share: None)
    told("preparing", 0.0)
    plain = [prepare(motion, motions) for motion in motions]
    _check_answers(base, plain)
    searched, judgement = _judged(base, plain, told, threads or os.cpu_count() or 1)
    prepared = searched.motions
    told("checking on motions left out", 0.95)
    grouped_here = prepared[0].motion.group is not None and motions[0].group is None
    if grouped_here:
        holdout = [_placed(motion, judgement.chosen, base) for motion in holdout]
    cases = _cases(searched, holdout, base, judgement)
    gap, remarks = total_gap(cases), campaign_remarks(cases) if grouped_here else ()
    if is_worse(gap):
        remarks += rejection_remarks(judgement, gap)
        judgement = rejected(judgement, searched.pool.base)
        cases = _cases(searched, holdout, base, judgement)
        gap = total_gap(cases)
    answered = [case for case in cases if math.isfinite(case.before.rms + case.after.rms)]
    candidates = _candidates(judgement, prepared, searched.pool.without_effect)
    told("what to do next", 0.97)
    separating, proposed = separating_motions(judgement, prepared), proposal(judgement, prepared)
    told("done", 1.0)
    return Finding(
        verdict=judgement.verdict,
        base=base,
        model=judgement.chosen.model,
        effects=_effects(judgement, base),
        confidence=judgement.confidence,
        gap=gap,
        motions=cases,
        where=where(answered, base) if answered else (),
        worst=worst_moments(answered),
        candidates=candidates,
        separating=separating,
        proposal=proposed,
        remarks=faulty
        + faulty_holdout
        + remarks
        + answer_remarks(cases)
        + judgement_remarks(judgement),
        group_models=_group_models(judgement.chosen),
    )


def _check_groups(motions: Sequence[MeasuredMotion], holdout: Sequence[MeasuredMotion]) -> None:
    """Raises an error if a held-out motion belongs to a group without fitted motions."""
    known = {motion.group for motion in motions}
    for motion in (*motions, *holdout):
        if motion.group is None and known != {None}:
            raise SloshDiscoveryError(f"{motion.name}: belongs to no group, but others do")
        if motion.group not in known:
            raise SloshDiscoveryError(
                f"{motion.name}: no motion of its group {motion.group} is in the fit"
            )


def _check_answers(base: Model, motions: Sequence[PreparedMotion]) -> None:
    """Raises an error if the base model has no solution for a fitted motion."""
    for one in motions:
        if one.simulate(base) is None:
            raise SloshDiscoveryError(unanswered(one.motion) + ", or leave the motion out")


def _judged(
    base: Model, plain: Sequence[PreparedMotion], told: Progress, threads: int
) -> tuple[Searched, ChosenExplanation]:
    """Searches for physical effects and judges them, again after motions have been grouped."""
    searched = search_in_rounds(base, plain, told, threads)
    best = searched.pool.ranked()[0]
    ungrouped = all(one.motion.group is None for one in plain)
    if ungrouped and not leftover(best, searched.motions).adequate:
        campaigns = find_campaigns(best, searched.motions, searched.pool.temperature)
        if campaigns is not None:
            told("motions of different campaigns", 0.0)
            again = search_in_rounds(base, in_groups(plain, campaigns), told, threads)
            judgement = judge(again.pool, again.motions)
            if judgement.chosen.explanation.per_group:
                return again, judgement
    return searched, judge(searched.pool, searched.motions)


def _placed(motion: MeasuredMotion, chosen: Fit, base: Model) -> MeasuredMotion:
    """Assigns a held-out motion to the group whose model fits it best."""
    one = prepare(motion)
    start = first_offset(one, base)
    group = min(
        chosen.explanation.groups,
        key=lambda name: _answer(one, chosen.model_of(name), start).agreement.rms,
    )
    return replace(motion, group=group)


@dataclass(frozen=True, slots=True, eq=False)
class _Answer:
    """A model's response to a motion, with the estimated clock offset and still level."""

    heights: Array
    clock_offset: float
    level: float
    agreement: Agreement


def _cases(
    searched: Searched,
    holdout: Sequence[MeasuredMotion],
    base: Model,
    judgement: ChosenExplanation,
) -> tuple[MotionFinding, ...]:
    motions = [one.motion for one in searched.motions]
    known = dict(zip(map(id, motions), searched.motions, strict=True))
    starts = dict(zip(map(id, motions), judgement.chosen.clock_offsets, strict=True))
    roles = [(motion, Role.FIT) for motion in motions]
    roles += [(motion, Role.HOLDOUT) for motion in holdout]
    cases = []
    for motion, role in roles:
        one = known.get(id(motion)) or prepare(motion, [*motions, *holdout])
        start = starts.get(id(motion))
        start = first_offset(one, base) if start is None else start
        models = base, judgement.chosen.model_of(motion.group)
        if role is Role.HOLDOUT:
            one = with_noise(one, models[1], start, searched.sensor)
        before, after = (_answer(one, model, start) for model in models)
        cases.append(
            MotionFinding(
                motion=motion,
                role=role,
                noise=math.hypot(one.noise, one.driven_rms),
                clock_offset=after.clock_offset,
                level=after.level,
                before_heights=before.heights,
                after_heights=after.heights,
                before=before.agreement,
                after=after.agreement,
            )
        )
    return tuple(cases)


def _answer(one: PreparedMotion, model: Model, start: float) -> _Answer:
    """Computes a model's response; estimates clock offset and still level if unknown."""
    motion = one.motion
    offset = start
    if not motion.same_clock:
        offset = fit(Explanation(model), [one], np.zeros(0), [start]).clock_offsets[0]
    azimuths = motion.eta_azimuth if motion.eta is not None else None
    try:
        heights = predicted_heights(model, motion.inputs, motion.t - offset, azimuths)
    except SloshModelError:  # it left the finite numbers
        return _Answer(np.full_like(motion.heights, NAN), offset, 0.0, NO_AGREEMENT)
    difference = motion.heights - heights
    level = 0.0 if motion.level_known else float(np.nanmean(difference))
    heights = heights + level
    measured = motion.peak_heights
    answered = np.where(np.isfinite(motion.heights), heights, -np.inf).max(axis=1)
    answered = np.where(np.isfinite(measured), answered, np.nan)
    agreement = Agreement(
        rms=rms_error(motion.heights.ravel(), heights.ravel()),
        sigma=mean_absolute_error(measured, answered),
        epsilon=peak_error(measured - level, answered - level),
        peak=float(np.nanmax(answered)),
    )
    return _Answer(heights, offset, level, agreement)


def _effects(judgement: ChosenExplanation, base: Model) -> tuple[FoundEffect, ...]:
    chosen = judgement.chosen
    errors = standard_errors(chosen, judgement.temperature)
    explanation = chosen.explanation
    fitted = {}
    for name in explanation.effects:
        apart = explanation.groups if name in explanation.per_group else ()
        by_group = {group: _fitted(chosen, errors, name, group) for group in apart}
        shared = FittedParameters({}, {}) if apart else _fitted(chosen, errors, name, None)
        fitted[name] = shared, by_group
    return tuple(
        FoundEffect(
            name=name,
            parameters=shared.parameters,
            standard_errors=shared.standard_errors,
            confidence=judgement.confidences[name],
            alternatives=judgement.rivals[name],
            refitted=base.has(name),
            by_group=by_group,
        )
        for name, (shared, by_group) in fitted.items()
    )


def _fitted(chosen: Fit, errors: Array, name: str, group: str | None) -> FittedParameters:
    """Returns an effect's parameters and standard errors, for one group of motions or for all."""
    explanation = chosen.explanation
    return FittedParameters(
        explanation.part(chosen.vector, name, group),
        {
            free.parameter.name: float(error)
            for free, error in zip(explanation.free, errors, strict=True)
            if free.effect.name == name and free.group in (None, group)
        },
    )


def _group_models(chosen: Fit) -> dict[str, Model]:
    """Returns the model of each group, or an empty dictionary if the groups do not differ."""
    explanation = chosen.explanation
    if not explanation.per_group:
        return {}
    return {group: chosen.model_of(group) for group in explanation.groups}


def _candidates(
    judgement: ChosenExplanation, motions: Sequence[PreparedMotion], reasons: dict[str, str]
) -> tuple[Candidate, ...]:
    base = next(one for one, _ in judgement.ranked if not one.explanation.effects)
    zero = log_evidence(base, judgement.temperature)
    listed = []
    for rank, (one, share) in enumerate(judgement.ranked):
        explanation = one.explanation
        known = judgement.held_out.get(explanation.key)
        if known is None and (rank < TUNING.tabled or not explanation.effects):
            known = held_out(one, motions)
        listed.append(
            Candidate(
                effects=explanation.effects,
                parameters={
                    name: explanation.part(one.vector, name)
                    for name in explanation.effects
                    if name not in explanation.per_group
                },
                by_group={
                    group: {
                        name: explanation.part(one.vector, name, group)
                        for name in explanation.per_group
                    }
                    for group in (explanation.groups if explanation.per_group else ())
                },
                probability=share,
                evidence=log_evidence(one, judgement.temperature) - zero,
                fit_rms=_rms(one, motions),
                holdout_rms=NAN if known is None else known.rms,
            )
        )
    missing = [Candidate(effects=(name,), reason=reason) for name, reason in reasons.items()]
    return (*listed, *missing)


def _rms(one: Fit, motions: Sequence[PreparedMotion]) -> float:
    parts = zip(motions, parts_of(one.residual, motions), strict=True)
    metres = np.concatenate([motion.in_metres(part) for motion, part in parts])
    return float(np.sqrt(np.mean(metres**2)))


def separating_motions(
    judgement: ChosenExplanation, motions: Sequence[PreparedMotion]
) -> tuple[SeparatingMotion, ...]:
    """Returns motions that distinguish the best candidate models if the verdict is ambiguous."""
    if judgement.verdict is not Verdict.AMBIGUOUS:
        return ()
    best, share = judgement.ranked[0]
    rivals = [one for one, other in judgement.ranked[1:] if other >= TUNING.rival * share]
    azimuths = motions[0].azimuths
    found = []
    for rival in rivals[: TUNING.most_rivals]:
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


def proposal(judgement: ChosenExplanation, motions: Sequence[PreparedMotion]) -> Proposal | None:
    """Proposes a generic equation term for an unexplained error; None if it is explained."""
    if judgement.verdict is not Verdict.UNEXPLAINED or judgement.elsewhere is not None:
        return None
    return propose(
        [one.motion for one in motions],
        judgement.chosen.model,
        clock_offsets=judgement.chosen.clock_offsets,
    )


def _name(one: Fit) -> str:
    return " + ".join(one.explanation.effects) or "the model as it is"
