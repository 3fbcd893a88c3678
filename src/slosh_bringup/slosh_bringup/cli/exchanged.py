"""Files that stand in each other's place on the command line."""

from __future__ import annotations

import argparse
from pathlib import Path

from slosh_bringup.errors import SloshBringupError

MODEL = (".yaml", ".yml")
TABLE = (".csv", ".csv.gz", ".txt", ".tsv")
AFTER_MODEL = ("motion", "path", "trajectories")
"""Arguments that name tables and follow MODEL."""


def check_order(arguments: argparse.Namespace) -> None:
    """Refuses a table as MODEL, and a model where a table is needed.

    Raises:
        SloshBringupError: with the command as it is meant, where both are exchanged.
    """
    model = getattr(arguments, "model", None)
    for name in AFTER_MODEL:
        given = getattr(arguments, name, None)
        tables = given if isinstance(given, list) else [given]
        found = [one for one in tables if isinstance(one, Path) and _ends(one, MODEL)]
        if not found or not isinstance(model, Path):
            continue
        if _ends(model, TABLE):
            raise SloshBringupError(
                f"MODEL and {_shown(name)} are exchanged; type: slosh {arguments.command} "
                f"{found[0]} {model}"
            )
        raise SloshBringupError(
            f"{found[0]}: is a model, but {_shown(name)} must be a table; only the first "
            "argument is a MODEL"
        )
    if isinstance(model, Path) and _ends(model, TABLE):
        raise SloshBringupError(f"{model}: is a table, but MODEL must be a model.yaml")


def _ends(path: Path, endings: tuple[str, ...]) -> bool:
    return path.name.lower().endswith(endings)


def _shown(name: str) -> str:
    return {"trajectories": "TRAJECTORY"}.get(name, name.upper())
