"""Runs the `slosh` command in the process of a test."""

from __future__ import annotations

import json
from typing import Any

import pytest

from slosh_bringup.cli.main import main

Capture = pytest.CaptureFixture[str]


def printed(capsys: Capture, *words: object) -> Any:
    """Runs a command that must succeed, and returns its JSON output."""
    capsys.readouterr()
    assert main([str(word) for word in words]) == 0
    return json.loads(capsys.readouterr().out)


def complaint(capsys: Capture, *words: object) -> str:
    """Runs a command that must fail, and returns its one error line."""
    capsys.readouterr()
    try:
        code: object = main([str(word) for word in words])
    except SystemExit as caught:
        code = caught.code
    captured = capsys.readouterr()
    assert (code, captured.out) == (2, ""), captured
    lines = [line for line in captured.err.splitlines() if line.startswith("slosh")]
    (line,) = [line for line in lines if ": note: " not in line]
    return line
