"""Basis functions for the shape of the contact line in a side view.

Over a rectangle's face a steady acceleration inclines a line, and linear theory adds the standing
waves cos(n pi (x + w/2) / w) [Ibrahim 2005; Faltinsen and Timokha 2009]. On a round wall all first
modes are a cos and a sine of the azimuth; their second order adds those of twice the azimuth
[Faltinsen and Timokha 2009, ch. 9]. Seen from the side the sine is a line and the cosine a bow
that stands on both ends, where the wall turns away.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from slosh_camera.optics.box import BoxView
from slosh_camera.optics.round_body import RoundView

FloatArray = NDArray[np.float64]

MODES = 3
FUNCTIONS = 2 + MODES
BOW = 2
"""Number of the function that is a round wall's bow."""
_FLAT_PRIOR = np.array([np.inf, 0.5, 0.5, 0.15, 0.08])
_ROUND_PRIOR = np.array([np.inf, 0.5, 0.5, 1.0, 1.0])
_SECOND_ORDER, _AT_REST = 0.02, 1e-6


@dataclass(frozen=True, slots=True)
class Waves(ABC):
    """Basis functions of the contact line for one type of container.

    Attributes:
        width: that the line has at rest [m].
        is_round: whether they are those on a round wall.
    """

    width: float
    is_round: ClassVar[bool] = False

    @abstractmethod
    def basis(self, x: FloatArray) -> FloatArray:
        """Returns the basis functions (N, FUNCTIONS) at distances x (N,) from the middle [m]."""

    @property
    @abstractmethod
    def prior(self) -> FloatArray:
        """Expected amplitude (FUNCTIONS,) of each basis function [m], used as a prior."""


@dataclass(frozen=True, slots=True)
class FlatWaves(Waves):
    """Basis functions of the contact line on a rectangular container's face."""

    def basis(self, x: FloatArray) -> FloatArray:
        """Returns level, straight line and sloshing modes at positions x (N,) [m]."""
        phase = np.pi * (x / self.width + 0.5)
        functions = np.empty((x.size, FUNCTIONS))
        functions[:, 0] = 1.0
        functions[:, 1] = 2.0 * x / self.width
        functions[:, 2] = np.cos(phase)
        # cos 2p and cos 3p by cos p; a cosine costs as much as all else here.
        functions[:, 3] = 2.0 * functions[:, 2] ** 2 - 1.0
        functions[:, 4] = functions[:, 2] * (2.0 * functions[:, 3] - 1.0)
        return functions

    @property
    def prior(self) -> FloatArray:
        """Expected amplitude of each basis function [m], proportional to the width."""
        return _FLAT_PRIOR * self.width


@dataclass(frozen=True, slots=True)
class RoundWaves(Waves):
    """Basis functions of the contact line on a round wall.

    Attributes:
        bore: inner radius as a part of the outer one.
        index: of the wall.
        second_order: expected size of the second order, as a part of the width.
    """

    is_round: ClassVar[bool] = True

    bore: float
    index: float
    second_order: float = _SECOND_ORDER

    def at_rest(self) -> RoundWaves:
        """Returns the basis without second-order waves, which occur only in moving liquid."""
        return replace(self, second_order=_AT_REST)

    def basis(self, x: FloatArray) -> FloatArray:
        """Returns constant and Fourier terms of the wall azimuth at positions x (N,) [m]."""
        sine, cosine = self._azimuth(x)
        columns = (np.ones(x.size), sine, cosine, 1.0 - 2.0 * sine**2, 2.0 * sine * cosine)
        return np.column_stack(columns)

    @property
    def prior(self) -> FloatArray:
        """Expected amplitude of each basis function [m], proportional to the width."""
        prior: FloatArray = _ROUND_PRIOR * self.width
        prior[3:] *= self.second_order
        return prior

    def _azimuth(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Returns sine and cosine of the wall azimuths that are seen at positions x.

        A ray that meets the outer wall so far from the axis keeps n times its distance in the
        wall (Bouguer); its azimuth changes by the difference of the angles at both sides.
        """
        side = np.clip(2.0 * x / self.width, -1.0, 1.0)
        inside = np.clip(side / (self.index * self.bore), -1.0, 1.0)
        azimuth = np.arcsin(side) - np.arcsin(side / self.index) + np.arcsin(inside)
        return np.sin(azimuth), np.cos(azimuth)


def waves_of(view: BoxView) -> Waves:
    """Returns the basis functions for the container in a side view."""
    if isinstance(view, RoundView):
        return RoundWaves(view.box.width, view.bore, view.box.wall_refractive_index)
    return FlatWaves(view.box.width)
