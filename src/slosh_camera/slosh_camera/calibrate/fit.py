"""The fine fit of a camera's place to the curves of a round container in a still image."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.optimize import least_squares

from slosh_camera.calibrate.curves import (
    EMPTY,
    LEAST_SEPARATION,
    OUTLINE,
    SIDES,
    WETTED,
    Curve,
    SeenCurve,
    axis_distance,
    distances,
    look_for_curves,
    separation,
    view_at,
    width_of,
)
from slosh_camera.calibrate.edges import EdgeImage
from slosh_camera.calibrate.pose import CameraPlace
from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.camera import PinholeCamera
from slosh_camera.optics.cup import Cup, CupView

FloatArray = NDArray[np.float64]

_PLACE = 5
# Bounds of the error of one sample [px], and how many neighbours share it.
_LEAST_ERROR, _MOST_ERROR = 0.15, 1.0
_SHARED_BY = 5.0
# What a whole curve may be off [px], beside its samples' errors: reflections at a side shift and
# turn it; the liquid's meniscus; the floor's thickness and a fill height given too roughly [m].
_SIDE_ERROR, _SIDE_TURN = 0.3, 0.2
_LEVEL_ERROR = 0.12
_BASE_ERROR = 0.0015
_MERGED = 0.3
# Search to both sides of a predicted curve, as a share of the container's width, and at least.
_ROUGH = ((0.045, 8.0), (0.045, 8.0), (0.03, 6.0))
_FINE = ((0.03, 6.0), (0.015, 4.0), (0.012, 3.0), (0.012, 3.0))
# An edge farther off than this after the fit belongs to something else [px].
INLIER = 1.5
# The narrower a container, the more edges of other things lie near its curves by chance: this [px]
# over its width is taken off the score.
_CHANCE = 6.0
# Who explains two lines of the level explains more than who takes one of them for the only one.
_TWO_LINES, _LEAST_SHARE = 0.15, 0.7
_FAR = 1e3
_DIFFERENCE = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Hint:
    """What is known about the place beside the container's edges, from a board.

    Attributes:
        numbers: (5,) in the order of CameraPlace; NaN where nothing is known.
        stddev: (5,) their standard deviations.
    """

    numbers: FloatArray
    stddev: FloatArray


NO_HINT = Hint(np.full(_PLACE, np.nan), np.ones(_PLACE))


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """A fitted place.

    Attributes:
        place: the camera's place.
        covariance: (5, 5) of its five numbers, in their order and units.
        seen: the edges that were fitted.
        residuals: distance of each edge from its fitted curve [px], one array per curve.
        score: mean support of the curves, less what chance gives, and more for two
            lines of the level; about 0 to 1.
    """

    place: CameraPlace
    covariance: FloatArray
    seen: tuple[SeenCurve, ...]
    residuals: tuple[FloatArray, ...]
    score: float

    @property
    def rms(self) -> float:
        """Root mean square of the inliers' residuals [px], where the liquid's outline is."""
        pairs = zip(self.seen, self.residuals, strict=True)
        every = np.concatenate([r for seen, r in pairs if seen.curve in OUTLINE])
        near = every[np.abs(every) < INLIER]
        return float(np.sqrt(np.mean(near**2))) if near.size else float("nan")

    def share(self, curve: Curve) -> float:
        """Part of a curve's samples that lie on an edge; NaN: the curve is not in the image."""
        for seen, residual in zip(self.seen, self.residuals, strict=True):
            if seen.curve is curve:
                return float(np.count_nonzero(np.abs(residual) < INLIER) / max(seen.samples, 1))
        return float("nan")


def fit_place(
    edges: EdgeImage,
    camera: PinholeCamera,
    cup: Cup,
    start: CameraPlace,
    hint: Hint = NO_HINT,
    *,
    rough: bool = False,
) -> Fit | None:
    """Fit the camera's place to the edges, looking for them ever closer to the prediction.

    Args:
        edges: the image, without distortion.
        camera: its camera, without distortion.
        cup: the container.
        start: where to start.
        hint: what else is known.
        rough: from far away, to a few pixels: light goes straight, which is quicker.

    Returns:
        The fit; None where it runs away or loses the edges.
    """
    if rough:
        cup = replace(cup, wall_refractive_index=1.0)
    place = start
    covariance = np.full((_PLACE, _PLACE), np.nan)
    reach = 0.0
    try:
        for share, least in _ROUGH if rough else _FINE:
            view = view_at(camera, cup, place)
            reach = max(share * width_of(view), least)
            seen = look_for_curves(edges, view, reach)
            if not _enough(seen):
                return None
            # Empty glass has an outer and an inner edge, and either may be the stronger.
            fitted = [curve for curve in seen if curve.curve not in EMPTY]
            place, covariance = _Problem(camera, cup, place, fitted, hint).solved()
        view = view_at(camera, cup, place)
        seen = look_for_curves(edges, view, reach)
    except SloshCameraError:
        return None
    residuals = tuple(distances(view, curve) for curve in seen)
    score = _score(edges, seen, residuals) - _CHANCE / width_of(view)
    fit = Fit(place, covariance, seen, residuals, score)
    # NaN, where the view has no rear line, is not more.
    both = all(fit.share(curve) > _LEAST_SHARE for curve in (Curve.FRONT, Curve.REAR))
    return replace(fit, score=score + _TWO_LINES) if both else fit


def _enough(seen: Sequence[SeenCurve]) -> bool:
    """Both sides and a line of the level have edges."""
    sizes = {curve.curve: len(curve.pixels) for curve in seen}
    level = max(sizes.get(Curve.FRONT, 0), sizes.get(Curve.REAR, 0))
    return level >= 8 and min(sizes.get(curve, 0) for curve in WETTED) >= 8


class _Problem:
    """Least squares over the place and each curve's own error.

    A curve's own error (an offset, for a side a turn, too) is an unknown with an expected size,
    so that the covariance holds what no number of samples averages out.
    """

    def __init__(
        self,
        camera: PinholeCamera,
        cup: Cup,
        start: CameraPlace,
        seen: Sequence[SeenCurve],
        hint: Hint,
    ) -> None:
        view = view_at(camera, cup, start)
        self._camera, self._cup, self._start, self._seen = camera, cup, start, seen
        self._scale = np.array([start.distance, start.distance, 1.0, 1.0, 1.0])
        self._weights = [_weight(curve, distances(view, curve)) for curve in seen]
        shapes = [
            weight * _own_errors(view, curve)
            for curve, weight in zip(seen, self._weights, strict=True)
        ]
        own = block_diag(*shapes)
        self._samples, self._own_size = own.shape
        self._hinted = np.isfinite(hint.numbers)
        self._hint = hint.numbers[self._hinted]
        self._hint_weight = 1.0 / hint.stddev[self._hinted]
        hints = np.zeros((self._hint.size, self._own_size))
        self._own_slope: FloatArray = np.vstack((-own, np.eye(self._own_size), hints))

    def solved(self) -> tuple[CameraPlace, FloatArray]:
        """The place and the covariance of its five numbers (5, 5)."""
        first = np.concatenate((self._start.numbers / self._scale, np.zeros(self._own_size)))
        result = least_squares(
            self._cost, first, jac=self._slope, loss="soft_l1", max_nfev=12, xtol=1e-6
        )
        slope = np.asarray(result.jac)
        covariance = np.linalg.pinv(slope.T @ slope)[:_PLACE, :_PLACE]
        place = CameraPlace(*(float(value) for value in result.x[:_PLACE] * self._scale))
        return place, covariance * np.outer(self._scale, self._scale)

    def _cost(self, numbers: FloatArray) -> FloatArray:
        place = numbers[:_PLACE] * self._scale
        fixed = np.zeros(len(self._own_slope))
        try:
            view = view_at(self._camera, self._cup, CameraPlace(*place))
        except SloshCameraError:
            return np.full(fixed.size, _FAR)
        pairs = zip(self._seen, self._weights, strict=True)
        parts = [weight * distances(view, curve) for curve, weight in pairs]
        fixed[: self._samples] = np.nan_to_num(np.concatenate(parts), nan=_FAR)
        fixed[self._samples + self._own_size :] = (
            place[self._hinted] - self._hint
        ) * self._hint_weight
        cost: FloatArray = fixed + self._own_slope @ numbers[_PLACE:]
        return cost

    def _slope(self, numbers: FloatArray) -> FloatArray:
        # The curves' own errors enter linearly; differences are taken over the place alone.
        here = self._cost(numbers)
        columns = []
        for index in range(_PLACE):
            moved = numbers.copy()
            moved[index] += _DIFFERENCE
            columns.append((self._cost(moved) - here) / _DIFFERENCE)
        return np.column_stack((*columns, self._own_slope))


def _own_errors(view: CupView, seen: SeenCurve) -> FloatArray:
    """Expected errors of a whole curve at its samples (N, K) [px], one column per kind."""
    count = len(seen.pixels)
    flat = np.ones((count, 1))
    if seen.curve is Curve.BASE:
        return flat * (_LEVEL_ERROR + _BASE_ERROR * view.camera.fy / axis_distance(view))
    if seen.curve not in SIDES:
        # Front and rear line so close that they are one edge: it may be either, or between.
        apart = abs(separation(view))
        return flat * (_LEVEL_ERROR + (_MERGED * apart if apart < LEAST_SEPARATION else 0.0))
    turn = np.linspace(-_SIDE_TURN, _SIDE_TURN, count)[:, np.newaxis]
    return np.hstack((_SIDE_ERROR * flat, turn))


def _weight(seen: SeenCurve, residual: FloatArray) -> float:
    """One over the error of a sample, by the scatter of the samples about a smooth curve."""
    scatter = _MOST_ERROR
    if residual.size > 8 and seen.curve is not Curve.BASE:
        place = np.linspace(-1.0, 1.0, residual.size)
        smooth = np.polynomial.polynomial.polyfit(place, residual, 2)
        rest = residual - np.polynomial.polynomial.polyval(place, smooth)
        scatter = float(np.clip(1.5 * np.median(np.abs(rest)), _LEAST_ERROR, _MOST_ERROR))
    return float(1.0 / (scatter * np.sqrt(_SHARED_BY)))


def _score(edges: EdgeImage, seen: Sequence[SeenCurve], residuals: Sequence[FloatArray]) -> float:
    """Mean over the curves of the support on each; a curve that is absent counts nothing."""
    parts = []
    pairs = zip(seen, residuals, strict=True)
    for curve, residual in ((c, r) for c, r in pairs if c.curve not in EMPTY):
        near = np.abs(residual) < INLIER
        support = float(edges.support(curve.slopes[near]).sum()) / curve.samples
        parts.append((support, 2.0 if curve.curve is Curve.FRONT else 1.0))
    return float(np.average([part[0] for part in parts], weights=[part[1] for part in parts]))
