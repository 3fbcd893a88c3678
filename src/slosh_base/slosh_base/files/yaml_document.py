"""The one reader of YAML: bounded, strict, and able to say on which line a key stands."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from slosh_base.files.errors import YamlError
from slosh_base.files.text_file import read_text
from slosh_base.files.yaml_bounds import SAFE_LOADER, check_bounds
from slosh_base.files.yaml_numbers import INT_TAG, read_numbers

LONGEST = 1_000_000
"""Characters of a text, at most, where nothing else is said."""
_MOST_SHOWN = 60
# What PyYAML lets through where an explicit tag does not fit its value, as in `!!bool 5`.
_MISFITS = (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError)

Key = str | int
"""A name in a mapping, or an index in a list."""
KeyPath = tuple[Key, ...]
"""From the top of a document."""


@dataclass(frozen=True, slots=True, eq=False)
class YamlDocument:
    """What a text says, and where.

    Attributes:
        source: how errors name the text.
        value: what it says; keys of mappings are texts, as they are written.
        root: the same with its places in the text; None: the text is empty.
    """

    source: str
    value: Any
    root: yaml.Node | None

    def where(self, *keys: Key) -> str:
        """`FILE:LINE` of a key; of what it lies in where it is missing, `FILE` of nothing."""
        line, node = None, self.root
        for key in keys:
            found = _child(node, key)
            if found is None:
                break
            line, node = _line(found[0]), found[1]
        return self.source if line is None else f"{self.source}:{line}"

    def at(self, *keys: Key) -> str:
        """The same with the key's own name: `FILE:LINE: container.radius`."""
        return f"{self.where(*keys)}: {dotted(keys)}"


def read_yaml(path: str | Path, longest: int = LONGEST) -> YamlDocument:
    """The document in a file.

    Raises:
        TextFileError: the file cannot be read.
        YamlError: as `parse_yaml`.
    """
    return parse_yaml(read_text(path, longest), str(path), longest)


def parse_yaml(text: str, source: str, longest: int = LONGEST) -> YamlDocument:
    """The document in a text.

    Args:
        text: one document.
        source: how errors name it.
        longest: characters of the text, at most.

    Raises:
        YamlError: it is no YAML, stands for too much, or gives a key twice; one line.
    """
    try:
        check_bounds(text, longest)
        loader: Any = _Loader(text)
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
    """A path of keys as errors show it: `effects[0].alpha`; one line, whatever the keys are."""
    parts = (f"[{key}]" if isinstance(key, int) else f".{brief(key)}" for key in keys)
    return "".join(parts).removeprefix(".")


def shown(value: object) -> str:
    """A value as errors show it; references can make a short text's lists endless."""
    if isinstance(value, (list, dict, set, tuple)):
        return {list: "a list", dict: "a mapping"}.get(type(value), "a collection")
    return brief(repr(value))


def brief(text: str) -> str:
    """One line, of sixty characters at most, as errors show what a file gives."""
    line = " ".join(text.split())
    return line if len(line) <= _MOST_SHOWN else f"{line[:_MOST_SHOWN]}…"


class _Loader(SAFE_LOADER):
    """A safe loader with the numbers of YAML 1.2, and names for keys."""

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        """The value, or an error with its line."""
        try:
            return super().construct_object(node, deep)
        except _MISFITS:
            kind = str(node.tag).rsplit(":", 1)[-1]
            raise yaml.constructor.ConstructorError(
                None, None, f"{shown(node.value)} is no {kind}", node.start_mark
            ) from None

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[str, Any]:
        """The mapping; a key is a name, also where it looks like a number."""
        self.flatten_mapping(node)
        return {key.value: self.construct_object(value, deep=deep) for key, value in node.value}

    def construct_whole(self, node: yaml.ScalarNode) -> int:
        """An int; decimal, also with leading zeros."""
        return int(node.value)


read_numbers(_Loader)
_Loader.add_constructor(INT_TAG, _Loader.construct_whole)


def _check_keys(source: str, node: Any, keys: KeyPath, seen: set[int]) -> None:
    """Refuses keys that are no names, and a name that is given twice."""
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
    """Where a key stands in a node, and its value."""
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
    """The line, where it is known, and what is wrong there."""
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
