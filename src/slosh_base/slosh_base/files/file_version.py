"""Versions of the formats of YAML files: models, cells, cameras and manifests.

A file's key `version` says for which version of its format it is written; without it that is 0.
Older files are read as if they were of today, and `slosh migrate` rewrites them; newer ones are
refused. A new version of a format is one entry more in its `steps`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, NamedTuple

import yaml

from slosh_base.files.bounded_text import read_text
from slosh_base.files.errors import YamlError
from slosh_base.files.yaml_document import LONGEST, YamlDocument, parse_yaml, shown

KEY: Final = "version"
_BYTE_ORDER_MARK = "\ufeff"
_VERSION_LINE = re.compile(rf"^{KEY}: \d+\n", re.MULTILINE)
EACH: Final = "*"
"""In the path of a key: each item of a list, or each key of a mapping."""


class RenamedKey(NamedTuple):
    """A key that is renamed in the next version of a file format.

    Attributes:
        path: to the key by its old name, such as ("effects", "*", "alpha").
        name: its new name.
    """

    path: tuple[str, ...]
    name: str


@dataclass(frozen=True, slots=True)
class FileFormat:
    """A file format such as model.yaml: name, versions and renamed keys.

    Attributes:
        name: usual name of such a file.
        marks: keys at the top of a file, one of which all files of the format have.
        steps: what is renamed from version 0 to 1, from 1 to 2, and so on.
    """

    name: str
    marks: tuple[str, ...]
    steps: tuple[tuple[RenamedKey, ...], ...]

    @property
    def current(self) -> int:
        """The version that this program writes, and the newest that it reads."""
        return len(self.steps)

    def versioned(self, document: dict[str, Any]) -> dict[str, Any]:
        """Returns a copy of a document with the current version number as its first key."""
        return {KEY: self.current, **document}


# From 0 to 1 nothing but the key `version` was added.
CAMERA: Final = FileFormat("camera.yaml", ("camera_matrix",), ((),))
MANIFEST: Final = FileFormat("manifest.yaml", ("bags",), ((),))
CELL: Final = FileFormat("cell.yaml", ("model",), ((),))
MODEL: Final = FileFormat("model.yaml", ("container", "containers"), ((),))
FORMATS: Final = (CAMERA, MANIFEST, CELL, MODEL)
"""A camera's file has a container too, so the first format whose mark is there counts."""


def read_versioned(path: str | Path, file_format: FileFormat) -> YamlDocument:
    """Reads a file that was written in any version of its format, as `parse_versioned` does.

    Raises:
        TextFileError: the file cannot be read.
        YamlError: as `parse_versioned`.
    """
    return parse_versioned(read_text(path, LONGEST), str(path), file_format)


def parse_versioned(
    text: str, source: str, file_format: FileFormat, longest: int = LONGEST
) -> YamlDocument:
    r"""Parses text of any format version; the value has the current keys, without `version`.

    >>> parse_versioned("version: 1\ncontainer: {radius: 0.05}", "cup.yaml", MODEL).value
    {'container': {'radius': 0.05}}

    Args:
        text: YAML.
        source: how errors name it.
        file_format: of the file.
        longest: characters of the text, at most.

    Raises:
        YamlError: no YAML, or a version that is none or too new; one line.
    """
    text = text.removeprefix(_BYTE_ORDER_MARK)  # the parser's places do not count it
    document = parse_yaml(text, source, longest)
    version = _version(document, file_format)
    if any(file_format.steps[version:]):
        document = parse_yaml(_renamed(text, document, file_format, version), source, longest)
    if not isinstance(document.value, dict):
        return document
    return replace(document, value={k: v for k, v in document.value.items() if k != KEY})


def without_version(text: str) -> str:
    r"""Returns a file's text without its version number, for comparison with an older file.

    >>> without_version("version: 1\nradius: 0.05\n")
    'radius: 0.05\n'
    """
    return _VERSION_LINE.sub("", text, count=1)


class Migrated(NamedTuple):
    """A file's text, converted to the current version of its format.

    Attributes:
        file_format: what kind of file it is.
        version: that it had.
        text: as it was, comments too, but for the renamed keys and the version.
    """

    file_format: FileFormat
    version: int
    text: str


def migrated(text: str, source: str, formats: Sequence[FileFormat] = FORMATS) -> Migrated:
    """Converts a file's text to the current version of its format; comments and order stay.

    Args:
        text: YAML.
        source: how errors name it.
        formats: those that it may have; the first that fits is taken.

    Raises:
        YamlError: no YAML, of no known format, or a version that is none or too new; one line.
    """
    if text.startswith(_BYTE_ORDER_MARK):
        found = migrated(text.removeprefix(_BYTE_ORDER_MARK), source, formats)
        return found._replace(text=_BYTE_ORDER_MARK + found.text)
    document = parse_yaml(text, source)
    keys = document.value if isinstance(document.value, dict) else {}
    fitting = (one for one in formats if not keys.keys().isdisjoint(one.marks))
    file_format = next(fitting, None)
    if file_format is None:
        names = ", ".join(one.name for one in formats)
        raise YamlError(f"{source}: none of the files that have a version ({names})")
    version = _version(document, file_format)
    if version == file_format.current:
        return Migrated(file_format, version, text)
    new = _renamed(text, document, file_format, version)
    new = _with_version(new, parse_yaml(new, source), file_format.current)
    wanted = parse_versioned(text, source, file_format).value
    if parse_yaml(new, source).value != file_format.versioned(wanted):
        raise YamlError(
            f"{source}: cannot be rewritten without loss; change `{KEY}` by hand, to "
            f"{file_format.current}"
        )
    return Migrated(file_format, version, new)


def _version(document: YamlDocument, file_format: FileFormat) -> int:
    """Returns a file's format version; raises YamlError if this program cannot read it."""
    given = document.value.get(KEY, 0) if isinstance(document.value, dict) else 0
    newest = file_format.current
    if isinstance(given, bool) or not isinstance(given, int) or given < 0:
        raise YamlError(
            f"{document.at(KEY)} = {shown(given)} must be a whole number from 0 to {newest}"
        )
    if given > newest:
        raise YamlError(
            f"{document.at(KEY)} = {shown(given)}: written for a newer slosh, this one reads "
            f"{file_format.name} up to version {newest}; install a newer slosh"
        )
    return given


def _renamed(text: str, document: YamlDocument, file_format: FileFormat, version: int) -> str:
    """Returns the text with its keys renamed as in the current version of the format."""
    for step in file_format.steps[version:]:
        changes = [
            (key.start_mark.index, key.end_mark.index, one.name)
            for one in step
            for key in _keys(document.root, one.path)
        ]
        for start, end, name in sorted(changes, reverse=True):
            text = f"{text[:start]}{name}{text[end:]}"
        if changes:
            document = parse_yaml(text, document.source)
    return text


def _keys(node: Any, path: Sequence[str]) -> Iterator[Any]:
    """Yields the YAML nodes of all keys that match a path."""
    word, *rest = path
    if isinstance(node, yaml.SequenceNode) and word == EACH:
        for item in node.value:
            yield from _keys(item, rest) if rest else ()
    elif isinstance(node, yaml.MappingNode):
        yield from _keys_of_mapping(node.value, word, rest)


def _keys_of_mapping(pairs: Iterable[Any], word: str, rest: Sequence[str]) -> Iterator[Any]:
    for key, value in pairs:
        if word not in (EACH, key.value):
            continue
        if rest:
            yield from _keys(value, rest)
        else:
            yield key


def _with_version(text: str, document: YamlDocument, version: int) -> str:
    """Returns the text with the key `version` set; a new key comes after the top comments."""
    root: Any = document.root
    for key, value in root.value:
        if key.value == KEY:
            return f"{text[: value.start_mark.index]}{version}{text[value.end_mark.index :]}"
    start = root.start_mark.index
    if root.flow_style:
        return f"{text[: start + 1]}{KEY}: {version}, {text[start + 1 :]}"
    line_end = "\r\n" if "\r\n" in text else "\n"
    indent = " " * root.start_mark.column
    return f"{text[:start]}{KEY}: {version}{line_end}{indent}{text[start:]}"
