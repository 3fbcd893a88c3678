"""Prints notes about input data and records whether an input is doubtful."""

from __future__ import annotations

import sys
from collections.abc import Iterable

from slosh_base.files.plain_text import plain_line
from slosh_motion.checks.table_checks import InputDoubt

EXIT_DOUBTFUL = 1
"""The answer was given, but the input is not what it claims to be."""


class Teller:
    """Prints notes on standard error and determines the exit code.

    Args:
        command: that speaks.

    Attributes:
        doubtful: whether a line told that an input is not what it claims to be.
    """

    def __init__(self, command: str) -> None:
        self.doubtful = False
        self._command = command

    def __call__(self, line: str) -> None:
        """Prints one line on standard error."""
        self.doubtful |= isinstance(line, InputDoubt) and line.wrong
        kind = "warning" if isinstance(line, InputDoubt) else "note"
        print(plain_line(f"slosh {self._command}: {kind}: {line}"), file=sys.stderr)

    def warn(self, path: object, doubts: Iterable[InputDoubt]) -> None:
        """Prints why an input file is doubtful and records that it is."""
        for doubt in doubts:
            self(doubt.of_file(path))

    @property
    def exit_code(self) -> int:
        """Returns the exit code: EXIT_DOUBTFUL if an input was doubtful, otherwise 0."""
        return EXIT_DOUBTFUL if self.doubtful else 0
