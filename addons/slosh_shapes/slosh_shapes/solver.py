"""What the containers of slosh_model.shapes ask for: their modes, kept on disk or computed.

Those of another fill height are interpolated between computed ones.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import math
from collections.abc import Sequence
from dataclasses import asdict, replace
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, cast

import numpy as np

from slosh_base.compiled.compile_cache import cache_folder
from slosh_base.files import write_bytes
from slosh_model.errors import SloshModelError
from slosh_model.shapes import mode_numbers
from slosh_model.shapes.mode_numbers import LEAST, NAMES, ModeNumbers
from slosh_model.shapes.solved import ModeTable, SolvedContainer, solved_modes
from slosh_shapes.axisymmetric import revolution_modes
from slosh_shapes.finite_elements import available
from slosh_shapes.plane import plane_modes, prism_modes
from slosh_shapes.trough import trough_modes

__all__ = [
    "available",
    "plane_modes",
    "prism_modes",
    "read",
    "refilled",
    "revolution_modes",
    "trough_modes",
    "write",
]

NEAR, NODES = 0.03, 7
"""Distance [m] up to which modes of another fill height are interpolated, and between how many
fill heights that are computed."""
_KINKED = ("crest_ratio", "crest_place")
"""Not smooth where a crest begins to be inside."""


@cache
def _version() -> str:
    """Returns a digest of the source code that computes the modes."""
    digest = hashlib.sha256()
    for folder in (Path(__file__).parent, Path(mode_numbers.__file__).parent):
        for path in sorted(folder.glob("*.py")):
            digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


def _path(key: str) -> Path:
    return cache_folder() / f"modes-{_version()}-{key}.json"


def read(key: str) -> tuple[ModeNumbers, ...] | None:
    """Reads modes from the cache, or returns None if they are missing or incomplete."""
    try:
        rows = json.loads(_path(key).read_bytes())
        return tuple(
            ModeNumbers(**{**row, "surface": tuple((r, h) for r, h in row["surface"])})
            for row in rows
        )
    except (OSError, ValueError, TypeError, KeyError, SloshModelError):
        return None


def write(key: str, modes: tuple[ModeNumbers, ...]) -> None:
    """Writes computed modes to the cache on disk; ignores write errors."""
    text = json.dumps([asdict(mode) for mode in modes])
    with contextlib.suppress(OSError):
        write_bytes(_path(key), text.encode(), sync=False)


def refilled(container: SolvedContainer, filled: SolvedContainer) -> SolvedContainer:
    """Returns the container with another fill height with its modes, if that is close.

    Args:
        container: as it was.
        filled: the same with another fill height, of which no modes are known.

    Raises:
        SloshModelError: modes cannot be computed.
    """
    at, rows = _neighbours(replace(cast(Any, container), rim_height=None, table=None))
    if not at[0] <= filled.fill_height <= at[-1]:
        return filled
    table = ModeTable(filled.digest, interpolated(at, _alike(rows), filled.fill_height))
    return cast("SolvedContainer", replace(cast(Any, filled), table=table))


@lru_cache(maxsize=64)
def _neighbours(
    container: SolvedContainer,
) -> tuple[tuple[float, ...], tuple[tuple[ModeNumbers, ...], ...]]:
    """Returns fill heights [m] below and above the container's, and the modes at each of them."""
    middle = container.fill_height
    reach = min(NEAR, 0.6 * middle, 0.6 * (container.highest_fill - middle))
    turns = (math.cos(math.pi * k / (NODES - 1)) for k in reversed(range(NODES)))
    at = tuple(middle + reach * turn for turn in turns)
    changed = (replace(cast(Any, container), fill_height=height) for height in at)
    return at, tuple(solved_modes(one, LEAST) for one in changed)


def _alike(rows: Sequence[tuple[ModeNumbers, ...]]) -> list[tuple[ModeNumbers, ...]]:
    """Returns, for each tabulated fill height, the modes that keep their order by frequency.

    Modes in order of frequency change places as the fill height changes.
    """
    kept: list[int] = []
    for axis in (0, 1):
        for index in [k for k, mode in enumerate(rows[0]) if mode.axis == axis]:
            if len({row[index].turns for row in rows}) > 1:
                break
            kept.append(index)
    return [tuple(row[index] for index in kept) for row in rows]


def interpolated(
    at: Sequence[float], rows: Sequence[Sequence[ModeNumbers]], place: float
) -> tuple[ModeNumbers, ...]:
    """Interpolates mode constants by a polynomial through those at several fill heights.

    Args:
        at: (N,) increasing.
        rows: (N,) the modes at each, in the same order.
        place: between the first and the last.
    """
    weights = [
        math.prod((place - b) / (a - b) for m, b in enumerate(at) if m != k)
        for k, a in enumerate(at)
    ]
    found = []
    for same in zip(*rows, strict=True):
        values = {}
        for name in NAMES:
            column = [getattr(one, name) for one in same]
            values[name] = (
                float(np.interp(place, at, column)) if name in _KINKED
                else math.fsum(w * value for w, value in zip(weights, column, strict=True))
            )  # fmt: skip
        found.append(ModeNumbers(**values | {"axis": same[0].axis}))
    return tuple(found)
