"""Detects the free surface in a sequence of images of a cylinder.

The wall is unrolled along scan lines and reduced to one axis from liquid to background. The end
of the liquid behind the front wall gives points at known places; a surface of the shapes of DL22,
eqs. (18) and (19), is fitted to them, robustly. It predicts where the surface ends against the
background - the line on the rear wall, or a crest before it; that edge is looked for there and
fitted together with the contact line. A peak on the camera's side has the contact line's points
up to it, one on the far side those of the upper edge [DL22, Fig. 7c, d].
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Array
from slosh_camera.cylinder.container_edges import ContainerEdges
from slosh_camera.cylinder.front_line import FrontLineFinder
from slosh_camera.cylinder.still_reference import REMEDY, StillReference, StillReferenceFinder
from slosh_camera.cylinder.surface import USUAL_FADE, FadeShare, Prior, SurfaceFit, Unrolled
from slosh_camera.cylinder.surface_choice import SurfaceChooser
from slosh_camera.cylinder.surface_comparison import ChosenSurface, Sighting
from slosh_camera.cylinder.surface_fit import SurfaceFitter
from slosh_camera.cylinder.surface_memory import SurfaceMemory
from slosh_camera.cylinder.surface_reading import SurfaceReading, surface_flags
from slosh_camera.cylinder.tuning import TUNING
from slosh_camera.cylinder.wall_geometry import WallGeometry, WallPixels, build_scan_grid
from slosh_camera.images.seams import RepeatedFrames, SeamFinder, Steps
from slosh_camera.images.still_edges import PLACES, Edge, StillEdges, along_end, along_side
from slosh_camera.measurement import Flag, Measurement, PeakSide
from slosh_camera.optics.calibration import Calibration
from slosh_camera.optics.cup import Cup, CupView
from slosh_camera.settings import DetectionSettings

Image = NDArray[np.uint8]
FloatArray = NDArray[np.float64]

_DOUBT = (
    "the contrast between the liquid at rest and what is behind it is too low: many images "
    f"will be refused, and all heights carry the flag AMBIGUOUS; {REMEDY}"
)


@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    """The surface detected in an image, and the flags on how far it can be trusted."""

    view: Unrolled
    fit: SurfaceFit
    prior: Prior
    flags: Flag


class FreeSurfaceDetector:
    """Free-surface detector for one calibrated camera, initialised with liquid at rest."""

    def __init__(
        self, calibration: Calibration, settings: DetectionSettings | None = None
    ) -> None:
        """Computes the scan lines on the container's wall for the calibrated camera.

        Args:
            calibration: camera, container and pose.
            settings: settings; None: those of the calibration.

        Raises:
            SloshCameraError: too little of the container is inside the image.
        """
        self._view = calibration.view
        self._settings = settings or calibration.detection
        self._grid = build_scan_grid(calibration.view, calibration.region)
        self._wall = WallGeometry(self._grid, calibration.view.cup.radius)
        rim = calibration.view.cup.rim_level
        self._fitter = SurfaceFitter(self._wall)
        self._chooser = SurfaceChooser(
            self._wall, np.inf if rim is None else float(calibration.view.cup.upright(rim))
        )
        self._wall_pixels = WallPixels(calibration.view)
        self._edges = ContainerEdges(calibration.view)
        self._still_edges = StillEdges(outer_edges(self._view), self._view.camera.size)
        self._tangents = calibration.view.tangent_azimuths()
        self._front = FrontLineFinder(
            self._grid, self._wall, self._settings, calibration.view.camera.size
        )
        self._learner = StillReferenceFinder(
            self._view, self._grid, self._wall, self._chooser, self._front, self._edges
        )
        self._know(self._learner.nothing())
        self._repeats = RepeatedFrames()
        self._seams = SeamFinder(self._grid.window)

    @property
    def still_offset(self) -> float:
        """Offset of the level at rest from the calibrated level, subtracted from heights [m]."""
        return float(self._view.cup.leaning(self._reference.zero[0]))

    @property
    def doubt(self) -> str:
        """Describes why the image of the liquid at rest is ambiguous; empty if it is not."""
        return "" if self._reference.sure else _DOUBT

    def learn_still(self, image: Image) -> float:
        """Uses an image of the liquid at rest as the zero of all heights.

        Args:
            image: (height, width) grey or (height, width, 3) blue-green-red.

        Returns:
            The offset [m] of the still level against the calibration.

        Raises:
            SloshCameraError: the image does not fit the camera, or shows no liquid at rest, or
                one that would be measured as something else; what was learnt before stays.
        """
        self._know(self._learner.learn(image, self._unrolled(image)))
        self._still_edges.learn(image)
        self._seams.learn(image)
        return self.still_offset

    def update(self, stamp_ns: int, image: Image) -> Measurement:
        """Measures the next image of a sequence, using the images before it.

        One that repeats an image before is flagged FROZEN. Args and errors are those of
        `measure`.
        """
        measurement = self.follow(stamp_ns, self.look(image))
        repeated = self._repeats.is_repeat(image, stamp_ns)
        return measurement.flagged(Flag.FROZEN) if repeated else measurement

    def measure(self, stamp_ns: int, image: Image) -> Measurement:
        """Measures a single image, without using other images.

        Args:
            stamp_ns: moment of exposure [ns].
            image: (height, width) grey or (height, width, 3) blue-green-red image of the
                calibrated camera.

        Returns:
            The measurement; what the image does not show is NaN, with a flag that says why.

        Raises:
            SloshCameraError: the image is not 8-bit or not of the calibrated size.
        """
        sighting = self.look(image)
        if not sighting.candidates:
            return Measurement(stamp_ns=stamp_ns, flags=sighting.flags)
        choice = self._reference.comparison.choose(sighting, None)
        return self._measurement(stamp_ns, self._found(choice, sighting.steps))

    def look(self, image: Image) -> Sighting:
        """Analyses a single image; this is most of the work and needs no other image.

        Args and errors are those of `measure`.
        """
        unrolled, reference = self._unrolled(image), self._reference
        if self._edges.turned(image, reference.turn) or self._still_edges.missing(image):
            return Sighting(flags=Flag.NOT_FOUND)
        beside = image if reference.surrounded else None
        lines = (
            self._front.find(unrolled, body, reference.stationary, reference.surface, beside)
            for body in reference.bodies
        )
        seen = tuple(
            (view, reference.bias.removed(points))
            for view, points in (found for found in lines if found is not None)
        )
        if not seen:
            return Sighting(flags=self._front.why_none(unrolled))
        return replace(self._reference.comparison.sighting(seen), steps=self._seams.steps(image))

    def follow(self, stamp_ns: int, sighting: Sighting) -> Measurement:
        """Completes the measurement of an analysed image, using the images before it.

        Args:
            stamp_ns: moment of exposure [ns].
            sighting: what `look` told of the image.
        """
        self._memory.arrive(stamp_ns)
        if not sighting.candidates:
            return Measurement(stamp_ns=stamp_ns, flags=sighting.flags)
        choice = self._reference.comparison.choose(sighting, self._memory.expected(stamp_ns))
        found = self._found(choice, sighting.steps)
        if Flag.NOT_FOUND in found.flags:
            return self._measurement(stamp_ns, found)
        found, fade = self._learnt_fade(found)
        # Of a surface that is cut off too little is seen to go by.
        if Flag.SATURATED not in found.flags:
            if choice.decided or choice.jumped:
                found = replace(found, flags=found.flags | Flag.AMBIGUOUS)
            self._memory.remember(
                stamp_ns, self._reference.comparison.first(found.fit), fade,
                decided=choice.decided, jumped=choice.jumped,
            )  # fmt: skip
            if self._memory.crest_stands or self._memory.repeats:
                found = replace(found, flags=found.flags | Flag.AMBIGUOUS)
        return self._measurement(stamp_ns, found)

    def _know(self, reference: StillReference) -> None:
        """Stores the reference data of the liquid at rest and forgets earlier images."""
        self._reference = reference
        self._memory = SurfaceMemory(self._view.cup.radius, self._view.cup.fill_height)

    def _learnt_fade(self, found: _Found) -> tuple[_Found, FadeShare]:
        """Fits the surface again with the fading of wave crests that earlier images showed."""
        fade = self._memory.fade
        if float(np.max(np.abs(found.fit.by_fade))) < TUNING.no_fade:
            return found, fade
        if fade != USUAL_FADE:
            fit = self._fitter.again(found.view, found.fit, found.prior, fade)
            found = replace(found, fit=fit)
        return found, found.fit.fade

    def _found(self, choice: ChosenSurface, steps: Steps) -> _Found:
        """Returns the chosen surface with its flags; NOT_FOUND if the image contradicts it."""
        view, fit = choice.candidate.view, choice.candidate.fit
        prior = self._reference.comparison.prior_of(choice.candidate)
        if choice.believed:
            flags = surface_flags(self._wall, view, fit)
            if self._reference.comparison.level_has_changed(choice.candidate):
                flags |= Flag.LEVEL_CHANGED
            # A thing before the container may have edges as sharp, and hides the line.
            if not flags and steps.rows.size and self._is_torn(steps, view, fit):
                flags |= Flag.AMBIGUOUS
            # Of a surface that is cut off a bound alone is told.
            sure = (self._reference.sure and not choice.doubtful) or Flag.SATURATED in flags
            return _Found(view, fit, prior, flags if sure else flags | Flag.AMBIGUOUS)
        covered = self._wall.covered_border(view.picture)
        flags = Flag.NOT_FOUND | (Flag.SATURATED if covered else Flag.NONE)
        return _Found(view, fit, prior, flags)

    def _is_torn(self, steps: Steps, view: Unrolled, fit: SurfaceFit) -> bool:
        """Whether the image is torn: a sharp step away from the detected surface's lines."""
        upper = self._wall.silhouette(fit.heights, view.softness)
        rows = self._wall.front_rows(fit.heights), np.where(upper < 0.0, np.nan, upper)
        places = [self._grid.pixel_at(np.isfinite(each), each) for each in rows]
        return self._seams.is_torn(steps, *((each[:, 0], each[:, 1]) for each in places))

    def _unrolled(self, image: Image) -> Image:
        self._view.camera.check(image)
        return self._grid.unroll(image)

    def _measurement(self, stamp_ns: int, found: _Found) -> Measurement:
        lost = Flag.NOT_FOUND in found.flags
        upright = self._lower_bound(stamp_ns, found) if lost else self._read(stamp_ns, found)
        return on_inclined_wall(upright, self._view.cup, float(self._reference.zero[0]))

    def _lower_bound(self, stamp_ns: int, found: _Found) -> Measurement:
        """Returns a lower bound of the height [m] if the image border cuts the surface off."""
        points = found.fit.points
        cut = points.bound & (self._wall.first_row > 0)
        if Flag.SATURATED not in found.flags or not np.any(cut):
            return Measurement(stamp_ns=stamp_ns, flags=found.flags)
        heights = np.where(cut, points.height - points.shapes @ self._reference.zero, -np.inf)
        highest = int(np.argmax(heights))
        place = self._grid.pixel_at(cut, points.place)[np.count_nonzero(cut[:highest])]
        return Measurement(
            stamp_ns=stamp_ns,
            msh=float(heights[highest]),
            azimuth=float(points.azimuth[highest]),
            peak_pixel=(float(place[0]), float(place[1])),
            peak_side=PeakSide.FRONT,
            flags=found.flags & ~Flag.NOT_FOUND,
        )

    def _read(self, stamp_ns: int, found: _Found) -> Measurement:
        cut_off = bool(found.flags & Flag.SATURATED)
        reading = SurfaceReading(
            found.fit, self._reference.zero, self._wall.footprint,
            cut_off=cut_off, shaded=found.view.scatters,
        )  # fmt: skip
        fitted, seen = reading.fitted(), reading.seen()
        highest = reading.highest(fitted, seen)
        flags = found.flags
        if reading.edge_width > self._settings.max_blur:
            flags |= Flag.BLURRED
        # Of a surface that is cut off a bound alone is told.
        if not cut_off:
            contradicted = reading.contradiction > 1.0 and highest.stddev > TUNING.contradicted
            if contradicted or (found.view.scatters and fitted.stddev > TUNING.untold):
                flags |= Flag.AMBIGUOUS
            if fitted.height - seen.height > TUNING.hidden_peak:
                flags |= Flag.OCCLUDED
        left, right = (reading.at(azimuth) for azimuth in self._tangents)
        level = reading.level() if Flag.LEVEL_CHANGED in flags else (float("nan"), float("nan"))
        return Measurement(
            stamp_ns=stamp_ns,
            msh=highest.height,
            msh_stddev=highest.stddev,
            azimuth=highest.azimuth,
            fitted_msh=fitted.height,
            fitted_msh_stddev=fitted.stddev,
            fitted_azimuth=fitted.azimuth,
            sh_left=left,
            sh_right=right,
            azimuth_left=self._tangents[0],
            azimuth_right=self._tangents[1],
            profile_azimuth=reading.azimuth,
            profile_height=reading.height,
            edge_pixels=self._pixels(found, reading),
            peak_pixel=self._wall_pixels(
                highest.azimuth,
                float(self._view.cup.leaning(highest.height + self._reference.zero[0])),
            ),
            peak_side=self._side(fitted.azimuth),
            level_change=level[0],
            level_change_stddev=level[1],
            flags=flags,
        )

    def _side(self, azimuth: float) -> PeakSide:
        towards = np.cos(azimuth - self._view.camera_azimuth)
        return PeakSide.FRONT if towards > 0.0 else PeakSide.REAR

    def _pixels(self, found: _Found, reading: SurfaceReading) -> FloatArray:
        front = self._grid.pixel_at(reading.front, found.fit.points.place)
        rear = self._grid.pixel_at(reading.rear, found.fit.upper_place)[::-1]
        return np.vstack((front, rear))


def outer_edges(view: CupView) -> list[Edge]:
    """Projects the container's sides, its floor and, if known, its rim into the image.

    Args:
        view: the container as the camera sees it.
    """
    cup, front, half = view.cup, view.camera_azimuth, view.side_half_angle
    levels, middle = along_side(cup.fill_height), along_end(half)
    around = np.ones(PLACES)
    lines = [((front + side) * around, levels, True) for side in (half, -half)]
    lines.append((front + middle, -cup.fill_height * around, False))
    if cup.rim_level is not None:
        rim = cup.rim_level * around
        lines += [(front + turn + middle, rim, False) for turn in (0.0, np.pi)]
    edges = []
    for azimuth, level, is_side in lines:
        edges.append(Edge(view.project(cup.outer_points(azimuth, level)), is_side))
    return edges


def on_inclined_wall(measurement: Measurement, cup: Cup, zero: float) -> Measurement:
    """Converts a measurement from the equivalent upright wall to the container's inclined wall.

    Args:
        measurement: with upright heights, as `Cup.upright` gives them.
        zero: upright height of the still level, from which the heights are counted [m].
    """
    if not cup.taper:
        return measurement
    rest = float(cup.leaning(zero))

    def height(upright: float) -> float:
        return float(cup.leaning(upright + zero)) - rest

    def stddev(spread: float, upright: float) -> float:
        return spread / float(1.0 - cup.taper / cup.radius * (upright + zero)) ** 2

    profile: Array = cup.leaning(measurement.profile_height + zero) - rest
    return replace(
        measurement,
        msh=height(measurement.msh),
        msh_stddev=stddev(measurement.msh_stddev, measurement.msh),
        fitted_msh=height(measurement.fitted_msh),
        fitted_msh_stddev=stddev(measurement.fitted_msh_stddev, measurement.fitted_msh),
        sh_left=height(measurement.sh_left),
        sh_right=height(measurement.sh_right),
        profile_height=profile,
        level_change=height(measurement.level_change),
        level_change_stddev=stddev(measurement.level_change_stddev, measurement.level_change),
    )
