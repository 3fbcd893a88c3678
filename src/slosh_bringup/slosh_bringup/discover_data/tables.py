"""Motion tables as measured motions: one table, one motion."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from slosh_bag.motion_table import MotionTable, read_motion_table
from slosh_bringup.discover_data.heights import without_spikes
from slosh_bringup.errors import SloshBringupError
from slosh_discovery.discover.motion import MeasuredMotion
from slosh_model.simulate import Inputs

SUFFIXES = (".csv", ".csv.gz")


def is_table(path: Path) -> bool:
    """Whether a path's name is a motion table's."""
    return path.name.lower().endswith(SUFFIXES)


def table_motion(path: Path, tell: Callable[[str], object]) -> MeasuredMotion:
    """A table's motion.

    Args:
        path: `.csv` or `.csv.gz`.
        tell: is told what is left out, one line each.

    Raises:
        SloshBagError: the table cannot be read.
        SloshBringupError: it holds no measured heights.
        SloshDiscoveryError: it holds too few of them.
    """
    name = path.name
    for suffix in reversed(SUFFIXES):
        name = name.removesuffix(suffix)
    return motion_of_table(path, name, read_motion_table(path), tell)


def motion_of_table(
    path: Path, name: str, table: MotionTable, tell: Callable[[str], object]
) -> MeasuredMotion:
    """The motion that a table's values tell; of msh and wall heights the latter, which say more.

    Args:
        path: where the table comes from; for what is said of it.
        name: of the motion.
        table: the table.
        tell: is told what is left out, one line each.

    Raises:
        SloshBringupError: no measured heights.
        SloshDiscoveryError: too few of them.
    """
    inputs = Inputs(table.t, table.acceleration, table.attitude, table.angular_velocity)
    if table.eta is not None:
        rows = np.isfinite(table.eta).any(axis=1)
        return MeasuredMotion(
            name, inputs, table.t[rows], eta_azimuth=table.eta_azimuth, eta=table.eta[rows]
        )
    if table.msh is None:
        raise SloshBringupError(
            f"{path}: holds no measured heights; add a column msh or columns eta_000 … eta_359"
        )
    # Spikes are looked for among samples: rows of the input alone lie between them.
    sampled = np.isfinite(table.msh)
    t, msh = table.t[sampled], table.msh[sampled]
    clean, spikes = without_spikes(msh)
    if spikes:
        tell(f"{path}: {spikes} single spikes of the measured height are left out")
    kept = np.isfinite(clean)
    return MeasuredMotion(name, inputs, t[kept], msh=clean[kept])
