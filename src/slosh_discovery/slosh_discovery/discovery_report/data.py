"""The result of a discovery for its reader, and the content of `discovery.json`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from slosh_discovery.discover.finding import (
    Agreement,
    Candidate,
    Finding,
    FoundEffect,
    HeightGap,
    MotionFinding,
    Proposal,
    SeparatingMotion,
)
from slosh_discovery.discover.gap import closed_share
from slosh_discovery.discovery_report.words import residual_rms, si_unit, verdict_sentence
from slosh_model.model import Model
from slosh_model.model_text import format_model
from slosh_report.json_values import plain
from slosh_report.page.frame import Frame

SCHEMA = 1

Data = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Command:
    """A command that the user may run next, with its purpose.

    Attributes:
        purpose: what it does, a few words.
        line: the command.
    """

    purpose: str
    line: str


@dataclass(frozen=True, slots=True)
class DiscoveryReport:
    """The result of a discovery, with notes and commands for its reader.

    Attributes:
        finding: what was found.
        subtitle: where the data come from; may be empty.
        notes: how the data were used, a sentence each; shown before the finding's own remarks.
        commands: to type next, in order.
        separating_files: names of the tables of the separating motions, in their order; empty:
            they were not written.
        frames: camera images of the worst moments.
    """

    finding: Finding
    subtitle: str = ""
    notes: tuple[str, ...] = ()
    commands: tuple[Command, ...] = ()
    separating_files: tuple[str, ...] = ()
    frames: tuple[Frame, ...] = ()

    @property
    def remarks(self) -> tuple[str, ...]:
        """Notes and remarks of the discovery, without duplicates."""
        return tuple(dict.fromkeys((*self.notes, *self.finding.remarks)))


def discovery_data(report: DiscoveryReport) -> Data:
    """Returns the content of `discovery.json`: numbers in SI units, None: not known.

    The keys stay as they are within one number of `schema`; further keys may come.
    """
    finding = report.finding
    data: Data = plain(
        {
            "schema": SCHEMA,
            "verdict": finding.verdict,
            "summary": verdict_sentence(finding),
            "confidence": finding.confidence,
            "effects": [_effect(effect) for effect in finding.effects],
            "gap": _gap(finding.gap),
            "where": finding.where,
            "worst": finding.worst,
            "motions": [_motion(motion) for motion in finding.motions],
            "candidates": [_candidate(candidate) for candidate in finding.candidates],
            "separating": [
                _separating(motion, report.separating_files[index:])
                for index, motion in enumerate(finding.separating)
            ],
            "proposal": finding.proposal and _proposal(finding.proposal),
            "remarks": report.remarks,
            "base": _model(finding.base),
            "model": _model(finding.model),
            "group_models": {name: _model(model) for name, model in finding.group_models.items()},
        }
    )
    return data


def _effect(effect: FoundEffect) -> Data:
    """Returns a physical effect as a dictionary, with its parameters' SI units ("1" if none)."""
    sets = [effect.parameters, *(one.parameters for one in effect.by_group.values())]
    units = {name: si_unit(effect.name, name) for one in sets for name in one}
    return {**plain(effect), "units": units}


def _gap(gap: HeightGap) -> Data:
    """Returns rms residuals [m] before and after as a dictionary; null if nothing was held out.

    `closed`: see Gap; the other two are the shares by motions' role.
    """
    return {
        "unit": "m",
        "noise": gap.noise,
        "before": {"fit": gap.fit_before, "holdout": gap.holdout_before},
        "after": {"fit": gap.fit_after, "holdout": gap.holdout_after},
        "closed": gap.closed,
        "fit_closed": gap.fit_closed,
        "holdout_closed": gap.holdout_closed,
    }


def _motion(finding: MotionFinding) -> Data:
    """Returns a motion as a dictionary; `peak` is the highest measured height [m]."""
    motion = finding.motion
    before = residual_rms(finding, finding.before_heights)
    after = residual_rms(finding, finding.after_heights)
    peaks = motion.peak_heights
    return {
        "name": motion.name,
        "group": motion.group,
        "role": finding.role,
        "samples": finding.samples,
        "duration": motion.t[-1] - motion.t[0],
        "peak": max(peaks[np.isfinite(peaks)], default=math.nan),
        "noise": finding.noise,
        "clock_offset": finding.clock_offset,
        "level": finding.level,
        "before": _agreement(finding.before, before),
        "after": _agreement(finding.after, after),
        "closed": closed_share(before, after, finding.noise, finding.samples),
    }


def _agreement(agreement: Agreement, residual: float) -> Data:
    """Returns the agreement of heights as a dictionary; `residual` is over all heights [m]."""
    return {"residual": residual, **plain(agreement)}


def _candidate(candidate: Candidate) -> Data:
    """Returns a candidate model as a dictionary; `applicable` is whether it was fitted."""
    return {
        "effects": candidate.effects,
        "per_group": candidate.per_group,
        "applicable": not candidate.reason,
        "reason": candidate.reason,
        **plain(candidate),
    }


def _separating(motion: SeparatingMotion, files: tuple[str, ...]) -> Data:
    """Returns a separating motion as a dictionary; `file` is its table, or null if not written."""
    return {
        "names": motion.names,
        "description": motion.description,
        "file": files[0] if files else None,
        "duration": motion.inputs.t[-1] - motion.inputs.t[0],
        "difference": motion.difference,
        "present_difference": motion.present_difference,
    }


def _proposal(proposal: Proposal) -> Data:
    names = ("term", "coefficient", "unit")
    return {
        "equation": proposal.equation,
        "terms": [dict(zip(names, term, strict=True)) for term in proposal.terms],
        "explained": proposal.explained,
    }


def _model(model: Model) -> Data:
    """Returns a model's short name and the text of its model.yaml as a dictionary."""
    return {"name": model.name, "text": format_model(model)}
