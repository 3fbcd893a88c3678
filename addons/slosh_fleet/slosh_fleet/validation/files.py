"""Computes and checks the SHA-256 digests of the files that a validation report names."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from slosh_bag.mcap_files.bag_folder import files_of
from slosh_base.files import naming
from slosh_fleet.validation.content import SignedFile


class FileState(NamedTuple):
    """Result of comparing a file with the digest in a validation report.

    Attributes:
        path: as the report has it.
        state: "same", "changed" or "missing".
        place: where it was found; None: nowhere.
    """

    path: str
    state: str
    place: Path | None


def signed_file(path: Path, role: str) -> SignedFile:
    """Reads a file and returns its role, path, size and digest.

    Raises:
        OSError: it cannot be read.
    """
    return SignedFile(role, path.as_posix(), path.stat().st_size, _sha256(path))


def bag_files(bag: Path) -> tuple[SignedFile, ...]:
    """Returns the paths, sizes and digests of all files of a bag.

    Raises:
        OSError: one cannot be read.
    """
    return tuple(signed_file(path, "recording") for path in sorted(files_of(bag)))


def check_files(
    content: Mapping[str, Any], report: Path, folders: Iterable[Path]
) -> tuple[FileState, ...]:
    """Compares files with the digests that a validation report gives for them.

    A file is looked for at its path, seen from the working directory and from the report's
    folder, then in other folders by its name: a recording that was moved is found there.

    Args:
        content: the signed content.
        report: file of the report.
        folders: where files may lie instead, at any depth.

    Raises:
        OSError: a file that exists cannot be read.
    """
    moved = [path for folder in folders for path in sorted(folder.rglob("*")) if path.is_file()]
    files = content.get("files")
    if not isinstance(files, list):
        return ()
    return tuple(_state(file, report, moved) for file in files if isinstance(file, Mapping))


def _state(file: Mapping[str, Any], report: Path, moved: Iterable[Path]) -> FileState:
    path = Path(str(file.get("path", "")))
    places = [path, report.parent / path, *(one for one in moved if one.name == path.name)]
    found = [place for place in places if place.is_file()]
    for place in found:
        if _is_same(place, file):
            return FileState(str(path), "same", place)
    return (
        FileState(str(path), "changed", found[0])
        if found
        else FileState(str(path), "missing", None)
    )


def _is_same(place: Path, file: Mapping[str, Any]) -> bool:
    return place.stat().st_size == file.get("size") and _sha256(place) == file.get("sha256")


def _sha256(path: Path) -> str:
    with naming(path), path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
