"""A run's report: one HTML page that needs nothing beside it."""

from slosh_discovery.report.data import Frame, KeyFigure, ModelRow, RunReport, Span, Topic
from slosh_discovery.report.page import render_report

__all__ = ["Frame", "KeyFigure", "ModelRow", "RunReport", "Span", "Topic", "render_report"]
