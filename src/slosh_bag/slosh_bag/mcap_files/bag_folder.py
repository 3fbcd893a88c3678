"""Lists the files of a bag in recording order."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from slosh_bag.errors import SloshBagError
from slosh_bag.mcap_files.mcap_summary import MAGIC
from slosh_bag.mcap_files.remote_path import RemotePath
from slosh_base.files.errors import SloshFileError
from slosh_base.files.file_kind import IMPORT_HINT, foreign_kind
from slosh_base.files.yaml_document import read_yaml

METADATA = "metadata.yaml"
_UNREADABLE = (ValueError, TypeError, AttributeError, LookupError)
LONGEST_METADATA = 20_000_000
"""Characters; a bag of very many files notes each of them."""


def bag_folder(path: Path) -> Path:
    """Returns a bag's folder: the given path, or its only subfolder that contains a bag.

    `slosh import -o DIR` makes such a folder, and so does an archive that was unpacked.

    Raises:
        SloshBagError: several folders of it hold a bag.
    """
    if not path.is_dir() or any(path.glob("*.mcap")):
        return path
    inner = {entry.resolve(): entry for entry in sorted(path.iterdir())
             if entry.is_dir() and any(entry.glob("*.mcap"))}  # fmt: skip
    if len(inner) > 1:
        names = ", ".join(entry.name for entry in inner.values())
        raise SloshBagError(f"{path}: holds {len(inner)} bags; name one of them: {names:.300}")
    return next(iter(inner.values()), path)


def bag_files(path: Path) -> list[Path]:
    """Returns the MCAP files of a bag in the order in which they were written.

    That is the order of metadata.yaml where it names just the files that are there, else that of
    their names, with numbers taken as numbers: bag_2 before bag_10.

    Raises:
        SloshBagError: there are none, one is not an MCAP file, or nothing is in any of them.
    """
    return ordered_files(path)[0]


def import_hint(path: Path) -> str:
    """Describes how to import a bag in another format; empty if the format is not known."""
    if path.is_dir():
        foreign = any(path.glob("*.db3*")) or any(path.glob("*.bag"))
        kind = "a bag of ROS 1 or of rosbag2's SQLite storage" if foreign else ""
    else:
        found = foreign_kind(path)
        kind = found[0] if found and found[1] == IMPORT_HINT else ""
    return f": it is {kind}; convert it with slosh import rosbag {path} -o DIR" if kind else ""


def check_no_other(path: Path) -> None:
    """Raises an error, with advice, for a file of a known format other than MCAP.

    Raises:
        SloshBagError: the line says what it is and what to do.
    """
    try:
        kind = foreign_kind(path)
    except SloshFileError as error:
        raise SloshBagError(str(error)) from None
    if kind is not None:
        raise SloshBagError(f"{path}: not an MCAP file: it is {kind[0]}; {kind[1]}")


def files_of(path: Path) -> list[Path]:
    """Returns all MCAP files of a bag, readable or not."""
    if not path.is_dir():
        return [path]
    folder = bag_folder(path)
    return [*folder.glob("*.mcap"), folder / METADATA]


def ordered_files(path: Path, *, damaged: bool = False) -> tuple[list[Path], list[str]]:
    """Returns the files of a bag in recording order, and warnings about the folder.

    Args:
        path: folder or file.
        damaged: take files whose beginning is not that of an MCAP file, too.

    Raises:
        SloshBagError: as `bag_files`.
    """
    warnings: list[str] = []
    folder = bag_folder(path)
    if folder != path:
        warnings.append(f"{path}: reading the bag {folder.name} in it")
        path = folder
    if path.is_dir():
        files = sorted(path.glob("*.mcap"), key=_natural)
        if not files:
            raise SloshBagError(f"{path}: no .mcap file in this folder{import_hint(path)}")
        files = _as_noted(path, files, warnings)
    elif path.is_file():
        files = [path]
    else:
        raise SloshBagError(f"{path}: no such file or folder")
    if not damaged:
        _check_starts(files)
    return files, warnings


def _check_starts(files: list[Path]) -> None:
    starts = [_start(file) for file in files]
    for file, start in zip(files, starts, strict=True):
        if not MAGIC.startswith(start):
            check_no_other(file)
            raise SloshBagError(f"{file}: not an MCAP file")
    if all(len(start) < len(MAGIC) for start in starts):
        what = "empty file" if not starts[0] else f"cut off after {len(starts[0])} bytes"
        raise SloshBagError(f"{files[0]}: {what}")


def _start(file: Path) -> bytes:
    try:
        with file.open("rb") as stream:
            return stream.read(len(MAGIC))
    except OSError as error:
        raise SloshBagError(f"{file}: {error.strerror}") from None


def _natural(path: Path) -> list[tuple[int, str]]:
    parts = re.split(r"(\d+)", path.name)
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in parts]


def folder_facts(path: Path) -> dict[str, str]:
    """Returns the bag metadata stored in metadata.yaml."""
    try:
        custom = _information(path / METADATA)["custom_data"]
        return {str(key): str(value) for key, value in (custom or {}).items()}
    except _UNREADABLE:
        return {}


def _information(noted: Path) -> Any:
    return read_yaml(noted, LONGEST_METADATA).value["rosbag2_bagfile_information"]


def _as_noted(folder: Path, files: list[Path], warnings: list[str]) -> list[Path]:
    """Returns the files in the order of metadata.yaml, if that lists exactly the same files."""
    noted = folder / METADATA
    if isinstance(folder, RemotePath) or not noted.is_file():
        return files
    try:
        entries = _information(noted)["relative_file_paths"]
        names = [Path(str(entry)).name for entry in entries]
    except _UNREADABLE:
        warnings.append(f"{noted}: cannot be read; the files are read in the order of their names")
        return files
    by_name = {file.name: file for file in files}
    lost = [name for name in names if name not in by_name]
    if lost:
        warnings.append(f"{noted}: lists {lost[0]!r}, which does not exist")
    if len(names) == len(files) and set(names) == set(by_name):
        return [by_name[name] for name in names]
    return files
