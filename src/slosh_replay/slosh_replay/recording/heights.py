"""Reads measured heights from the FreeSurface messages of a recording."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Array, Integers
from slosh_estimator.azimuth import Surfaces, measured_waves
from slosh_estimator.sight import SATURATED, UNUSABLE
from slosh_motion.recorded.inputs import STAMP, stamps_of

Mask = NDArray[np.bool_]
Columns = Mapping[str, NDArray[Any]]

SURFACE_FIELDS: Final = (*STAMP, "msh", "flags", "msh_stddev", "azimuth")
"""Fields of FreeSurface.msg that `measurements` needs."""
WAVE_FIELDS: Final = (*STAMP, "msh_stddev", *Surfaces._fields)
"""Those with which it tells the waves, too."""


class Measurements(NamedTuple):
    """Measured heights of a recording, as columns.

    Attributes:
        stamps: (N,) [ns].
        heights: (N,) [m]; NaN: none.
        flags: (N,) of FreeSurface.msg.
        stddev: (N,) standard deviation [m]; NaN: unknown.
        azimuth: (N,) of the highest point [rad]; NaN: unknown.
        waves, axes: (N,) of `slosh_estimator.azimuth.measured_waves`; None: unknown.
        levels: (N,) mean height at the left and right edge [m]; None: unknown.
    """

    stamps: Integers
    heights: Array
    flags: Integers
    stddev: Array
    azimuth: Array
    waves: NDArray[np.complex128] | None = None
    axes: Array | None = None
    levels: Array | None = None

    @property
    def unusable(self) -> Mask:
        """Whether each height (N,) is excluded by its validity flags."""
        return np.asarray((self.flags & UNUSABLE) != 0)

    @property
    def saturated(self) -> Mask:
        """Whether each height (N,) is only a lower bound, since the image was cut off."""
        return np.asarray((self.flags & SATURATED) != 0)

    @property
    def usable_heights(self) -> Array:
        """Heights (N,) [m]; NaN where the validity flags exclude a height."""
        return np.where(self.unusable, np.nan, self.heights)

    def chosen(self, rows: NDArray[Any]) -> Measurements:
        """Returns the measurements selected by indices or by a mask."""
        columns: Any = (None if column is None else column[rows] for column in self)
        return Measurements(*columns)

    def in_order(self) -> Measurements:
        """Returns the measurements sorted by stamp; of equal stamps only the first is kept."""
        return self.chosen(np.unique(self.stamps, return_index=True)[1])


def measurements(columns: Columns) -> Measurements:
    """Creates measurements from columns of FreeSurface messages."""
    waves, axes, levels = None, None, None
    if set(Surfaces._fields) <= columns.keys():
        surfaces = Surfaces(*(columns[name] for name in Surfaces._fields))
        (waves, axes), levels = measured_waves(surfaces), surfaces.levels
    return Measurements(
        stamps_of(columns),
        columns["msh"],
        columns["flags"].astype(np.int64),
        columns["msh_stddev"],
        columns["azimuth"],
        waves,
        axes,
        levels,
    )


class HeightCollector:
    """Collects FreeSurface messages as columns.

    Attributes:
        fields: the columns that it takes.
    """

    fields = SURFACE_FIELDS

    def __init__(self) -> None:
        none, whole = np.empty(0), np.empty(0, dtype=np.int64)
        self._parts = [Measurements(whole, none, whole, none, none)]

    def add(self, columns: Columns) -> None:
        """Adds consecutive FreeSurface messages to the collected columns."""
        self._parts.append(measurements(columns))

    def measurements(self) -> Measurements:
        """Returns all measurements in recorded order, without wave directions."""
        columns = zip(*(part[:5] for part in self._parts), strict=True)
        return Measurements(*(np.concatenate(column) for column in columns))
