"""Free-surface detection in one image after another.

The wall is unrolled along scan lines and reduced to one axis from liquid to background. The end
of the liquid behind the front wall gives points at known places; a surface of the shapes of DL22,
eqs. (18) and (19), is fitted to them, robustly. It predicts where the surface ends against the
background - the line on the rear wall, or a crest before it; that edge is looked for there and
fitted together with the front line. A peak on the camera's side has the front line's points up to
it, one on the far side those of the upper edge [DL22, Fig. 7c, d].
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from slosh_camera.cylinder.container_edges import ContainerEdges
from slosh_camera.cylinder.front_line import FrontLineFinder
from slosh_camera.cylinder.outer_edges import outer_edges
from slosh_camera.cylinder.scan_grid import build_scan_grid
from slosh_camera.cylinder.stationary_edges import no_edges, stationary_edges
from slosh_camera.cylinder.still_surface import (
    REMEDY,
    StillSurface,
    find_still_surface,
    is_found_again,
)
from slosh_camera.cylinder.surface_choice import SurfaceChooser
from slosh_camera.cylinder.surface_comparison import Choice, Sighting, SurfaceComparison
from slosh_camera.cylinder.surface_evidence import (
    INLIER,
    USUAL_FADE,
    FadeShare,
    SurfaceFit,
    Unrolled,
)
from slosh_camera.cylinder.surface_fit import SurfaceFitter
from slosh_camera.cylinder.surface_memory import SurfaceMemory
from slosh_camera.cylinder.surface_modes import SHAPES
from slosh_camera.cylinder.surface_prior import HIGHEST, Prior
from slosh_camera.cylinder.surface_reading import SurfaceReading
from slosh_camera.cylinder.surroundings import looks_like_surroundings
from slosh_camera.cylinder.wall_geometry import WallGeometry
from slosh_camera.cylinder.wall_pixels import WallPixels
from slosh_camera.errors import SloshCameraError
from slosh_camera.images.repeats import RepeatedFrames
from slosh_camera.images.still_edges import StillEdges
from slosh_camera.measurement import Flag, Measurement, PeakSide
from slosh_camera.optics.calibration import Calibration
from slosh_camera.settings import DetectionSettings

Image = NDArray[np.uint8]
FloatArray = NDArray[np.float64]
Single = NDArray[np.float32]

# Standard deviation of the first mode, as a part of the radius.
_FIRST = 0.5
_LEAST_POINTS = 10
# Flags of a line of which too little is seen to be a zero.
_NOT_WHOLE = Flag.NOT_FOUND | Flag.SATURATED
# Part of the scan lines that must show an edge of the fitted surface for it to be one, and part
# that may be hidden without a remark.
_LEAST_READ = 0.5
_HIDDEN = 0.13
_DOUBT = (
    "the liquid at rest does not surely differ from what is behind it: many images will be "
    f"refused, and all heights carry the flag AMBIGUOUS; {REMEDY}"
)
# Heights that the fade changes by less than this need no second fit [m].
_NO_FADE = 2e-6
# Rows around a line at rest that belong to it, and in widths of its edge.
_OWN_ROWS, _OWN_WIDTHS = 2.0, 1.0
# Standard deviation from which on a surface is not told whose front line is a mere shade, or whose
# edges contradict each other [m].
_UNTOLD = 5e-4
# The peak is hidden where the fitted surface is so much higher than what is seen [m].
_HIGHER = 5e-4


@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    """The surface that an image shows, and what limits that."""

    view: Unrolled
    fit: SurfaceFit
    flags: Flag


class FreeSurfaceDetector:
    """Detector for one calibrated camera; keeps what a still image and the last images taught."""

    def __init__(
        self, calibration: Calibration, settings: DetectionSettings | None = None
    ) -> None:
        """Prepare the scan lines.

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
        self._chooser = SurfaceChooser(self._wall, np.inf if rim is None else rim)
        self._wall_pixels = WallPixels(calibration.view)
        self._edges = ContainerEdges(calibration.view)
        self._still_edges = StillEdges(outer_edges(self._view), self._view.camera.size)
        self._usual_turn = 0.0
        self._tangents = calibration.view.tangent_azimuths()
        self._front = FrontLineFinder(
            self._grid, self._wall, self._settings, calibration.view.camera.size
        )
        self._bodies = self._front.bodies
        self._zero = np.zeros(SHAPES)
        prior = Prior(self._zero, first=_FIRST * calibration.view.cup.radius)
        self._know(prior, self._compared(prior))
        self._at_rest = Prior(self._zero, first=3e-3, level=5e-3)
        self._surface = float("nan")
        self._stationary = self._unknown = no_edges(self._grid.shape)
        self._sure, self._taught = True, False
        self._repeats = RepeatedFrames()

    @property
    def still_offset(self) -> float:
        """Height of the still level against the calibration, subtracted from heights [m]."""
        return float(self._zero[0])

    @property
    def doubt(self) -> str:
        """What the still image leaves open, in words; empty: nothing."""
        return "" if self._sure else _DOUBT

    def learn_still(self, image: Image) -> float:
        """Take an image of the liquid at rest as the zero of all heights.

        Args:
            image: (height, width) grey or (height, width, 3) blue-green-red.

        Returns:
            The offset [m] of the still level against the calibration.

        Raises:
            SloshCameraError: the image does not fit the camera, or shows no liquid at rest, or
                one that would be measured as something else; what was learnt before stays.
        """
        unrolled = self._unrolled(image)
        turn = self._edges.turn(image)
        if self._edges.turned(image, 0.0):
            raise SloshCameraError(
                f"still image: the container's sides are turned by {np.degrees(turn):.1f} "
                "degrees against the calibration, calibrate the camera anew"
            )
        # Behind a clear liquid, too, is seen what is beside it: that tells nothing of its end.
        bodies = self._front.bodies
        besides = [None if self._is_clear(image, unrolled, body) else image for body in bodies]
        seen = (
            (self._front.find(unrolled, body, self._unknown, self._surface, beside), body)
            for body, beside in zip(bodies, besides, strict=True)
        )
        pictures = [(*found, body) for found, body in seen if found is not None]
        still = find_still_surface(self._chooser, pictures, self._at_rest)
        if still is None or self._flags(still.fit, still.view) & _NOT_WHOLE:
            raise SloshCameraError(
                "still image: shows no whole liquid line, check light, region and calibration"
            )
        prior = Prior(still.zero, first=self._prior.first)
        clear = besides[bodies.index(still.body)] is None
        # In one image all edges stand still: nothing tells those of the background as yet.
        sure = is_found_again(still, self._compared_with_rest(still.view, prior)) and not (
            self._chooser.is_suspect(still.fit) or clear
        )
        if not sure and abs(still.zero[0]) > self._at_rest.level:
            raise SloshCameraError(
                f"still image: its line lies {1e3 * still.zero[0]:+.0f} mm off the calibration's "
                "level, and may be an edge of what is behind the liquid; check the fill height, "
                f"or {REMEDY}"
            )
        self._sure, self._taught = sure, not clear
        self._zero = still.zero
        # Of a doubted liquid it is not known which edge is its own.
        self._stationary = self._standing_edges(still) if sure else self._unknown
        view = replace(still.view, stationary=self._stationary)
        self._know(prior, self._compared_with_rest(view, prior))
        self._bodies = (still.body,)
        self._usual_turn = turn
        self._still_edges.learn(image)
        self._surface = still.view.surface
        return self.still_offset

    def update(self, stamp_ns: int, image: Image) -> Measurement:
        """Measure the next image of a stream, with what the images before tell of it.

        One that repeats the image before is flagged FROZEN. Args and errors are those of
        `measure`.
        """
        measurement = self.follow(stamp_ns, self.look(image))
        repeated = self._repeats.is_repeat(image)
        return measurement.flagged(Flag.FROZEN) if repeated else measurement

    def measure(self, stamp_ns: int, image: Image) -> Measurement:
        """Measure one image by itself.

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
        return self._measurement(stamp_ns, self._found(self._comparison.choose(sighting, None)))

    def look(self, image: Image) -> Sighting:
        """What an image shows by itself: most of the work, and independent of other images.

        Args and errors are those of `measure`.
        """
        unrolled = self._unrolled(image)
        if self._edges.turned(image, self._usual_turn) or self._still_edges.missing(image):
            return Sighting(flags=Flag.NOT_FOUND)
        beside = image if self._taught else None
        lines = (
            self._front.find(unrolled, body, self._stationary, self._surface, beside)
            for body in self._bodies
        )
        seen = tuple(found for found in lines if found is not None)
        if not seen:
            return Sighting(flags=self._front.why_none(unrolled))
        return self._comparison.sighting(seen)

    def follow(self, stamp_ns: int, sighting: Sighting) -> Measurement:
        """The measurement of the next image of a stream, by what it shows and those before.

        Args:
            stamp_ns: moment of exposure [ns].
            sighting: what `look` told of the image.
        """
        self._memory.arrive(stamp_ns)
        if not sighting.candidates:
            return Measurement(stamp_ns=stamp_ns, flags=sighting.flags)
        choice = self._comparison.choose(sighting, self._memory.expected(stamp_ns))
        found = self._found(choice)
        if Flag.NOT_FOUND in found.flags:
            return self._measurement(stamp_ns, found)
        found, fade = self._learnt_fade(found)
        # Of a surface that is cut off too little is seen to go by.
        if Flag.SATURATED not in found.flags:
            if choice.decided or choice.jumped:
                found = replace(found, flags=found.flags | Flag.AMBIGUOUS)
            self._memory.remember(
                stamp_ns, self._comparison.first(found.fit), fade,
                decided=choice.decided, jumped=choice.jumped,
            )  # fmt: skip
        return self._measurement(stamp_ns, found)

    def _is_clear(self, image: Image, unrolled: Image, body: slice) -> bool:
        """Whether the liquid looks like what is beside the container."""
        tone = self._front.tone(unrolled, body)
        return tone is not None and looks_like_surroundings(image, self._grid.pixels[body], tone)

    def _know(self, prior: Prior, comparison: SurfaceComparison) -> None:
        """Take what is known of the heights; what other images told is of another zero."""
        cup = self._view.cup
        self._prior, self._comparison = prior, comparison
        self._memory = SurfaceMemory(cup.radius, cup.fill_height)

    def _compared(self, prior: Prior, at_rest: float = -np.inf) -> SurfaceComparison:
        """A comparison of surfaces; `at_rest`: how plausible rest makes the still image."""
        return SurfaceComparison(self._chooser, prior, self._wall.footprint, at_rest)

    def _compared_with_rest(self, view: Unrolled, prior: Prior) -> SurfaceComparison:
        """A comparison that knows how plausible a still image makes the surface at rest."""
        return self._compared(prior, self._chooser.plausible_heights(view, prior.centre, prior))

    def _standing_edges(self, still: StillSurface) -> Single:
        """Edges of the still image away from the liquid's lines, where those are seen."""
        fit, view = still.fit, still.view
        seen = (fit.front_weight > INLIER) & ~fit.points.bound
        front = np.where(seen, fit.points.place, np.nan)
        upper = np.where(fit.upper_weight > INLIER, fit.upper_place, np.nan)
        return stationary_edges(
            view.picture, np.stack((front, upper)), _OWN_ROWS + _OWN_WIDTHS * view.softness
        )

    def _learnt_fade(self, found: _Found) -> tuple[_Found, FadeShare]:
        """The surface by what other images told of the fade, and what is told of that now."""
        fade = self._memory.fade
        if float(np.max(np.abs(found.fit.by_fade))) < _NO_FADE:
            return found, fade
        if fade != USUAL_FADE:
            fit = self._fitter.again(found.view, found.fit, self._prior, fade)
            found = replace(found, fit=fit)
        return found, found.fit.fade

    def _found(self, choice: Choice) -> _Found:
        """The chosen surface with its flags; NOT_FOUND where the picture shows another one."""
        view, fit = choice.candidate.view, choice.candidate.fit
        if choice.believed:
            flags = self._flags(fit, view)
            # Of a surface that is cut off a bound alone is told.
            sure = (self._sure and not choice.doubtful) or Flag.SATURATED in flags
            return _Found(view, fit, flags if sure else flags | Flag.AMBIGUOUS)
        covered = self._wall.covered_border(view.picture)
        return _Found(view, fit, Flag.NOT_FOUND | (Flag.SATURATED if covered else Flag.NONE))

    def _unrolled(self, image: Image) -> Image:
        self._view.camera.check(image)
        return self._grid.unroll(image)

    def _flags(self, fit: SurfaceFit, view: Unrolled) -> Flag:
        flags = Flag.TOO_BRIGHT if view.clipped else Flag.NONE
        points = fit.points
        front = (fit.front_weight > INLIER) & ~points.bound
        upper = fit.upper_weight > INLIER
        if self._fitter.cut_off(fit):
            flags |= Flag.SATURATED
        looked_at = np.count_nonzero(~points.bound)
        read = np.count_nonzero(front | (upper & ~points.bound))
        impossible = float(np.hypot(*fit.heights[1:3])) > HIGHEST * self._view.cup.radius
        if impossible or read < max(_LEAST_READ * looked_at, _LEAST_POINTS):
            return flags | Flag.NOT_FOUND
        if read < (1.0 - _HIDDEN) * looked_at:
            flags |= Flag.OCCLUDED
        return flags

    def _measurement(self, stamp_ns: int, found: _Found) -> Measurement:
        if Flag.NOT_FOUND in found.flags:
            return self._lower_bound(stamp_ns, found)
        return self._read(stamp_ns, found)

    def _lower_bound(self, stamp_ns: int, found: _Found) -> Measurement:
        """Where no surface can be told, but liquid reaches the border: it is at least so high."""
        points = found.fit.points
        cut = points.bound & (self._wall.first_row > 0)
        if Flag.SATURATED not in found.flags or not np.any(cut):
            return Measurement(stamp_ns=stamp_ns, flags=found.flags)
        heights = np.where(cut, points.height - points.shapes @ self._zero, -np.inf)
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
            found.fit, self._zero, self._wall.footprint,
            cut_off=cut_off, shaded=found.view.scatters,
        )  # fmt: skip
        fitted, seen = reading.fitted(), reading.seen()
        highest = reading.highest(fitted, seen)
        flags = found.flags
        if reading.edge_width > self._settings.max_blur:
            flags |= Flag.BLURRED
        # Of a surface that is cut off a bound alone is told.
        if not cut_off:
            contradicted = reading.contradiction > 1.0 and highest.stddev > _UNTOLD
            if contradicted or (found.view.scatters and fitted.stddev > _UNTOLD):
                flags |= Flag.AMBIGUOUS
            if fitted.height - seen.height > _HIGHER:
                flags |= Flag.OCCLUDED
        left, right = (reading.at(azimuth) for azimuth in self._tangents)
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
            peak_pixel=self._wall_pixels(highest.azimuth, highest.height + self._zero[0]),
            peak_side=self._side(fitted.azimuth),
            flags=flags,
        )

    def _side(self, azimuth: float) -> PeakSide:
        towards = np.cos(azimuth - self._view.camera_azimuth)
        return PeakSide.FRONT if towards > 0.0 else PeakSide.REAR

    def _pixels(self, found: _Found, reading: SurfaceReading) -> FloatArray:
        front = self._grid.pixel_at(reading.front, found.fit.points.place)
        rear = self._grid.pixel_at(reading.rear, found.fit.upper_place)[::-1]
        return np.vstack((front, rear))
