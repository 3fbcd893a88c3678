"""`discovery.json`: a finding as values that JSON can hold.

Numbers are in SI units; null: not known. The keys stay as they are within one number of `schema`;
further keys may come.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any, TypedDict

import numpy as np

from slosh_discovery.discover.finding import (
    Agreement,
    Candidate,
    Finding,
    FoundEffect,
    MotionFinding,
    SeparatingMotion,
    WhereRow,
    WorstMoment,
)
from slosh_discovery.discovery_report.data import DiscoveryReport
from slosh_discovery.discovery_report.figures import (
    closed_share,
    residual_rms,
    samples,
    si_unit,
)
from slosh_discovery.discovery_report.words import verdict_sentence
from slosh_model.model_text import format_model

SCHEMA = 1

Number = float | None
Numbers = dict[str, Number]


class EffectDocument(TypedDict):
    """A named effect; see FoundEffect. `units`: of each parameter, "1" for none."""

    name: str
    parameters: Numbers
    standard_errors: Numbers
    confidence: Number
    alternatives: list[str]
    refitted: bool
    units: dict[str, str]


class StageDocument(TypedDict):
    """Root mean squares of the residual [m]; `holdout` is null where no motion was held out."""

    fit: Number
    holdout: Number


class GapDocument(TypedDict):
    """The disagreement; see Gap."""

    unit: str
    noise: Number
    before: StageDocument
    after: StageDocument
    closed: Number


class WhereDocument(TypedDict):
    """A part of the data; see WhereRow."""

    by: str
    label: str
    before: Number
    after: Number
    share: Number
    samples: int


class WorstDocument(TypedDict):
    """A moment; see WorstMoment."""

    motion: str
    t: Number
    measured: Number
    before: Number
    after: Number


class AgreementDocument(TypedDict):
    """A model over a motion; `residual` is over all measured heights, the others over the peak's.

    See Agreement.
    """

    residual: Number
    rms: Number
    sigma: Number
    epsilon: Number
    peak: Number


class MotionDocument(TypedDict):
    """A motion; see MotionFinding. `peak`: highest measured height, from its own zero [m]."""

    name: str
    role: str
    samples: int
    duration: Number
    peak: Number
    noise: Number
    clock_offset: Number
    level: Number
    before: AgreementDocument
    after: AgreementDocument
    closed: Number


class CandidateDocument(TypedDict):
    """An explanation that was tried; see Candidate. `applicable`: whether it was fitted."""

    effects: list[str]
    applicable: bool
    reason: str
    parameters: dict[str, Numbers]
    probability: Number
    evidence: Number
    fit_rms: Number
    holdout_rms: Number


class SeparatingDocument(TypedDict):
    """A motion that separates two explanations; `file`: its table beside this document."""

    names: list[str]
    description: str
    file: str | None
    duration: Number
    difference: Number
    present_difference: Number


class TermDocument(TypedDict):
    """A proposed term."""

    term: str
    coefficient: Number
    unit: str


class ProposalDocument(TypedDict):
    """What sparse regression proposes; see Proposal."""

    equation: str
    terms: list[TermDocument]
    explained: Number


class ModelDocument(TypedDict):
    """A model: its short name and the text of its model.yaml."""

    name: str
    text: str


class DiscoveryDocument(TypedDict):
    """The whole of `discovery.json`."""

    schema: int
    verdict: str
    summary: str
    confidence: Number
    effects: list[EffectDocument]
    gap: GapDocument
    where: list[WhereDocument]
    worst: list[WorstDocument]
    motions: list[MotionDocument]
    candidates: list[CandidateDocument]
    separating: list[SeparatingDocument]
    proposal: ProposalDocument | None
    remarks: list[str]
    base: ModelDocument
    model: ModelDocument


def discovery_json(report: DiscoveryReport) -> str:
    """The text of `discovery.json`: strict JSON, the same for the same report."""
    return json.dumps(discovery_document(report), indent=2, allow_nan=False) + "\n"


def discovery_document(report: DiscoveryReport) -> DiscoveryDocument:
    """A report's numbers and names.

    Every number that the page shows in a `<data>` element is in here: the element's `data-path`
    is its JSON pointer (RFC 6901) and its `value` is the number, to the last bit.
    """
    finding = report.finding
    return DiscoveryDocument(
        schema=SCHEMA,
        verdict=finding.verdict.value,
        summary=verdict_sentence(finding),
        confidence=known(finding.confidence),
        effects=[_effect(effect) for effect in finding.effects],
        gap=_gap(finding),
        where=[_where(row) for row in finding.where],
        worst=[_worst(moment) for moment in finding.worst],
        motions=[_motion(motion) for motion in finding.motions],
        candidates=[_candidate(candidate) for candidate in finding.candidates],
        separating=[
            _separating(motion, report.separating_files[index:])
            for index, motion in enumerate(finding.separating)
        ],
        proposal=_proposal(finding),
        remarks=list(report.remarks),
        base=ModelDocument(name=finding.base.name, text=format_model(finding.base)),
        model=ModelDocument(name=finding.model.name, text=format_model(finding.model)),
    )


def known(value: float) -> Number:
    """A number as Python's own; None where it is not finite."""
    number = float(value)
    return number if math.isfinite(number) else None


def _numbers(values: Mapping[str, float]) -> Numbers:
    return {name: known(value) for name, value in values.items()}


def _effect(effect: FoundEffect) -> EffectDocument:
    return EffectDocument(
        name=effect.name,
        parameters=_numbers(effect.parameters),
        standard_errors=_numbers(effect.standard_errors),
        confidence=known(effect.confidence),
        alternatives=list(effect.alternatives),
        refitted=effect.refitted,
        units={name: si_unit(effect.name, name) for name in effect.parameters},
    )


def _gap(finding: Finding) -> GapDocument:
    gap = finding.gap
    return GapDocument(
        unit="m",
        noise=known(gap.noise),
        before=StageDocument(fit=known(gap.fit_before), holdout=known(gap.holdout_before)),
        after=StageDocument(fit=known(gap.fit_after), holdout=known(gap.holdout_after)),
        closed=known(gap.closed),
    )


def _where(row: WhereRow) -> WhereDocument:
    return WhereDocument(
        by=row.by,
        label=row.label,
        before=known(row.before),
        after=known(row.after),
        share=known(row.share),
        samples=int(row.samples),
    )


def _worst(moment: WorstMoment) -> WorstDocument:
    return WorstDocument(
        motion=moment.motion,
        t=known(moment.t),
        measured=known(moment.measured),
        before=known(moment.before),
        after=known(moment.after),
    )


def _motion(finding: MotionFinding) -> MotionDocument:
    motion, count = finding.motion, samples(finding)
    before = residual_rms(finding, finding.before_heights)
    after = residual_rms(finding, finding.after_heights)
    peaks = motion.peak_heights
    return MotionDocument(
        name=motion.name,
        role=finding.role.value,
        samples=count,
        duration=known(motion.t[-1] - motion.t[0]),
        peak=known(max(peaks[np.isfinite(peaks)], default=math.nan)),
        noise=known(finding.noise),
        clock_offset=known(finding.clock_offset),
        level=known(finding.level),
        before=_agreement(finding.before, before),
        after=_agreement(finding.after, after),
        closed=known(closed_share(before, after, finding.noise, count)),
    )


def _agreement(agreement: Agreement, residual: float) -> AgreementDocument:
    return AgreementDocument(
        residual=known(residual),
        rms=known(agreement.rms),
        sigma=known(agreement.sigma),
        epsilon=known(agreement.epsilon),
        peak=known(agreement.peak),
    )


def _candidate(candidate: Candidate) -> CandidateDocument:
    return CandidateDocument(
        effects=list(candidate.effects),
        applicable=not candidate.reason,
        reason=candidate.reason,
        parameters={name: _numbers(values) for name, values in candidate.parameters.items()},
        probability=known(candidate.probability),
        evidence=known(candidate.evidence),
        fit_rms=known(candidate.fit_rms),
        holdout_rms=known(candidate.holdout_rms),
    )


def _separating(motion: SeparatingMotion, files: tuple[str, ...]) -> SeparatingDocument:
    return SeparatingDocument(
        names=list(motion.names),
        description=motion.description,
        file=files[0] if files else None,
        duration=known(motion.inputs.t[-1] - motion.inputs.t[0]),
        difference=known(motion.difference),
        present_difference=known(motion.present_difference),
    )


def _proposal(finding: Finding) -> ProposalDocument | None:
    proposal = finding.proposal
    if proposal is None:
        return None
    terms: list[Any] = [
        TermDocument(term=term, coefficient=known(value), unit=unit)
        for term, value, unit in proposal.terms
    ]
    return ProposalDocument(
        equation=proposal.equation, terms=terms, explained=known(proposal.explained)
    )
