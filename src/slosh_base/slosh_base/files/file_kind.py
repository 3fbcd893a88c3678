"""Identifies files that are not MCAP files and suggests what to do with them."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from slosh_base.files.errors import SloshFileError

IMPORT_HINT: Final = "convert it with slosh import rosbag"
_UNPACK: Final = "unpack it first"
_STARTS: Final = (
    (b"SQLite format 3\0", "an SQLite file, as rosbag2 writes .db3", IMPORT_HINT),
    (b"#ROSBAG V", "a ROS 1 bag", IMPORT_HINT),
    (
        b"version https://git-lfs",
        "a Git LFS pointer, not the file itself",
        "get the file: git lfs pull",
    ),
    (b"PK\x03\x04", "a zip file", _UNPACK),
    (b"\x1f\x8b", "a gzip file", f"{_UNPACK}: gunzip"),
    (b"\x28\xb5\x2f\xfd", "a zstd file", f"{_UNPACK}: zstd -d"),
    (b"BZh", "a bzip2 file", f"{_UNPACK}: bunzip2"),
    (b"\xfd7zXZ\0", "an xz file", f"{_UNPACK}: xz -d"),
    (b"7z\xbc\xaf\x27\x1c", "a 7z file", _UNPACK),
    (b"Rar!", "a rar file", _UNPACK),
    (b"\x04\x22\x4d\x18", "an lz4 file", f"{_UNPACK}: lz4 -d"),
    (b"%PDF", "a PDF file", "choose another file"),
    (b"\x89PNG", "a picture", "slosh detect reads pictures"),
    (b"\xff\xd8\xff", "a picture", "slosh detect reads pictures"),
    (b"PAR1", "a Parquet file", "choose the bag that it was exported from"),
)
TEXT: Final = "a text file", "choose the bag itself"
_PAGES: Final = (b"<!doctype html", b"<html", b"<?xml")
_HEAD = 4096
_TAR_PLACE, _TAR = 257, b"ustar"


def foreign_kind(path: Path) -> tuple[str, str] | None:
    """Describes the format of a non-MCAP file and what to do, or returns None if unknown.

    A damaged MCAP file cannot be told from its first bytes, but its content is no text.

    Raises:
        SloshFileError: it cannot be read.
    """
    try:
        with path.open("rb") as stream:
            head = stream.read(_HEAD)
    except OSError as error:
        raise SloshFileError(f"{path}: {error.strerror}") from None
    for start, what, remedy in _STARTS:
        if head.startswith(start):
            return what, remedy
    if head[_TAR_PLACE:].startswith(_TAR):
        return "a tar file", f"{_UNPACK}: tar -xf"
    if head.lstrip().lower().startswith(_PAGES):
        return "a web page", (
            "the download is a web page instead of the file: sign in, or download it again"
        )
    if head and not head.strip(b"\0"):
        return "a file of zeros", "the copy was interrupted; copy it again"
    if head and _is_text(head):
        return TEXT
    return None


def _is_text(head: bytes) -> bool:
    try:
        text = head.decode("utf-8", "strict" if len(head) < _HEAD else "ignore")
    except UnicodeDecodeError:
        return False
    return all(mark.isprintable() or mark in "\t\r\n\f" for mark in text)
