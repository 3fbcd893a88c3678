"""Records which items of a run are finished, so that a repeated run skips these items."""

from __future__ import annotations

import dataclasses
import json
import types
import typing
from collections.abc import Callable, Mapping
from contextlib import suppress
from enum import Enum
from pathlib import Path
from typing import Any, Final, TypeVar

from slosh_base.files import write_text

Value = TypeVar("Value")

NOTES: Final = ".finished"
"""Folder of the notes, in the folder of the results."""


class FinishedWork:
    """Records of the finished items of a run over many items, one file for each item.

    A note has a digest of what its item's result depends on, and a summary of the result. It is
    written after the result, as a whole, by whichever process has worked on the item.

    Args:
        folder: where the results are.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder / NOTES

    def find(self, name: str, state: str, kind: type[Value]) -> Value | None:
        """Returns a finished item's summary; None if it is unfinished or its data have changed.

        Args:
            name: of the item.
            state: digest of what its result depends on.
            kind: dataclass of the summary.
        """
        try:
            note = json.loads(self._note(name).read_text(encoding="utf-8"))
            return decoded(kind, note["value"]) if note["state"] == state else None
        except (OSError, ValueError, LookupError, TypeError):
            return None  # none, or one that a machine without power has spoilt: done again

    def has(self, name: str) -> bool:
        """Returns whether an earlier run began or finished the item, with any data."""
        return self._note(name).is_file()

    def begin(self, name: str) -> None:
        """Records that an item is begun, so that a later run may replace its results.

        Raises:
            OSError: the note cannot be written; it bears the path.
        """
        if not self.has(name):
            self.note(name, "", None)

    def note(self, name: str, state: str, value: object) -> None:
        """Records that an item is finished, with a summary of its result.

        Raises:
            OSError: the note cannot be written; it bears the path.
        """
        self._folder.mkdir(parents=True, exist_ok=True)
        text = json.dumps({"state": state, "value": encoded(value)}, indent=1)
        write_text(self._note(name), text + "\n")

    def forget(self) -> None:
        """Deletes all records, so that the next run processes every item again."""
        for note in self._folder.glob("*.json"):
            note.unlink(missing_ok=True)
        with suppress(OSError):  # there is none, or it holds what is no note
            self._folder.rmdir()

    def _note(self, name: str) -> Path:
        return self._folder / f"{name}.json"


def encoded(value: Any) -> Any:
    """Converts dataclasses, tuples, mappings and paths to JSON-compatible values."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = dataclasses.fields(value)
        return {field.name: encoded(getattr(value, field.name)) for field in fields}
    if isinstance(value, Mapping):
        return {key: encoded(one) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [encoded(one) for one in value]
    if isinstance(value, Enum):
        return encoded(value.value)
    return str(value) if isinstance(value, Path) else value


def decoded(kind: Any, value: Any) -> Any:
    """Converts a JSON value to an annotated type; the inverse of `encoded`.

    Raises:
        LookupError, TypeError, ValueError: it is no such value.
    """
    origin, inner = typing.get_origin(kind), typing.get_args(kind)
    if origin in (typing.Union, types.UnionType):
        (some,) = (one for one in inner if one is not type(None))
        return None if value is None else decoded(some, value)
    if origin is tuple:
        kinds = [inner[0]] * len(value) if inner[-1] is ... else inner
        return tuple(decoded(one, part) for one, part in zip(kinds, value, strict=True))
    if origin is not None and issubclass(origin, Mapping):
        return {key: decoded(inner[1], part) for key, part in value.items()}
    if not isinstance(kind, type):
        return value
    make: Callable[..., Any] = kind
    if dataclasses.is_dataclass(kind):
        hints = typing.get_type_hints(kind)
        known = [field.name for field in dataclasses.fields(kind)]
        return make(**{name: decoded(hints[name], value[name]) for name in known})
    if issubclass(kind, tuple):
        kinds = list(typing.get_type_hints(kind).values())
        return make(*(decoded(one, part) for one, part in zip(kinds, value, strict=True)))
    return make(value) if issubclass(kind, (Enum, Path)) else value
