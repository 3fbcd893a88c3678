"""Results of a discovery as terminal text, HTML page and `discovery.json`."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from slosh_discovery.discovery_report.data import (
    SCHEMA,
    Command,
    DiscoveryReport,
    discovery_document,
    discovery_json,
)
from slosh_discovery.discovery_report.text import discovery_text

if TYPE_CHECKING:
    from slosh_discovery.discovery_report.page import render_discovery

__all__ = [
    "SCHEMA",
    "Command",
    "DiscoveryReport",
    "discovery_document",
    "discovery_json",
    "discovery_text",
    "render_discovery",
]


def __getattr__(name: str) -> Any:
    # It loads the templates, which a program that reads only the figures does not need.
    if name != "render_discovery":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return import_module(f"{__name__}.page").render_discovery
