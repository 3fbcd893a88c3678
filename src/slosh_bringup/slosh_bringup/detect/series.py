"""Finds and orders the image sequence among the files of a folder."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

IMAGE_ENDINGS = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")
_NUMBER = re.compile(r"\d+")
_USUAL = re.compile(r"(frame|image|img)", re.IGNORECASE)


def natural_order(path: Path) -> tuple[list[tuple[int, str]], str]:
    """Returns a sort key that puts frame_2 before frame_10."""
    parts = re.split(r"(\d+)", path.name)
    key = [(int(part), "") if part.isdecimal() else (-1, part) for part in parts]
    return key, path.name


def images_in(folder: Path) -> list[Path]:
    """Returns the image files of a folder in natural order, without hidden files."""
    files = (
        file
        for file in folder.iterdir()
        if file.suffix.lower() in IMAGE_ENDINGS and not file.name.startswith(".")
    )
    return sorted((file for file in files if file.is_file()), key=natural_order)


def longest_series(files: Sequence[Path]) -> tuple[list[Path], str]:
    """Finds the longest numbered sequence among image files, and describes ignored files.

    Files belong together whose names differ in one number alone: frame_000.jpg, frame_001.jpg, …
    are one series, mask_000.png, … another. Of equally long ones that wins whose name begins with
    frame, image or img. Without any series all files are taken.

    Args:
        files: in natural order.

    Returns:
        The files, in the same order, and what was left out, in words; empty: nothing.
    """
    series: dict[str, list[Path]] = {}
    for key, file in zip(_keys(files), files, strict=True):
        series.setdefault(key, []).append(file)
    ordered = sorted(series, key=lambda key: (-len(series[key]), not _USUAL.match(key), key))
    chosen = ordered[0]
    if len(ordered) == 1 or len(series[chosen]) == 1:
        return list(files), ""
    rest = ", ".join(_told(key, series[key]) for key in ordered[1:4])
    more = f" and {len(ordered) - 4} more" if len(ordered) > 4 else ""
    return series[chosen], f"measuring {_told(chosen, series[chosen])}; left out: {rest}{more}"


def _told(key: str, files: Sequence[Path]) -> str:
    return files[0].name if len(files) == 1 else f"{len(files)} images {key}"


def _keys(files: Iterable[Path]) -> list[str]:
    """Returns the sequence name of each file: its name with # in place of the image number.

    Names of one shape may hold several numbers. The one with the most values counts; of the
    others, those that end a word (cam2_) name a series, and the rest (dates, seconds) count too.
    """
    names = [file.name for file in files]
    shapes: dict[str, list[str]] = {}
    for name in names:
        shapes.setdefault(_shape(name), []).append(name)
    counting = {shape: _most_values(members) for shape, members in shapes.items()}
    return [_key(name, counting[_shape(name)]) for name in names]


def _shape(name: str) -> str:
    return _NUMBER.sub("#", name).lower()


def _most_values(names: Sequence[str]) -> int:
    """Returns the index of the number in the file names that takes the most different values."""
    columns = list(zip(*(_NUMBER.findall(name) for name in names), strict=True))
    return max(range(len(columns)), key=lambda k: (len(set(columns[k])), k), default=0)


def _key(name: str, counting: int) -> str:
    found = list(_NUMBER.finditer(name))
    key, at = "", 0
    for index, match in enumerate(found):
        names_series = index != counting and name[: match.start()][-1:].isalpha()
        key += name[at : match.start()] + (match.group() if names_series else "#")
        at = match.end()
    return key + name[at:]
