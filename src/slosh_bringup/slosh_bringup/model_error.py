"""Reads the measured error of a model from the result files of replays and runs."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from slosh_bringup.errors import SloshBringupError
from slosh_plan import ModelError

LARGEST_FILE = 200_000_000
"""Bytes."""


def read_model_error(paths: Sequence[Path], model: str) -> ModelError:
    """Returns a model's largest MAE and largest relative peak error ε in several result files.

    Args:
        paths: NAME.json of `slosh replay -o`, or result.json of `slosh demo` or `slosh cell`.
        model: its name, as 3D-NL.

    Raises:
        SloshBringupError: no such file, or nothing of this model in it.
    """
    sigma = epsilon = 0.0
    for path in paths:
        rows = [row for name, row in _accuracies(_document(path)) if name == model]
        if not rows:
            raise SloshBringupError(
                f"{path}: contains no accuracy figures for model {model}: --error takes "
                "NAME.json of slosh replay -o, or result.json of slosh demo or cell"
            )
        for row in rows:
            sigma = max(sigma, _number(path, row, "sigma"))
            epsilon = max(epsilon, abs(_number(path, row, "epsilon")))
    return ModelError(sigma, epsilon)


def _document(path: Path) -> Any:
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise SloshBringupError(f"{path}: is larger than any result")
        return json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise SloshBringupError(f"{path}: {error.strerror}") from None
    except (ValueError, RecursionError):
        raise SloshBringupError(f"{path}: is not JSON") from None


def _accuracies(document: Any) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yields model names with their accuracy against the camera from a result file."""
    if not isinstance(document, dict):
        return
    replay = document.get("replay")
    told = replay.get("accuracy") if isinstance(replay, dict) else document.get("agreements")
    for row in told if isinstance(told, list) else ():
        if isinstance(row, dict) and isinstance(row.get("name"), str):
            yield row["name"].removesuffix(" / camera"), row


def _number(path: Path, row: dict[str, Any], key: str) -> float:
    value = row.get(key)
    if not isinstance(value, int | float):
        raise SloshBringupError(f"{path}: {key} of {row['name']} is {value!r:.40}, not a number")
    return float(value)
