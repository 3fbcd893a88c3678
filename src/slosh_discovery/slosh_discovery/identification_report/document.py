"""`identification.json`: an identification as values that JSON can hold.

Numbers are in SI units, null: not known. The keys stay as they are within one number of `schema`;
further keys may come.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from slosh_discovery.identification_report.data import Beside, IdentificationReport
from slosh_discovery.identify.result import FittedMotion, IdentifiedModel, PointAgreement
from slosh_model.model import Model
from slosh_model.model_text import format_model
from slosh_report.json_values import plain

SCHEMA = 1

Document = dict[str, Any]


def identification_json(report: IdentificationReport) -> str:
    """The text of `identification.json`: strict JSON, the same for the same report."""
    return json.dumps(identification_document(report), indent=2, allow_nan=False) + "\n"


def identification_document(report: IdentificationReport) -> Document:
    """A report's numbers and names; `json.dumps` takes it as it is.

    Every number that the page shows in a `<data>` element is in here: the element's `data-path`
    is its JSON pointer (RFC 6901) and its `value` is the number, to the last bit.
    """
    found = report.found
    files: tuple[str | None, ...] = report.model_files or (None,) * len(found.single)
    document: Document = plain(
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
    return document


def _identified(one: IdentifiedModel, report: IdentificationReport, file: str | None) -> Document:
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


def _point(point: PointAgreement) -> Document:
    return {
        "label": point.point.label,
        "speed": point.point.speed,
        "repetitions": point.repetitions,
        "before": point.before,
        "sosm": point.sosm,
        "mosm": point.mosm,
    }


def _motion(motion: FittedMotion) -> Document:
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


def _beside(entry: Beside) -> Document:
    return {
        "name": entry.name,
        "frequency": entry.frequency,
        "damping": entry.damping,
        "model": _model(entry.model),
    }


def _model(model: Model) -> Document:
    """Its short name and the text of its model.yaml."""
    return {"name": model.name, "text": format_model(model)}
