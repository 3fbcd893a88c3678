"""A run's report: one HTML page that needs nothing beside it, and the same numbers as JSON."""

from slosh_discovery.report.data import AzimuthSeries, RunReport
from slosh_discovery.report.document import report_document
from slosh_discovery.report.page import render_report
from slosh_discovery.report.rows import (
    Check,
    Difference,
    Fact,
    Frame,
    KeyFigure,
    ModelRow,
    Motion,
    Span,
    Status,
    Topic,
    Verdict,
    Verification,
)

__all__ = [
    "AzimuthSeries",
    "Check",
    "Difference",
    "Fact",
    "Frame",
    "KeyFigure",
    "ModelRow",
    "Motion",
    "RunReport",
    "Span",
    "Status",
    "Topic",
    "Verdict",
    "Verification",
    "render_report",
    "report_document",
]
