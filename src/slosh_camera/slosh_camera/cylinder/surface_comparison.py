"""What an image may show, compared with what the images before foretell."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from slosh_camera.cylinder.surface_choice import SurfaceChooser
from slosh_camera.cylinder.surface_evidence import SurfaceFit, Unrolled, WallPoints
from slosh_camera.cylinder.surface_memory import Expected
from slosh_camera.cylinder.surface_prior import Prior
from slosh_camera.measurement import Flag

FloatArray = NDArray[np.float64]

# How plausible a surface must be that the front line alone does not tell: fits to pictures without
# a surface that can be told reach less.
_BELIEVED = 0.0
# How plausible one must be that the images before foretell, within a standard deviation, and by
# how much more it must agree than others.
_BELIEVED_FORETOLD, _FORETOLD, _CLEARLY = -0.75, 1.0, 0.1
# Up to this deviation from what was foretold it is not asked what else an image with a clear front
# line may show, and beyond the second the liquid cannot have moved so fast [standard deviations].
_USUAL, _JUMP = 2.0, 4.5
# What it adds to a surface that nearly all of the front line agrees with it.
_CERTAINLY = 0.2
# Two surfaces are others where their first modes lie so far apart [rows].
_OTHER = 5.0


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A surface that an image may show.

    Attributes:
        view: the picture.
        fit: the surface and its edges.
        plausible: how well they agree with the picture, to be compared with other candidates.
    """

    view: Unrolled
    fit: SurfaceFit
    plausible: float


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """What an image shows by itself, before it is compared with the images before.

    Attributes:
        seen: pictures of the wall with the points of the front line.
        candidates: surfaces fitted to them; none where no liquid can be told.
        certain: the front line leaves no choice between surfaces.
        flags: why no liquid can be told.
    """

    seen: tuple[tuple[Unrolled, WallPoints], ...] = ()
    candidates: tuple[Candidate, ...] = ()
    certain: bool = False
    flags: Flag = Flag.NONE


@dataclass(frozen=True, slots=True, eq=False)
class Choice:
    """The surface that an image shows.

    Attributes:
        candidate: which.
        believed: it agrees with the picture well enough to be one.
        decided: the images before decided for it.
        jumped: it is not where the images before let it be.
    """

    candidate: Candidate
    believed: bool
    decided: bool = False
    jumped: bool = False


class SurfaceComparison:
    """Chooses between the surfaces that an image may show."""

    def __init__(self, chooser: SurfaceChooser, prior: Prior, footprint: float) -> None:
        """Keep what candidates are fitted with.

        Args:
            chooser: makes candidates.
            prior: of the heights; its centre is the surface at rest.
            footprint: of a sample on the wall [m].
        """
        self._chooser, self._prior, self._footprint = chooser, prior, footprint

    def sighting(self, seen: tuple[tuple[Unrolled, WallPoints], ...]) -> Sighting:
        """The candidates of an image: one where its front line leaves no choice."""
        for view, points in seen:
            fit = self._chooser.fit_certain(view, points, self._prior)
            if fit is not None:
                return Sighting(seen, (Candidate(view, fit, np.inf),), certain=True)
        return Sighting(seen, self._several(seen))

    def choose(self, sighting: Sighting, expected: Expected | None) -> Choice:
        """The surface that a sighting with candidates shows.

        Args:
            sighting: what the image shows by itself.
            expected: from the images before; None: nothing is known.
        """
        best = max(sighting.candidates, key=lambda entry: entry.plausible)
        if expected is None:
            return Choice(best, best.plausible >= _BELIEVED)
        usual = expected.distance(self.first(best.fit)) < _USUAL
        if sighting.certain and usual:
            return Choice(best, True)
        return self._compared(
            sighting.candidates if usual else self._more(sighting, expected), expected
        )

    def first(self, fit: SurfaceFit) -> FloatArray:
        """A surface's first mode above rest, (2,) [m]."""
        return (fit.heights - self._prior.centre)[1:3]

    def _several(self, seen: tuple[tuple[Unrolled, WallPoints], ...]) -> tuple[Candidate, ...]:
        return tuple(
            Candidate(view, *found)
            for view, points in seen
            for found in self._chooser.fit_several(view, points, self._prior)
        )

    def _more(self, sighting: Sighting, expected: Expected) -> tuple[Candidate, ...]:
        """Candidates of an image whose best one is far from what was foretold."""
        candidates = sighting.candidates
        if sighting.certain:
            (sure,) = candidates
            plausible = self._chooser.plausible(sure.view, sure.fit, self._prior) + _CERTAINLY
            candidates = (replace(sure, plausible=plausible), *self._several(sighting.seen))
        start = self._prior.centre.copy()
        start[1:3] += expected.first
        foretold = (
            Candidate(view, *found)
            for view, points in sighting.seen
            for found in self._chooser.fit_near(view, points, self._prior, start)
        )
        return (*candidates, *foretold)

    def _compared(self, candidates: tuple[Candidate, ...], expected: Expected) -> Choice:
        """The surface that agrees best with the picture and with what was foretold."""
        agreement = [
            entry.plausible - expected.surprise(self.first(entry.fit)) for entry in candidates
        ]
        index = int(np.argmax(agreement))
        chosen = candidates[index]
        place = self.first(chosen.fit)
        others = [
            k
            for k, entry in enumerate(candidates)
            if float(np.hypot(*(self.first(entry.fit) - place))) > _OTHER * self._footprint
        ]
        distance = expected.distance(place)
        clear = all(agreement[k] < agreement[index] - _CLEARLY for k in others)
        foretold = clear and distance < _FORETOLD and chosen.plausible >= _BELIEVED_FORETOLD
        by_itself = chosen.plausible >= _BELIEVED
        decided = not by_itself or any(candidates[k].plausible > chosen.plausible for k in others)
        return Choice(chosen, by_itself or foretold, decided, distance > _JUMP)
