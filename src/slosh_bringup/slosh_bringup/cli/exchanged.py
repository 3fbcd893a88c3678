"""Files that stand in each other's place on the command line."""

from __future__ import annotations

import argparse
from pathlib import Path

from slosh_bringup.errors import SloshBringupError

MODEL = (".yaml", ".yml")
TABLE = (".csv", ".csv.gz", ".txt", ".tsv")
AFTER_MODEL = ("motion", "path", "trajectories")
"""Arguments that name tables and follow MODEL."""
OTHERS = ("model.yaml", "cell.yaml", "camera.yaml")
"""Files of a cell by their usual names."""


def check_order(arguments: argparse.Namespace) -> None:
    """Refuses a table, a folder or another YAML file as MODEL, a model or a recording as a table.

    Raises:
        SloshBringupError: with the command as it is meant, where two are exchanged.
    """
    _check_kinds(arguments)
    model = getattr(arguments, "model", None)
    for name in AFTER_MODEL:
        found = [one for one in _paths(arguments, name) if _ends(one, MODEL)]
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


def _check_kinds(arguments: argparse.Namespace) -> None:
    """Refuses folders where files belong, and the files of a cell in each other's place."""
    for model in filter(Path.is_dir, _paths(arguments, "model")):
        inside = model / "model.yaml"
        meant = f"; did you mean {inside}?" if inside.is_file() else ""
        raise SloshBringupError(f"{model}: a folder where MODEL belongs, a model.yaml{meant}")
    for name, usual in (("model", "model.yaml"), ("config", "cell.yaml")):
        for path in _paths(arguments, name):
            if path.name in OTHERS and path.name != usual:
                inside = path.with_name(usual)
                meant = f"; did you mean {inside}?" if inside.is_file() else ""
                belongs = f"where {name.upper()} belongs, a {usual}"
                raise SloshBringupError(f"{path}: another file of a cell {belongs}{meant}")
    for name in AFTER_MODEL:
        for table in filter(Path.is_dir, _paths(arguments, name)):
            raise SloshBringupError(
                f"{table}: a folder where {_shown(name)} belongs, a table; a recording's is "
                f"written by slosh export {table} --motion -o motion.csv"
            )


def _paths(arguments: argparse.Namespace, name: str) -> list[Path]:
    """The paths that an argument gives."""
    given = getattr(arguments, name, None)
    return [
        one for one in (given if isinstance(given, list) else [given]) if isinstance(one, Path)
    ]


def _ends(path: Path, endings: tuple[str, ...]) -> bool:
    return path.name.lower().endswith(endings)


def _shown(name: str) -> str:
    return {"trajectories": "TRAJECTORY"}.get(name, name.upper())
