"""Report of a run: a document, as one self-contained HTML page and the same numbers as JSON."""

from slosh_report.page.frame import Frame
from slosh_report.run_report.data import AzimuthSeries, RunReport
from slosh_report.run_report.document import render_report, run_document
from slosh_report.run_report.figures import report_document
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
    "run_document",
]
