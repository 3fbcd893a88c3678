"""Least-squares fit of the camera's pose to the edges of a round container."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.optimize import least_squares

from slosh_camera.calibrate.curves import (
    EMPTY,
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
from slosh_camera.calibrate.pose import QUANTITIES, CameraPlace, GivenView
from slosh_camera.calibrate.tuning import TUNING
from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.camera import PinholeCamera
from slosh_camera.optics.cup import Cup, CupView

FloatArray = NDArray[np.float64]

_PLACE = 5
_NUMBERS = _PLACE + QUANTITIES
# Search to both sides of a predicted curve, as a share of the container's width, and at least.
_ROUGH = ((0.045, 8.0), (0.045, 8.0), (0.03, 6.0))
_FINE = ((0.03, 6.0), (0.015, 4.0), (0.012, 3.0), (0.012, 3.0))
_FAR = 1e3
_DIFFERENCE = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Hint:
    """Prior information on the camera's pose from sources other than the container's edges.

    Attributes:
        numbers: (5,) in the order of CameraPlace; NaN where nothing is known.
        stddev: (5,) their standard deviations.
        level: a pixel on the contact line of the still level; None: not told.
    """

    numbers: FloatArray
    stddev: FloatArray
    level: tuple[float, float] | None = None

    def with_distance(self, distance: float, stddev: float) -> Hint:
        """Returns the prior with a camera distance and its standard deviation added, both in m."""
        numbers, spread = self.numbers.copy(), self.stddev.copy()
        numbers[0], spread[0] = distance, stddev
        return replace(self, numbers=numbers, stddev=spread)


NO_HINT = Hint(np.full(_PLACE, np.nan), np.ones(_PLACE))


@dataclass(frozen=True, slots=True, eq=False)
class PlaceFit:
    """Fitted pose of the camera, with covariance and residuals.

    Attributes:
        camera: the camera, with the focal length that fits.
        cup: the container, with the lengths that fit.
        place: the camera's place.
        covariance: (5 + QUANTITIES, 5 + QUANTITIES) of its five numbers and of what was told, in
            the order and units of CameraPlace and of GivenView.off_by.
        tension: how far the curves contradict each other: the square root of the mean square of
            their own errors over what is expected; about 1 where all is as it should be.
        seen: the edges that were fitted.
        residuals: distance of each edge from its fitted curve [px], one array per curve.
        score: mean support of the curves, less what chance gives, and more for two
            lines of the level; about 0 to 1.
    """

    camera: PinholeCamera
    cup: Cup
    place: CameraPlace
    covariance: FloatArray
    tension: float
    seen: tuple[SeenCurve, ...]
    residuals: tuple[FloatArray, ...]
    score: float

    @property
    def rms(self) -> float:
        """Root mean square residual of the container's edges, without outliers [px]."""
        pairs = zip(self.seen, self.residuals, strict=True)
        every = np.concatenate([r for seen, r in pairs if seen.curve in OUTLINE])
        near = every[np.abs(every) < TUNING.inlier]
        return float(np.sqrt(np.mean(near**2))) if near.size else float("nan")

    def share(self, curve: Curve) -> float:
        """Returns the fraction of a curve's samples that lie on an edge; NaN outside the image."""
        for seen, residual in zip(self.seen, self.residuals, strict=True):
            if seen.curve is curve:
                return float(
                    np.count_nonzero(np.abs(residual) < TUNING.inlier) / max(seen.samples, 1)
                )
        return float("nan")


def fit_place(
    edges: EdgeImage,
    told: GivenView,
    start: CameraPlace,
    hint: Hint = NO_HINT,
    *,
    rough: bool = False,
    found: tuple[SeenCurve, ...] = (),
) -> PlaceFit | None:
    """Fits the camera's pose to image edges, with a decreasing edge search distance.

    Args:
        edges: the image, without distortion.
        told: its camera, without distortion, and the container.
        hint: what else is known.
        rough: from far away, to a few pixels: light goes straight, which is quicker.
        found: the edges, where they are found already; empty: they are looked for.

    Returns:
        The fit; None where it runs away or loses the edges.
    """
    if rough:
        straight = replace(told.cup, wall_refractive_index=1.0)
        told = GivenView(told.camera, straight)
    solved = PlaceSolution(start, np.zeros(QUANTITIES), np.full((_NUMBERS, _NUMBERS), np.nan), 1.0)
    reach = 0.0
    try:
        view = view_at(*told.off_by(solved.change), solved.place)
        for share, least in _ROUGH if rough else _FINE:
            reach = max(share * width_of(view), least)
            seen = found or look_for_curves(edges, view, reach, _level_reach(hint, reach))
            if not _enough(seen):
                return None
            # Empty glass has an outer and an inner edge, and either may be the stronger.
            fitted = [curve for curve in seen if curve.curve not in EMPTY]
            solved = _Problem(told, solved, fitted, hint).solved()
            view = view_at(*told.off_by(solved.change), solved.place)
        certain = [curve for curve in fitted if _is_certain(view, curve)]
        if len(certain) < len(fitted) and _enough(certain):
            solved = _Problem(told, solved, certain, hint).solved()
            view = view_at(*told.off_by(solved.change), solved.place)
        seen = found or look_for_curves(edges, view, reach, _level_reach(hint, reach))
    except SloshCameraError:
        return None
    if not _enough(seen):
        return None
    residuals = tuple(distances(view, curve) for curve in seen)
    score = _score(edges, seen, residuals) - TUNING.fit_chance / width_of(view)
    fit = PlaceFit(
        view.camera,
        view.cup,
        solved.place,
        solved.covariance,
        solved.tension,
        seen,
        residuals,
        score,
    )
    # NaN, where the view has no rear line, is not more.
    both = all(fit.share(curve) > TUNING.clear_share for curve in (Curve.FRONT, Curve.REAR))
    return replace(fit, score=score + TUNING.two_lines) if both else fit


def _level_reach(hint: Hint, reach: float) -> float:
    """Returns the edge search distance for the contact line [px], small if the user clicked it."""
    return reach if hint.level is None else min(reach, TUNING.click_reach)


def _clicked(hint: Hint) -> SeenCurve:
    """Returns the user's click on the liquid level as an edge of the front contact line."""
    pixel = np.array([hint.level if hint.level is not None else (np.nan, np.nan)])
    return SeenCurve(Curve.FRONT, pixel, np.array([[0.0, -1.0]]), np.ones(1), 1)


def _is_certain(view: CupView, seen: SeenCurve) -> bool:
    """Whether edges are found on enough of a curve's length; True for the container's sides."""
    if seen.curve in SIDES:
        return True
    near = np.count_nonzero(np.abs(distances(view, seen)) < TUNING.inlier)
    return bool(near >= TUNING.least_share * seen.samples)


def _enough(seen: Sequence[SeenCurve]) -> bool:
    """Whether edges are found on both container sides and on a contact line."""
    sizes = {curve.curve: len(curve.pixels) for curve in seen}
    level = max(sizes.get(Curve.FRONT, 0), sizes.get(Curve.REAR, 0))
    return level >= 8 and min(sizes.get(curve, 0) for curve in WETTED) >= 8


@dataclass(frozen=True, slots=True, eq=False)
class PlaceSolution:
    """Least-squares solution: pose, corrections of lens and dimensions, covariance."""

    place: CameraPlace
    change: FloatArray
    covariance: FloatArray
    tension: float


class _Problem:
    """Least-squares problem for pose, uncertain dimensions and the systematic error of each curve.

    A curve's own error (an offset, for a side a turn, too) is an unknown with an expected size,
    so that the covariance holds what no number of samples averages out.
    """

    def __init__(
        self, told: GivenView, start: PlaceSolution, seen: Sequence[SeenCurve], hint: Hint
    ) -> None:
        view = view_at(*told.off_by(start.change), start.place)
        self._told, self._start = told, start
        # A curve that leaves the view's front has no distance from its edges.
        known = [(curve, distances(view, curve)) for curve in seen]
        kept = [(curve.only(np.isfinite(away)), away[np.isfinite(away)]) for curve, away in known]
        kept = [(curve, away) for curve, away in kept if away.size]
        if not kept:
            raise SloshCameraError("place: no edge is visible")
        self._seen = [curve for curve, _ in kept]
        distance = start.place.distance
        self._open = np.flatnonzero(told.doubt.open)
        doubt = told.doubt.stddev[self._open]
        self._scale = np.concatenate(([distance, distance, 1.0, 1.0, 1.0], doubt))
        self._weights = [_weight(curve, away) for curve, away in kept]
        shapes = [
            weight * _own_errors(view, curve)
            for curve, weight in zip(self._seen, self._weights, strict=True)
        ]
        own = block_diag(*shapes)
        self._samples, self._own_size = own.shape
        self._hinted = np.isfinite(hint.numbers)
        self._hint = hint.numbers[self._hinted]
        self._hint_weight = 1.0 / hint.stddev[self._hinted]
        self._clicked = _clicked(hint)
        clicks = int(hint.level is not None)
        rest = np.zeros((self._hint.size + self._open.size + clicks, self._own_size))
        self._own_slope: FloatArray = np.vstack((-own, np.eye(self._own_size), rest))

    def solved(self) -> PlaceSolution:
        """Solves for pose, corrections of lens and dimensions, and systematic curve errors."""
        begin = np.concatenate((self._start.place.numbers, self._start.change[self._open]))
        first = np.concatenate((begin / self._scale, np.zeros(self._own_size)))
        result = least_squares(
            self._cost, first, jac=self._slope, loss="soft_l1", max_nfev=12, xtol=1e-6
        )
        slope = np.array(result.jac)
        slope[self._samples : self._samples + self._own_size] /= TUNING.claimed
        count = self._scale.size
        inverse = np.linalg.pinv(slope.T @ slope)[:count, :count]
        place, change = self._taken(result.x)
        told = np.concatenate((np.arange(_PLACE), _PLACE + self._open))
        covariance = np.zeros((_NUMBERS, _NUMBERS))
        covariance[np.ix_(told, told)] = inverse * np.outer(self._scale, self._scale)
        return PlaceSolution(place, change, covariance, self._tension(result.x[count:]))

    def _tension(self, own: FloatArray) -> float:
        # The curves' own errors share what the place leaves over.
        left = max(self._own_size + self._hint.size - _PLACE, 1)
        return float(np.sqrt(np.sum(own**2) / left))

    def _taken(self, numbers: FloatArray) -> tuple[CameraPlace, FloatArray]:
        values = numbers[: self._scale.size] * self._scale
        change = np.zeros(QUANTITIES)
        change[self._open] = values[_PLACE:]
        return CameraPlace(*(float(value) for value in values[:_PLACE])), change

    def _cost(self, numbers: FloatArray) -> FloatArray:
        place, change = self._taken(numbers)
        fixed = np.zeros(len(self._own_slope))
        try:
            view = view_at(*self._told.off_by(change), place)
        except SloshCameraError:
            return np.full(fixed.size, _FAR)
        pairs = zip(self._seen, self._weights, strict=True)
        away = np.concatenate([weight * distances(view, curve) for curve, weight in pairs])
        fixed[: self._samples] = np.clip(np.nan_to_num(away, nan=_FAR), -_FAR, _FAR)
        known = np.concatenate(
            (
                (place.numbers[self._hinted] - self._hint) * self._hint_weight,
                numbers[_PLACE : self._scale.size],
                self._off_click(view),
            )
        )
        fixed[self._samples + self._own_size :] = known
        cost: FloatArray = fixed + self._own_slope @ numbers[self._scale.size :]
        return cost

    def _off_click(self, view: CupView) -> FloatArray:
        """Distance of the contact line from the user's click in standard deviations."""
        if not np.isfinite(self._clicked.pixels).any():
            return np.empty(0)
        away = distances(view, self._clicked) / TUNING.click_error
        return np.clip(away[np.isfinite(self._clicked.pixels[:, 1])], -_FAR, _FAR)

    def _slope(self, numbers: FloatArray) -> FloatArray:
        # The curves' own errors enter linearly; differences are taken over the others alone.
        here = self._cost(numbers)
        columns = []
        for index in range(self._scale.size):
            moved = numbers.copy()
            moved[index] += _DIFFERENCE
            columns.append((self._cost(moved) - here) / _DIFFERENCE)
        return np.column_stack((*columns, self._own_slope))


def _own_errors(view: CupView, seen: SeenCurve) -> FloatArray:
    """Returns expected systematic errors of a curve at its samples [px], a column per type."""
    count = len(seen.pixels)
    flat = np.ones((count, 1))
    if seen.curve is Curve.BASE:
        return flat * (
            TUNING.level_error + TUNING.base_error * view.camera.fy / axis_distance(view)
        )
    if seen.curve not in SIDES:
        # Front and rear line so close that they are one edge: it may be either, or between.
        apart = abs(separation(view))
        merged = TUNING.merged_error * apart if apart < TUNING.separate_lines else 0.0
        return flat * (TUNING.level_error + merged)
    turn = np.linspace(-TUNING.side_turn, TUNING.side_turn, count)[:, np.newaxis]
    return np.hstack((TUNING.side_error * flat, turn))


def _weight(seen: SeenCurve, residual: FloatArray) -> float:
    """Returns the weight of a sample [1/px]: the inverse scatter of its curve's residuals."""
    scatter = TUNING.most_error
    if residual.size > 8 and seen.curve is not Curve.BASE:
        place = np.linspace(-1.0, 1.0, residual.size)
        smooth = np.polynomial.polynomial.polyfit(place, residual, 2)
        rest = residual - np.polynomial.polynomial.polyval(place, smooth)
        scatter = float(
            np.clip(1.5 * np.median(np.abs(rest)), TUNING.least_error, TUNING.most_error)
        )
    return float(1.0 / (scatter * np.sqrt(TUNING.shared_by)))


def _score(edges: EdgeImage, seen: Sequence[SeenCurve], residuals: Sequence[FloatArray]) -> float:
    """Scores a pose by its mean edge strength along all curves; missing edges count as zero."""
    parts = []
    pairs = zip(seen, residuals, strict=True)
    for curve, residual in ((c, r) for c, r in pairs if c.curve not in EMPTY):
        near = np.abs(residual) < TUNING.inlier
        support = float(edges.support(curve.slopes[near]).sum()) / curve.samples
        parts.append((support, 2.0 if curve.curve is Curve.FRONT else 1.0))
    return float(np.average([part[0] for part in parts], weights=[part[1] for part in parts]))
