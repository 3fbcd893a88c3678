"""Results of an identification as text, HTML page and `identification.json`."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from slosh_discovery.identification_report.data import (
    SCHEMA,
    Beside,
    IdentificationReport,
    identification_document,
    identification_json,
)
from slosh_discovery.identification_report.text import identification_text

if TYPE_CHECKING:
    from slosh_discovery.identification_report.page import render_identification

__all__ = [
    "SCHEMA",
    "Beside",
    "IdentificationReport",
    "identification_document",
    "identification_json",
    "identification_text",
    "render_identification",
]


def __getattr__(name: str) -> Any:
    # It loads the templates, which a program that reads only the figures does not need.
    if name != "render_identification":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return import_module(f"{__name__}.page").render_identification
