"""Compares candidate surfaces of an image with the prediction from earlier images."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slosh_camera.cylinder.surface import Prior, SurfaceFit, Unrolled, WallPoints
from slosh_camera.cylinder.surface_choice import SurfaceChooser
from slosh_camera.cylinder.surface_memory import ExpectedMode
from slosh_camera.cylinder.tuning import TUNING
from slosh_camera.images.seams import NO_STEPS, Steps
from slosh_camera.measurement import Flag

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class CandidateSurface:
    """A candidate for the free surface in an image, with its score.

    Attributes:
        plausible: how well they agree with the picture, to be compared with other candidates.
        changed: what it was fitted with, where the level may differ from that of the surface at
            rest; None: the usual prior.
    """

    view: Unrolled
    fit: SurfaceFit
    plausible: float
    changed: Prior | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """Analysis of a single image, before it is compared with earlier images.

    Attributes:
        seen: pictures of the wall with the points of the contact line.
        candidates: surfaces fitted to them; none where no liquid can be told.
        certain: the contact line leaves no choice between surfaces.
        flags: why no liquid can be told.
        steps: sharp steps of the image, which may be those of a seam.
    """

    seen: tuple[tuple[Unrolled, WallPoints], ...] = ()
    candidates: tuple[CandidateSurface, ...] = ()
    certain: bool = False
    flags: Flag = Flag.NONE
    steps: Steps = NO_STEPS


@dataclass(frozen=True, slots=True, eq=False)
class ChosenSurface:
    """The surface that was chosen for an image.

    Attributes:
        believed: it agrees with the picture well enough to be one.
        decided: the images before decided for it.
        jumped: it is not where the images before let it be.
        doubtful: another surface agrees hardly less, or this one far less than the surface at rest
            does with the still image.
    """

    candidate: CandidateSurface
    believed: bool
    decided: bool = False
    jumped: bool = False
    doubtful: bool = False


class SurfaceComparison:
    """Chooses between the candidate surfaces of an image.

    Attributes:
        prior: of the heights; its centre is the surface at rest.
    """

    def __init__(
        self, chooser: SurfaceChooser, prior: Prior, footprint: float, at_rest: float = -np.inf
    ) -> None:
        """Stores the priors with which candidate surfaces are fitted.

        Args:
            footprint: of a sample on the wall [m].
            at_rest: how plausible the surface at rest makes the still image; -inf: there is none.
        """
        self._chooser, self.prior = chooser, prior
        self._changed = prior.at_rest_on_changed_level(), prior.of_changed_level()
        self._footprint, self._at_rest = footprint, at_rest
        self._least = at_rest - TUNING.worse if np.isfinite(at_rest) else TUNING.level_believed

    def sighting(self, seen: tuple[tuple[Unrolled, WallPoints], ...]) -> Sighting:
        """Returns the candidate surfaces of an image; a single one if it is unambiguous."""
        for view, points in seen:
            fit = self._chooser.fit_certain(view, points, self.prior)
            if fit is None:
                continue
            if self._chooser.plausible(view, fit, self.prior) >= self._at_rest - TUNING.worse:
                return Sighting(seen, (CandidateSurface(view, fit, np.inf),), certain=True)
            return Sighting(seen, (self._sure(view, fit), *self._several(seen)))
        return Sighting(seen, self._several(seen))

    def choose(self, sighting: Sighting, expected: ExpectedMode | None) -> ChosenSurface:
        """Chooses the most plausible candidate surface of an image.

        Args:
            sighting: what the image shows by itself.
            expected: from the images before; None: nothing is known.
        """
        plausible = [entry.plausible for entry in sighting.candidates]
        best = sighting.candidates[self._fullest(sighting.candidates, plausible)]
        if expected is None:
            others = self._others(sighting.candidates, best)
            next_best = max((plausible[k] for k in others), default=-np.inf)
            doubtful = self._is_doubtful(best, best.plausible - next_best)
            return ChosenSurface(best, best.plausible >= 0.0, doubtful=doubtful)
        usual = expected.distance(self.first(best.fit)) < TUNING.usual
        if sighting.certain and usual:
            return ChosenSurface(best, True)
        return self._compared(
            sighting.candidates if usual else self._more(sighting, expected), expected
        )

    def prior_of(self, candidate: CandidateSurface) -> Prior:
        """Returns the prior with which a candidate surface was fitted."""
        return candidate.changed or self.prior

    def level_has_changed(self, candidate: CandidateSurface) -> bool:
        """Whether a changed liquid level is more probable than a wrong detection."""
        heights, changed = candidate.fit.heights, candidate.changed
        return changed is not None and (
            self._chooser.surprise(heights, changed) < self._chooser.surprise(heights, self.prior)
        )

    def first(self, fit: SurfaceFit) -> FloatArray:
        """Returns a surface's first-mode amplitudes (2,), relative to liquid at rest [m]."""
        return (fit.heights - self.prior.centre)[1:3]

    def _several(
        self, seen: tuple[tuple[Unrolled, WallPoints], ...]
    ) -> tuple[CandidateSurface, ...]:
        usual = [
            CandidateSurface(view, *found)
            for view, points in seen
            for found in self._chooser.fit_several(view, points, self.prior)
        ]
        changed = [
            CandidateSurface(view, fit, plausible, changed)
            for view, points in seen
            for changed, fit, plausible in self._chooser.fit_levels(view, points, *self._changed)
            if plausible >= self._least
        ]
        return (*usual, *changed)

    def _more(self, sighting: Sighting, expected: ExpectedMode) -> tuple[CandidateSurface, ...]:
        """Adds candidate surfaces near the prediction to those found in the image."""
        candidates = sighting.candidates
        if sighting.certain:
            (sure,) = candidates
            candidates = (self._sure(sure.view, sure.fit), *self._several(sighting.seen))
        start = self.prior.centre.copy()
        start[1:3] += expected.first
        foretold = (
            CandidateSurface(view, *found)
            for view, points in sighting.seen
            for found in self._chooser.fit_near(view, points, self.prior, start)
        )
        return (*candidates, *foretold)

    def _sure(self, view: Unrolled, fit: SurfaceFit) -> CandidateSurface:
        """Returns a surface that nearly all contact-line points confirm, with a raised score."""
        return CandidateSurface(
            view, fit, self._chooser.plausible(view, fit, self.prior) + TUNING.certainly
        )

    def _compared(
        self, candidates: tuple[CandidateSurface, ...], expected: ExpectedMode
    ) -> ChosenSurface:
        """Chooses the candidate that agrees best with the image and the prediction."""
        agreement = [
            entry.plausible - expected.surprise(self.first(entry.fit)) for entry in candidates
        ]
        index = self._fullest(candidates, agreement)
        chosen = candidates[index]
        others = self._others(candidates, chosen)
        lead = agreement[index] - max((agreement[k] for k in others), default=-np.inf)
        distance = expected.distance(self.first(chosen.fit))
        foretold = (
            lead > TUNING.clearly
            and distance < 1.0
            and chosen.plausible >= TUNING.believed_foretold
        )
        by_itself = chosen.plausible >= 0.0
        decided = not by_itself or any(candidates[k].plausible > chosen.plausible for k in others)
        return ChosenSurface(
            chosen, by_itself or foretold, decided, distance > TUNING.jump,
            doubtful=self._is_doubtful(chosen, lead),
        )  # fmt: skip

    def _fullest(self, candidates: tuple[CandidateSurface, ...], agreement: list[float]) -> int:
        """Returns the index of the best candidate; among similar ones that with the most edges.

        A changed level that agrees hardly less, and with far more edges, is preferred to a wave.
        """
        best = int(np.argmax(agreement))
        others = self._others(candidates, candidates[best])
        least = agreement[best] - TUNING.alike
        alike = [k for k, one in enumerate(agreement) if k not in others and one >= least]
        fullest = max(alike, key=lambda k: candidates[k].fit.edges)
        least, many = (
            agreement[best] - TUNING.hardly,
            TUNING.far_more * candidates[fullest].fit.edges,
        )
        levels = [
            k
            for k in others
            if candidates[k].changed and agreement[k] >= least and candidates[k].fit.edges > many
        ]
        return max(levels, key=lambda k: agreement[k], default=fullest)

    def _is_doubtful(self, chosen: CandidateSurface, lead: float) -> bool:
        """Whether the chosen surface scores too little above other candidates to be reliable."""
        return lead < TUNING.hardly or chosen.plausible < self._at_rest - TUNING.far_worse

    def _others(
        self, candidates: tuple[CandidateSurface, ...], chosen: CandidateSurface
    ) -> list[int]:
        """Returns the indices of candidates that differ clearly from the chosen surface."""
        place, apart = chosen.fit.heights[:3], TUNING.other_rows * self._footprint
        return [
            k
            for k, entry in enumerate(candidates)
            if float(np.linalg.norm(entry.fit.heights[:3] - place)) > apart
        ]
