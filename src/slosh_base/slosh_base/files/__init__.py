"""Writes files and folders without overwriting; reads YAML strictly.

A package of its own, below all others, because what writes a bag, a table or a page should load
nothing else for it: the model's package would bring the compiler into the recorder's process, the
messages' package would bring ROS into the pure cores. YAML is in a module of its own,
`yaml_document`, so that only what reads or writes it loads PyYAML.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterable
from pathlib import Path

from slosh_base.files.errors import SloshFileError
from slosh_base.files.new_file import NewFile, naming, new_link, new_text, write_bytes, write_text
from slosh_base.files.new_folder import check_free, is_unfinished, new_folder, remove_unfinished

__all__ = [
    "NewFile",
    "SloshFileError",
    "check_apart",
    "check_free",
    "check_outside",
    "is_unfinished",
    "naming",
    "new_folder",
    "new_link",
    "new_text",
    "remove_unfinished",
    "write_bytes",
    "write_text",
]

_Identity = tuple[int, int]


def check_apart(outputs: Iterable[Path | None], inputs: Iterable[Path | None]) -> None:
    """Raises an error if an output file is also an input or another output, under any name.

    A relative and an absolute path, a link and a hard link are names of one file.

    Args:
        outputs: the files; None: not asked for.
        inputs: files; of a folder those that are read.

    Raises:
        SloshFileError: an output is an input, or two outputs are one file.

    >>> check_apart([Path("out.csv"), Path("out.csv")], [])
    Traceback (most recent call last):
    slosh_base.files.errors.SloshFileError: out.csv: is given for two outputs; change one of them
    """
    read = {_identity(path): path for path in inputs if path is not None}
    written: dict[_Identity | str, Path] = {}
    for path in outputs:
        if path is None:
            continue
        identity = _identity(path)
        if identity is not None and identity in read:
            same = "" if read[identity] == path else f" {read[identity]}"
            raise SloshFileError(f"{path}: is the input{same}; choose another output")
        key = identity or os.path.realpath(path)
        if key in written and not _is_special(path):
            raise SloshFileError(f"{path}: is given for two outputs; change one of them")
        written[key] = path


def check_outside(folder: Path, inputs: Iterable[Path]) -> None:
    """Raises an error if an output folder is an input folder or lies inside one.

    Raises:
        SloshFileError: it does.

    >>> check_outside(Path("new"), [Path("move.csv")])
    """
    places = [folder.resolve(), *folder.resolve().parents]
    for path in inputs:
        if path.is_dir() and path.resolve() in places:
            what = "is the input" if path.resolve() == places[0] else f"is inside the input {path}"
            raise SloshFileError(f"{folder}: {what}; choose another folder")


def _identity(path: Path) -> _Identity | None:
    """Returns a file's identity, equal for all its names, or None if it is not a regular file."""
    try:
        facts = path.stat()
    except OSError:
        return None
    regular = stat.S_ISREG(facts.st_mode) or stat.S_ISDIR(facts.st_mode)
    return (facts.st_dev, facts.st_ino) if regular else None


def _is_special(path: Path) -> bool:
    return path.exists() and _identity(path) is None
