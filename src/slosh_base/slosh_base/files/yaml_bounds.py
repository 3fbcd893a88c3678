"""Refuses YAML that stands for too much, before anything is made of it.

References and merge keys let a page of text stand for more values than a machine can hold. So the
values are counted first, references followed, from the parser's events alone: that takes a time
and a memory that grow with the text only.
"""

from __future__ import annotations

from typing import Any

import yaml

MOST_VALUES = 200_000
"""Values of a document, keys too, at most; references count as what they stand for."""
DEEPEST = 50
"""Levels of a document, at most."""
SAFE_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""Eight times as fast as the one in Python, where the C library is there."""


def check_bounds(text: str, longest: int) -> None:
    """Refuses a text that is too long, or stands for too much.

    Args:
        text: YAML.
        longest: characters of it, at most.

    Raises:
        yaml.YAMLError: it does, or is no YAML.
    """
    if len(text) > longest:
        raise yaml.MarkedYAMLError(problem=f"the text is longer than {longest} characters")
    counter = _Counter()
    for event in yaml.parse(text, Loader=SAFE_LOADER):
        problem = counter.take(event)
        if problem:
            mark: Any = event.start_mark  # of the parser in C or of that in Python
            raise yaml.MarkedYAMLError(problem=problem, problem_mark=mark)


class _Counter:
    """Counts the values that a document's events stand for."""

    def __init__(self) -> None:
        self._total = 0
        self._sizes: dict[str, int] = {}  # by anchor
        self._open: list[tuple[str | None, int]] = []

    def take(self, event: Any) -> str:
        """Takes the next event; returns why the document is refused, or nothing."""
        if isinstance(event, yaml.AliasEvent) and event.anchor not in self._sizes:
            return f"*{event.anchor} refers to itself or to nothing"
        before = self._total
        self._count(event)
        if isinstance(event, yaml.CollectionStartEvent):
            self._open.append((event.anchor, before))
        elif isinstance(event, yaml.CollectionEndEvent):
            self._note(*self._open.pop())
        elif isinstance(event, yaml.ScalarEvent):
            self._note(event.anchor, before)
        if self._total > MOST_VALUES:
            return f"it stands for more than {MOST_VALUES} values"
        return f"it has more than {DEEPEST} levels" if len(self._open) > DEEPEST else ""

    def _count(self, event: Any) -> None:
        if isinstance(event, yaml.AliasEvent):
            self._total += self._sizes[str(event.anchor)]
        elif isinstance(event, (yaml.ScalarEvent, yaml.CollectionStartEvent)):
            self._total += 1

    def _note(self, anchor: str | None, before: int) -> None:
        if anchor:
            self._sizes[anchor] = self._total - before
