"""A measured motion: the container's inputs and the measured heights of the liquid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slosh_base.types import Array
from slosh_discovery.discover.tuning import TUNING
from slosh_discovery.errors import SloshDiscoveryError
from slosh_model.for_notebooks import peak, span
from slosh_model.simulate import Inputs

_HARDEST = 1e5
"""Acceleration of a container [m/s²]: beyond, it is another unit or damage."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class MeasuredMotion:
    """A motion of the container, with the measured heights of the liquid.

    >>> t = np.linspace(0.0, 2.0, 201)
    >>> still = Inputs(t, np.zeros((201, 3)))
    >>> float(MeasuredMotion("still", still, t, msh=np.zeros(201)).peak_heights.max())  # m
    0.0

    Attributes:
        name: for people; the file's name or the bag's with the motion's number.
        inputs: the container's motion, from rest.
        t: (M,) times of the measured samples, strictly increasing [s].
        msh: (M,) measured maximum height above the still level [m], NaN: no sample; None where
            wall heights by azimuth are given instead.
        eta_azimuth: (K,) azimuths of the measured wall heights from the container's +x [rad].
        eta: (M, K) measured wall heights above the still level [m], NaN: no sample.
        profile_x: (I,) places of a profile seen from the side, from the middle along x [m].
        profile: (M, I) measured heights of the surface there [m], NaN: no sample; what `eta` was
            taken from, for indices of the surface's shape.
        stddev: (M,) the sensor's own standard deviation [m], NaN: unknown; None: never known.
        same_clock: whether t is the inputs' clock; otherwise an unknown small offset lies between.
        level_known: whether the heights' zero is the still level; otherwise it is unknown.
        group: of motions that were measured with one set-up of sensors and rig; None: unknown.

    Raises:
        SloshDiscoveryError: shapes that do not match, too few samples, neither or both kinds of
            heights, heights that cannot be metres; the text names the motion.
    """

    name: str
    inputs: Inputs
    t: Array
    msh: Array | None = None
    eta_azimuth: Array | None = None
    eta: Array | None = None
    profile_x: Array | None = None
    profile: Array | None = None
    stddev: Array | None = None
    same_clock: bool = True
    level_known: bool = True
    group: str | None = None

    def __post_init__(self) -> None:
        if (self.msh is None) == (self.eta is None):
            raise SloshDiscoveryError(
                f"{self.name}: a motion has either msh or wall heights by azimuth"
            )
        rows = len(self.t)
        if np.any(np.diff(self.t) <= 0.0):
            raise SloshDiscoveryError(f"{self.name}: the times of the heights do not increase")
        if self.msh is not None and self.msh.shape != (rows,):
            raise SloshDiscoveryError(
                f"{self.name}: msh {self.msh.shape} does not match t ({rows},)"
            )
        if self.eta is not None and (
            self.eta_azimuth is None or self.eta.shape != (rows, len(self.eta_azimuth))
        ):
            raise SloshDiscoveryError(
                f"{self.name}: eta {self.eta.shape} does not match t, azimuth"
            )
        if np.count_nonzero(np.isfinite(self.heights)) < TUNING.least_motion:
            raise SloshDiscoveryError(
                f"{self.name}: fewer than {TUNING.least_motion} measured heights: "
                "nothing to compare"
            )

        highest = float(np.nanmax(np.abs(self.heights)))
        if highest > TUNING.highest:
            raise SloshDiscoveryError(
                f"{self.name}: heights reach {highest:.4g} m; they must be given in metres"
            )
        hardest = float(np.nanmax(np.abs(self.inputs.acceleration), initial=0.0))
        if hardest > _HARDEST:
            raise SloshDiscoveryError(
                f"{self.name}: accelerations reach {hardest:.4g} m/s², more than any robot's; "
                "they must be given in m/s²"
            )

    def __repr__(self) -> str:
        found = peak(self.t, self.peak_heights, "measured")
        return f"MeasuredMotion({self.name}: {span(self.t)}, {found})"

    @property
    def heights(self) -> Array:
        """Measured liquid heights [m]: maximum (M, 1), or at the wall by azimuth (M, K)."""
        if self.msh is not None:
            return self.msh[:, np.newaxis]
        assert self.eta is not None  # by construction
        return self.eta

    @property
    def peak_heights(self) -> Array:
        """Measured maximum heights (M,) [m]; NaN where nothing was measured."""
        finite = np.isfinite(self.heights)
        filled = np.where(finite, self.heights, -np.inf).max(axis=1)
        return np.where(finite.any(axis=1), filled, np.nan)
