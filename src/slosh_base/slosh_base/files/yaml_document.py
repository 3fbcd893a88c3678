"""Reads and writes YAML with strict rules, size limits and line numbers in errors.

PyYAML follows YAML 1.1, which takes 2e1 for a text, 010 for eight and 1:30 for ninety. Here the
numbers are those of YAML 1.2, and what is written any reader of YAML 1.1 reads alike.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import yaml

from slosh_base.files.bounded_text import read_text
from slosh_base.files.errors import YamlError

LONGEST = 1_000_000
"""Characters of a text, at most, where nothing else is said."""
_MOST_SHOWN = 60
# What PyYAML lets through where an explicit tag does not fit its value, as in `!!bool 5`.
_MISFITS = (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError)

Key = str | int
"""A name in a mapping, or an index in a list."""
KeyPath = tuple[Key, ...]
"""From the top of a document."""

MOST_VALUES = 200_000
"""Values of a document, keys too, at most; references count as what they stand for."""
DEEPEST = 50
"""Levels of a document, at most."""
SAFE_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""Eight times as fast as the one in Python, where the C library is there."""

INT_TAG: Final = "tag:yaml.org,2002:int"
FLOAT_TAG: Final = "tag:yaml.org,2002:float"
_INT = (INT_TAG, re.compile(r"[-+]?[0-9]+$"), list("-+0123456789"))
_FLOAT = (
    FLOAT_TAG,
    re.compile(
        r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?$|[-+]?\.(inf|Inf|INF)$"
        r"|\.(nan|NaN|NAN)$"
    ),
    list("-+.0123456789"),
)


def read_numbers(loader: Any) -> None:
    """Makes a YAML loader class recognise numbers as YAML 1.2 defines them."""
    loader.yaml_implicit_resolvers = {
        first: [pair for pair in pairs if pair[0] not in (INT_TAG, FLOAT_TAG)]
        for first, pairs in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }
    loader.add_implicit_resolver(*_INT)
    loader.add_implicit_resolver(*_FLOAT)


def quote_numbers(dumper: Any) -> None:
    """Makes a YAML dumper class quote strings that YAML 1.1 or 1.2 would read as numbers."""
    dumper.add_implicit_resolver(*_INT)
    dumper.add_implicit_resolver(*_FLOAT)


@dataclass(frozen=True, slots=True, eq=False)
class YamlDocument:
    """A parsed YAML document with the line number of each key.

    Attributes:
        source: how errors name the text.
        value: what it says; keys of mappings are texts, as they are written.
        root: the same with its places in the text; None: the text is empty.
    """

    source: str
    value: Any
    root: yaml.Node | None

    def where(self, *keys: Key) -> str:
        """Returns `FILE:LINE` of a key, or of its parent if the key is missing."""
        line, node = None, self.root
        for key in keys:
            found = _child(node, key)
            if found is None:
                break
            line, node = _line(found[0]), found[1]
        return self.source if line is None else f"{self.source}:{line}"

    def at(self, *keys: Key) -> str:
        """Returns position and name of a key, such as `FILE:LINE: container.radius`."""
        return f"{self.where(*keys)}: {dotted(keys)}"


def read_yaml(path: str | Path, longest: int = LONGEST, *, angles: bool = False) -> YamlDocument:
    """Reads and parses a YAML file.

    Raises:
        TextFileError: the file cannot be read.
        YamlError: as `parse_yaml`.

    >>> read_yaml("cup/model.yaml").value["container"]["shape"]
    'cylinder'
    """
    return parse_yaml(read_text(path, longest), str(path), longest, angles=angles)


def parse_yaml(
    text: str, source: str, longest: int = LONGEST, *, angles: bool = False
) -> YamlDocument:
    """Parses a YAML text and records the line number of each key.

    >>> document = parse_yaml("container: {radius: 0.05}", "cup.yaml")
    >>> document.value["container"]["radius"], document.at("container", "radius")
    (0.05, 'cup.yaml:1: container.radius')

    Args:
        text: one document.
        source: how errors name it.
        longest: characters of the text, at most.
        angles: whether the tags `!degrees` and `!radians` of ROS are read; as radians.

    Raises:
        YamlError: it is no YAML, stands for too much, or gives a key twice; one line.
    """
    try:
        check_bounds(text, longest)
        loader: Any = (_AngleLoader if angles else _Loader)(text)
        try:
            root = loader.get_single_node()
            if root is None:
                return YamlDocument(source, None, None)
            # Before construction, which puts merged keys beside those of the mapping itself.
            _check_keys(source, root, (), set())
            return YamlDocument(source, loader.construct_document(root), root)
        finally:
            loader.dispose()
    except YamlError:
        raise
    except (yaml.YAMLError, *_MISFITS) as error:
        line, problem = _fault(text, error)
        place = source if line is None else f"{source}:{line}"
        raise YamlError(f"{place}: not YAML: {' '.join(problem.split())}") from None


def dotted(keys: KeyPath) -> str:
    """Formats a path of keys for error messages, such as `effects[0].alpha`.

    >>> dotted(["effects", 0, "alpha"])
    'effects[0].alpha'
    """
    parts = (f"[{key}]" if isinstance(key, int) else f".{brief(key)}" for key in keys)
    return "".join(parts).removeprefix(".")


def shown(value: object) -> str:
    """Formats a value for error messages; describes collections instead of printing them.

    >>> shown([1, 2]), shown("abc")
    ('a list', "'abc'")
    """
    if isinstance(value, (list, dict, set, tuple)):
        return {list: "a list", dict: "a mapping"}.get(type(value), "a collection")
    return brief(repr(value))


def brief(text: str) -> str:
    """Shortens a text to one line of at most sixty characters, for error messages.

    >>> len(brief("a long text " * 20))
    61
    """
    line = " ".join(text.split())
    return line if len(line) <= _MOST_SHOWN else f"{line[:_MOST_SHOWN]}…"


class _Loader(SAFE_LOADER):
    """Safe YAML loader with the numbers of YAML 1.2, which reads all keys as text."""

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        """Constructs a node's value; errors give the line number."""
        try:
            return super().construct_object(node, deep)
        except _MISFITS:
            kind = str(node.tag).rsplit(":", 1)[-1]
            raise yaml.constructor.ConstructorError(
                None, None, f"{shown(node.value)} is no {kind}", node.start_mark
            ) from None

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[str, Any]:
        """Constructs a mapping with all keys as text, even if they look like numbers."""
        self.flatten_mapping(node)
        return {key.value: self.construct_object(value, deep=deep) for key, value in node.value}

    def construct_whole(self, node: yaml.ScalarNode) -> int:
        """Constructs a decimal integer, which may have leading zeros."""
        return int(node.value)


read_numbers(_Loader)
_Loader.add_constructor(INT_TAG, _Loader.construct_whole)


class _AngleLoader(_Loader):
    """Loader that also reads angles with a unit, as xacro does: `!degrees 90`."""

    def construct_degrees(self, node: yaml.ScalarNode) -> float:
        """Converts an angle from degrees to radians."""
        return math.radians(float(node.value))

    def construct_radians(self, node: yaml.ScalarNode) -> float:
        """Returns an angle in radians."""
        return float(node.value)


_AngleLoader.add_constructor("!degrees", _AngleLoader.construct_degrees)
_AngleLoader.add_constructor("!radians", _AngleLoader.construct_radians)


def _check_keys(source: str, node: Any, keys: KeyPath, seen: set[int]) -> None:
    """Raises an error for keys that are not text, and for duplicate keys."""
    if id(node) in seen:  # by a reference
        return
    seen.add(id(node))
    if isinstance(node, yaml.SequenceNode):
        for index, item in enumerate(node.value):
            _check_keys(source, item, (*keys, index), seen)
    elif isinstance(node, yaml.MappingNode):
        given: set[str] = set()
        for key, value in node.value:
            if not isinstance(key, yaml.ScalarNode):
                place = f"{source}:{_line(key)}: {dotted(keys)}".removesuffix(": ")
                raise YamlError(f"{place}: a key is a collection; keys are names")
            path = (*keys, key.value)
            if key.value in given:
                raise YamlError(f"{source}:{_line(key)}: {dotted(path)}: given twice")
            given.add(key.value)
            _check_keys(source, value, path, seen)


def _child(node: Any, key: Key) -> tuple[Any, Any] | None:
    """Returns the nodes of a key and its value in a YAML mapping; None if the key is missing."""
    if isinstance(node, yaml.SequenceNode):
        inside = isinstance(key, int) and 0 <= key < len(node.value)
        return (node.value[key], node.value[key]) if inside else None
    if not isinstance(node, yaml.MappingNode):
        return None
    # The mapping's own keys come after those that are merged into it.
    return next((pair for pair in reversed(node.value) if pair[0].value == key), None)


def _line(node: Any) -> int:
    return int(node.start_mark.line) + 1


def _fault(text: str, error: Exception) -> tuple[int | None, str]:
    """Describes a YAML parse error, with its line number if known."""
    if isinstance(error, yaml.MarkedYAMLError):
        mark: Any = error.problem_mark or error.context_mark
        problem = error.problem or "cannot be read"
        if problem.startswith("but "):
            problem = f"{error.context}, {problem}"
        if mark is None:
            return None, problem
        tab = text[mark.index : mark.index + 1] == "\t"
        hint = " (there is a tab here; indent with spaces)" if tab else ""
        # The parser in C puts what is missing at the end on a line after the last.
        return min(int(mark.line), text.count("\n")) + 1, f"{problem}{hint}"
    if isinstance(error, yaml.reader.ReaderError):
        before = text.encode()[: error.position]
        return before.count(b"\n") + 1, f"character #x{error.character:02x}: {error.reason}"
    if isinstance(error, UnicodeEncodeError):
        return text.count("\n", 0, error.start) + 1, error.reason
    return None, str(error) or type(error).__name__


def check_bounds(text: str, longest: int) -> None:
    """Raises an error for a YAML text that is too long or expands to too many values.

    References and merge keys let a page of text stand for more values than a machine can hold:
    values are counted first, references followed, from the parser's events alone.

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
    """Counts the values of a YAML document, including repeated references."""

    def __init__(self) -> None:
        self._total = 0
        self._sizes: dict[str, int] = {}  # by anchor
        self._open: list[tuple[str | None, int]] = []

    def take(self, event: Any) -> str:
        """Processes the next parser event; returns why the document is rejected; empty if not."""
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


# In C where it is there, ten times as fast: metadata.yaml is written while messages wait.
class _Dumper(getattr(yaml, "CSafeDumper", yaml.SafeDumper)):  # type: ignore[misc]
    """Safe YAML dumper that quotes strings that look like numbers in YAML 1.1 or 1.2."""


quote_numbers(_Dumper)


def format_yaml(document: Any, **style: Any) -> str:
    """Formats a document as YAML text.

    >>> format_yaml({"radius": 0.05}).strip()
    'radius: 0.05'

    Args:
        document: of plain values.
        style: as `yaml.dump` takes it.
    """
    return str(yaml.dump(document, Dumper=_Dumper, **style))
