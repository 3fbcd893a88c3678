"""The `slosh` command within a test's process."""

from __future__ import annotations

import json
from typing import Any

import pytest

from slosh_bringup.cli.main import main

Capture = pytest.CaptureFixture[str]


def printed(capsys: Capture, *words: object) -> Any:
    """What a command that succeeds prints as JSON."""
    capsys.readouterr()
    assert main([str(word) for word in words]) == 0
    return json.loads(capsys.readouterr().out)


def complaint(capsys: Capture, *words: object) -> str:
    """The one line with which a command refuses; notes and progress are left out."""
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
