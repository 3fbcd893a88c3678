"""Checks the names of picture files that a command writes."""

from __future__ import annotations

from pathlib import Path

from slosh_bringup.errors import SloshBringupError

PICTURES = (".png", ".svg")


def check_picture(path: Path | None) -> None:
    """Raises an error if a picture file has an unknown format; accepts None.

    Raises:
        SloshBringupError: its name has another ending.
    """
    if path is not None and path.suffix not in PICTURES:
        raise SloshBringupError(f"{path}: a picture must end in {' or '.join(PICTURES)}")
