"""Motion tables as measured motions: one table, one motion."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Array
from slosh_discovery.discover.motion import MeasuredMotion
from slosh_discovery.discover_data.heights import without_spikes
from slosh_discovery.errors import SloshDiscoveryError
from slosh_metrics.input_checks.table_checks import InputDoubt, motion_doubts
from slosh_metrics.surface_metrics import line_slopes
from slosh_model.errors import SloshModelError
from slosh_model.gaps import gap_text
from slosh_model.model import Model
from slosh_tables.motion_table import SUFFIXES, MotionTable, read_motion_table
from slosh_tables.text_table.options import FOUND_OUT, TableOptions
from slosh_tables.text_table.units import check_span


def table_motion(
    path: Path,
    tell: Callable[[str], object],
    model: Model | None = None,
    options: TableOptions = FOUND_OUT,
) -> MeasuredMotion:
    """A table's motion.

    Args:
        path: `.csv` or `.csv.gz`.
        model: whose container a profile was seen in; None: unknown.
        tell: is told what is left out, one line each.
        options: what the user says of the table.

    Raises:
        SloshBagError: the table cannot be read.
        SloshDiscoveryError: it holds no measured heights or too few, or inputs that cannot be.
    """
    name = path.name
    for suffix in reversed(SUFFIXES):
        name = name.removesuffix(suffix)
    return motion_of_table(path, name, read_motion_table(path, options), tell, model)


def motion_of_table(
    path: Path,
    name: str,
    table: MotionTable,
    tell: Callable[[str], object],
    model: Model | None = None,
) -> MeasuredMotion:
    """The motion that a table's values tell.

    Of msh and wall heights the latter are taken: their maximum is the msh, so that nothing is
    lost. Where more moments have an msh than wall heights it is the other way round. A profile
    without either gives the height at the container's +x, on the line that is nearest to it.

    Args:
        path: where the table comes from; for what is said of it.
        name: of the motion.
        table: the table.
        tell: is told what is left out, one line each.
        model: whose container a profile was seen in; None: unknown.

    Raises:
        SloshBagError: it is too long to be simulated.
        SloshDiscoveryError: no measured heights, too few of them, or inputs that cannot be.
    """
    check_span(path, table.t)
    gaps = gap_text(table.t, model) if model is not None else ""
    if gaps:
        tell(InputDoubt(gaps).about(path))
    for doubt in motion_doubts(table.t, table.acceleration, table.attitude):
        tell(doubt.about(path))
    sampled, walls = _sampled(table.msh), _sampled(table.eta)
    if table.msh is None and table.eta is None and table.profile is None:
        raise SloshDiscoveryError(
            f"{path}: holds no measured heights; add a column msh or columns eta_000 … eta_359"
        )
    try:
        if table.msh is None and table.eta is None:
            return _profile_motion(path, name, table, model)
        inputs = table.inputs()
        if table.eta is not None and len(walls) >= len(sampled):
            return MeasuredMotion(
                name, inputs, table.t[walls], eta_azimuth=table.eta_azimuth, eta=table.eta[walls]
            )
        assert table.msh is not None  # its samples outnumber those of the wall
        if len(walls):
            tell(f"{path}: more rows have msh than wall heights: the wall heights are left out")
        # Spikes are looked for among samples: rows of the input alone lie between them.
        clean, spikes = without_spikes(table.msh[sampled])
        if spikes:
            tell(f"{path}: {spikes} single spikes of the measured height are left out")
        kept = np.isfinite(clean)
        return MeasuredMotion(name, inputs, table.t[sampled][kept], msh=clean[kept])
    except (SloshModelError, SloshDiscoveryError) as error:
        raise SloshDiscoveryError(f"{path}: {error}") from None


def _profile_motion(
    path: Path, name: str, table: MotionTable, model: Model | None
) -> MeasuredMotion:
    """The line nearest to each frame of a profile, as the height at +x (TM20, eqs. (11), (12))."""
    if model is None:
        raise SloshDiscoveryError(f"{path}: holds a profile; its width is known only with a model")
    assert table.profile is not None and table.profile_x is not None  # noqa: PT018  # by the caller
    rows = _sampled(table.profile)
    profile = table.profile[rows]
    half = model.container.reaches[0]
    return MeasuredMotion(
        name,
        table.inputs(),
        table.t[rows],
        eta_azimuth=np.zeros(1),
        eta=half * line_slopes(table.profile_x, profile)[:, np.newaxis],
        profile_x=table.profile_x,
        profile=profile,
    )


def _sampled(heights: Array | None) -> NDArray[np.intp]:
    """Rows with a measured height."""
    if heights is None:
        return np.empty(0, dtype=np.intp)
    return np.flatnonzero(np.isfinite(heights.reshape(len(heights), -1)).any(axis=1))
