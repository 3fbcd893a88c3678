"""Suggests the known name that is most similar to a mistyped one."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

CUTOFF = 0.7
"""Share of a name that must be alike: below it, what is proposed is another thing."""
_LONGEST = 200
"""Characters of a name that is looked up: comparing longer ones takes time for nothing."""


def nearest(name: str, known: Iterable[str]) -> str | None:
    """Returns the known name that is most similar to `name`, or None if none is similar.

    Upper and lower case, `-` and `_` count as the same.
    """
    plain = {_plain(one): one for one in known}
    found = difflib.get_close_matches(_plain(name)[:_LONGEST], plain, 1, CUTOFF)
    return plain[found[0]] if found else None


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Returns `; did you mean NAME?` for an error message; empty if no name is similar."""
    found = nearest(name, known)
    return "" if found is None else f"; did you mean {found}?"


def _plain(name: str) -> str:
    return name.lower().replace("-", "_")
