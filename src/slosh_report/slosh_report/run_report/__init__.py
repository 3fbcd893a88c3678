"""Report of a run: one self-contained HTML page, and the same numbers as JSON."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from slosh_report.page.frame import Frame
from slosh_report.run_report.data import AzimuthSeries, RunReport
from slosh_report.run_report.rows import (
    CheckRow,
    DifferenceRow,
    ExcessSpan,
    Fact,
    KeyFigure,
    ModelRow,
    RunMotion,
    RunVerdict,
    Status,
    TopicRow,
    VerificationRow,
)

if TYPE_CHECKING:
    from slosh_report.run_report.document import report_document
    from slosh_report.run_report.page import render_report

__all__ = [
    "AzimuthSeries",
    "CheckRow",
    "DifferenceRow",
    "ExcessSpan",
    "Fact",
    "Frame",
    "KeyFigure",
    "ModelRow",
    "RunMotion",
    "RunReport",
    "RunVerdict",
    "Status",
    "TopicRow",
    "VerificationRow",
    "render_report",
    "report_document",
]

# They load the templates, which takes longer than many a replay that makes no page.
_DRAWING = {"report_document": "document", "render_report": "page"}


def __getattr__(name: str) -> Any:
    if name not in _DRAWING:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_DRAWING[name]}"), name)
