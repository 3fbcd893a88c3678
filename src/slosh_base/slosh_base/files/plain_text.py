r"""Makes texts from untrusted sources safe for terminals, logs and reports.

A terminal obeys control characters: an ESC in a file's name can repaint the screen, set its title
or answer a question in the user's place. A newline forges a line of its own. Here such characters
become what a programmer would write for them, `\x1b`.
"""

from __future__ import annotations

import re
from os import PathLike, fspath
from typing import Any, TextIO

LONGEST = 1000
"""Characters of a line that quotes a stranger; what is longer is cut."""
_LAST = 200
"""Of them so many are its end."""
# C0 and C1, line separators, what turns the direction of writing, halves of characters.
_DIRECTIONS = "\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069"
_ALL = re.compile(f"[\x00-\x1f\x7f-\x9f\u2028\u2029{_DIRECTIONS}\ud800-\udfff]")
_IN_LINES = re.compile(f"[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029{_DIRECTIONS}\ud800-\udfff]")


def plain_line(text: str | PathLike[str]) -> str:
    """Returns a text or path as one short line without control characters.

    What is longer lacks its middle: what a line quotes stands there, and the reason at its end.
    """
    whole = fspath(text)
    begin, end = (_ALL.sub(_written, part) for part in (whole[:LONGEST], whole[LONGEST:][-_LAST:]))
    if len(whole) <= LONGEST + _LAST and len(begin) + len(end) <= LONGEST:
        return begin + end
    return f"{begin[: LONGEST - 1 - _LAST]}…{(begin + end)[-_LAST:]}"


def plain_lines(text: str) -> str:
    """Escapes all control characters in a text except line ends and tabs."""
    return _IN_LINES.sub(_written, text)


def _written(found: re.Match[str]) -> str:
    return ascii(found[0])[1:-1]


class PlainStream:
    """A text stream for standard output or error that escapes control characters.

    A carriage return stays where a text begins or ends with it: so a progress bar draws itself.

    Args:
        stream: that is written to; what is not `write` is its own.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """Writes a text with escaped control characters; returns its number of characters."""
        inner = text.lstrip("\r").rstrip("\r") if "\r" in text else text
        begin = len(text) - len(text.lstrip("\r")) if inner else 0
        end = text[begin + len(inner) :]
        self._stream.write(f"{text[:begin]}{plain_lines(inner)}{end}")
        return len(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)
