"""The root exception of the package slosh_report."""

from __future__ import annotations


class SloshReportError(ValueError):
    """Error of data that cannot be compared or shown in a report; the message is one line."""
