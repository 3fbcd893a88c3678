"""Checks the names of files that a command writes: the ending says what is in them."""

from __future__ import annotations

from pathlib import Path

from slosh_bringup.errors import SloshBringupError

PICTURES = (".png", ".svg")
YAML, PAGE, TABLE, JUNIT = (".yaml", ".yml"), (".html", ".htm"), (".csv", ".csv.gz"), (".xml",)


def check_picture(path: Path | None) -> None:
    """Raises an error if a picture file has an unknown format; accepts None.

    Raises:
        SloshBringupError: its name has another ending.
    """
    check_ending(path, "a picture", PICTURES)


def check_ending(path: Path | None, what: str, endings: tuple[str, ...]) -> None:
    """Raises an error if the name of an output is that of another kind of file.

    So a motion table is not replaced by a model. A terminal or a pipe may have any name.

    Args:
        path: the output; None: not asked for.
        what: it is, such as 'a model'.
        endings: of such files.

    Raises:
        SloshBringupError: its name has another ending.
    """
    if path is None or (path.exists() and not (path.is_file() or path.is_dir())):
        return
    if not path.name.lower().endswith(endings):
        raise SloshBringupError(f"{path}: {what} must end in {' or '.join(endings)}")
