"""The result of an identification for its reader, and `identification.json`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from slosh_discovery.identify.result import (
    FittedMotion,
    FoundParameter,
    Identification,
    IdentifiedModel,
    PointAgreement,
)
from slosh_model.model import Model
from slosh_model.model_text import format_model
from slosh_report.json_values import plain

SCHEMA = 1

Data = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Beside:
    """Result of an earlier identification, which is shown beside the new one.

    Attributes:
        name: for people; its folder.
        model: its model.
        frequency, damping: of the first mode, with standard errors [rad/s, 1].
    """

    name: str
    model: Model
    frequency: tuple[float, float]
    damping: tuple[float, float]


@dataclass(frozen=True, slots=True)
class IdentificationReport:
    """An identification, with notes and earlier results for its reader.

    Attributes:
        found: what was found.
        subtitle: where the data come from; may be empty.
        notes: how the data were read, a sentence each.
        beside: earlier identifications that are shown with it.
        model_files: names of the models of the operating points, in their order; empty: none.
        help_files: names of the tables of motions that would tell of the parameters held, by
            parameter.
    """

    found: Identification
    subtitle: str = ""
    notes: tuple[str, ...] = ()
    beside: tuple[Beside, ...] = ()
    model_files: tuple[str, ...] = ()
    help_files: tuple[tuple[str, str], ...] = ()

    @property
    def remarks(self) -> tuple[str, ...]:
        """Notes and remarks of the identification, without duplicates."""
        return tuple(dict.fromkeys((*self.notes, *self.found.remarks)))


def first_mode(result: IdentifiedModel, name: str) -> FoundParameter:
    """Returns the first mode's frequency or damping ratio, fitted or derived."""
    entries = (*result.parameters, *result.derived)
    return next(entry for entry in entries if entry.name == name)


def identification_data(report: IdentificationReport) -> Data:
    """Returns the content of `identification.json`: numbers in SI units, None: not known.

    The keys stay as they are within one number of `schema`; further keys may come.
    """
    found = report.found
    files: tuple[str | None, ...] = report.model_files or (None,) * len(found.single)
    data: Data = plain(
        {
            "schema": SCHEMA,
            "strategy": found.strategy,
            "overall": _identified(found.overall, report, "model.yaml"),
            "single": [
                _identified(one, report, file)
                for one, file in zip(found.single, files, strict=True)
            ],
            "points": [_point(point) for point in found.points],
            "motions": [_motion(motion) for motion in found.motions],
            "line": found.line,
            "dwell": found.dwell,
            "beside": [_beside(entry) for entry in report.beside],
            "remarks": report.remarks,
            "base": _model(found.base),
        }
    )
    return data


def _identified(one: IdentifiedModel, report: IdentificationReport, file: str | None) -> Data:
    tables = dict(report.help_files)
    return {
        "label": one.label,
        "speed": one.speed,
        "parameters": one.parameters,
        "derived": one.derived,
        "correlations": one.correlations.tolist(),
        "held": [
            {
                "name": held.name,
                "with_others": held.with_others,
                "error": held.error,
                "help": held.help,
                "helped": held.helped,
                "file": tables.get(held.name),
            }
            for held in one.held
        ],
        "noise": one.noise,
        "outliers": one.outliers,
        "scatter": one.scatter,
        "seoe": one.seoe,
        "model": _model(one.model),
        "file": file,
    }


def _point(point: PointAgreement) -> Data:
    return {
        "label": point.point.label,
        "speed": point.point.speed,
        "repetitions": point.repetitions,
        "before": point.before,
        "sosm": point.sosm,
        "mosm": point.mosm,
    }


def _motion(motion: FittedMotion) -> Data:
    peaks = motion.measured[np.isfinite(motion.measured)]
    return {
        "name": motion.name,
        "point": motion.point,
        "role": motion.role,
        "free_decay": motion.free_decay,
        "samples": int(np.isfinite(motion.measured).sum()),
        "peak": float(peaks.max()),
        "clock_offset": motion.clock_offset,
        "seoe_before": motion.seoe_before,
        "seoe": motion.seoe,
        "sigma": motion.sigma,
        "epsilon": motion.epsilon,
    }


def _beside(entry: Beside) -> Data:
    return {
        "name": entry.name,
        "frequency": entry.frequency,
        "damping": entry.damping,
        "model": _model(entry.model),
    }


def _model(model: Model) -> Data:
    """Returns a model's short name and the text of its model.yaml as a dictionary."""
    return {"name": model.name, "text": format_model(model)}
