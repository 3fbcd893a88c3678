"""Detects the free surface in a side view [TM20, section 2.1, Fig. 3].

As in TM20 the face is cut out, split into liquid and background and the line found by Canny's
algorithm, here to a fraction of a pixel. A level and the first three sloshing modes are fitted to
it robustly, so that droplets, stickers and highlights do not matter; the slope is that of the
straight line of TM20, eq. (12).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from slosh_camera.errors import SloshCameraError
from slosh_camera.images.seams import RepeatedFrames, SeamFinder
from slosh_camera.images.still_edges import Edge, StillEdges, along_end, along_side
from slosh_camera.measurement import NAN, Flag, Measurement, PeakSide
from slosh_camera.optics.box import BoxView
from slosh_camera.optics.calibration import SideCalibration
from slosh_camera.optics.round_body import ELEVATION, RoundView
from slosh_camera.rectangle.appearance import learnt_appearance
from slosh_camera.rectangle.fit import BOW, FittedLine, RoundWaves, refined_shape
from slosh_camera.rectangle.profile import Profile, common_error, describe
from slosh_camera.rectangle.region import find_side_region, round_wall
from slosh_camera.rectangle.trace import Knowledge, Light, TracedLine, trace_line
from slosh_camera.rectangle.tuning import TUNING
from slosh_camera.settings import DetectionSettings

Image = NDArray[np.uint8]


@dataclass(frozen=True, slots=True, eq=False)
class SideMeasurement(Measurement):
    """Free-surface measurement of a side view.

    Attributes:
        slope_stddev: standard deviation of slope_angle [rad].
    """

    slope_stddev: float = NAN


class SideViewDetector:
    """Free-surface detector for one calibrated camera with a side view."""

    def __init__(
        self, calibration: SideCalibration, settings: DetectionSettings | None = None
    ) -> None:
        """Determines the image region in which the contact line is searched.

        Args:
            calibration: camera, container and pose.
            settings: settings; None: those of the calibration. `liquid` does not
                matter: liquid and background are told by where they are.

        Raises:
            SloshCameraError: too little of the container is inside the image.
        """
        self._view = calibration.view
        self._settings = settings or calibration.detection
        self._region = find_side_region(calibration.view, calibration.region)
        self._knowledge = Knowledge()
        self._still_edges = StillEdges(outer_edges(self._view), self._view.camera.size)
        self._repeats = RepeatedFrames()
        rows, columns = self._region.window
        window = columns.start, rows.start, columns.stop, rows.stop
        # The line on the rear wall is not looked for.
        self._seams = SeamFinder(window, all_lines=False)

    @property
    def still_offset(self) -> float:
        """Offset measured on the liquid at rest, which is subtracted from heights [m]."""
        return self._knowledge.level

    @property
    def doubt(self) -> str:
        """Returns an empty text, since an ambiguous image of the liquid at rest is an error."""
        return ""

    def learn_still(self, image: Image) -> float:
        """Uses an image of the liquid at rest as reference for heights, slope and grey levels.

        Args:
            image: (height, width) or (height, width, 3) image of the liquid at rest.

        Returns:
            The offset [m] of the still level against the calibration, in the middle.

        Raises:
            SloshCameraError: the image does not fit the camera, or shows no whole, level line;
                what was learnt before stays.
        """
        self._view.camera.check(image)
        trace = trace_line(self._view, self._region, self._settings, Knowledge(), image)
        light, line = trace.light, trace.line
        whole = line is not None and line.hidden <= TUNING.most_hidden_still
        if light is None or line is None or not whole or Flag.SATURATED in trace.flags:
            raise SloshCameraError(
                "still image: shows no complete liquid line, check light, region and calibration"
            )
        profile = describe(line, self._view)
        level, slope = profile.level, float(np.tan(profile.slope_angle))
        if abs(slope) > TUNING.still_slope:
            raise SloshCameraError(
                f"still image: the liquid's line is inclined by {np.degrees(np.arctan(slope)):.1f}"
                " deg, check that the liquid is at rest, and the calibration's pose"
            )
        bow = self._bow(line) if isinstance(self._view, RoundView) else None
        self._knowledge = self._learnt(light, Knowledge(level, slope, bow=bow))
        self._still_edges.learn(image)
        self._seams.learn(image)
        return level

    def update(self, stamp_ns: int, image: Image) -> Measurement:
        """Measures an image of a sequence, and flags a repeated image.

        Args:
            stamp_ns: moment of exposure [ns].

        Raises:
            SloshCameraError: as measure.
        """
        measurement = self.measure(stamp_ns, image)
        repeated = self._repeats.is_repeat(image, stamp_ns)
        return measurement.flagged(Flag.FROZEN) if repeated else measurement

    def measure(self, stamp_ns: int, image: Image) -> SideMeasurement:
        """Measures the free surface in a single image.

        Args:
            stamp_ns: moment of exposure [ns].
            image: (height, width) grey or (height, width, 3) blue-green-red.

        Returns:
            The measurement; what the image does not show is NaN, with a flag that says why.

        Raises:
            SloshCameraError: the image is not 8-bit of the calibrated size.
        """
        self._view.camera.check(image)
        if self._still_edges.missing(image):
            return SideMeasurement(stamp_ns=stamp_ns, flags=Flag.NOT_FOUND)
        trace = trace_line(self._view, self._region, self._settings, self._knowledge, image)
        if trace.line is None:
            return SideMeasurement(stamp_ns=stamp_ns, flags=trace.flags)
        flags = trace.flags | _limits(trace.line)
        if not flags and self._is_torn(image, trace.line):
            flags = Flag.AMBIGUOUS
        profile, scale_error = describe(trace.line, self._view), self._settings.scale_error
        found = _measurement(stamp_ns, flags, trace.line, profile, scale_error)
        return self._on_round_wall(found, trace.line)

    def look(self, image: Image) -> SideMeasurement:
        """Measures a single image; arguments and errors are those of `measure`."""
        return self.measure(0, image)

    def follow(self, stamp_ns: int, sighting: SideMeasurement) -> SideMeasurement:
        """Returns the result of `look` with its stamp [ns]; no other image is needed."""
        return replace(sighting, stamp_ns=stamp_ns)

    def _on_round_wall(self, found: SideMeasurement, line: TracedLine) -> SideMeasurement:
        """Replaces the heights by those around the whole wall if the container is round."""
        if not isinstance(self._view, RoundView):
            return found
        rest = self._knowledge.bow
        bow = 0.0 if rest is None else float(rest.coefficients[BOW])
        wall = round_wall(self._view, line.x, line.z, common_error(line), bow)
        doubt = Flag.AMBIGUOUS if wall.spread > TUNING.most_spread else Flag.NONE
        scale = self._settings.scale_error * wall.height
        stddev = float(np.hypot(wall.stddev, scale))
        return replace(
            found,
            msh=wall.height, msh_stddev=stddev, azimuth=wall.azimuth,
            fitted_msh=wall.height, fitted_msh_stddev=stddev, fitted_azimuth=wall.azimuth,
            sh_left=wall.left, sh_right=wall.right,
            flags=found.flags | doubt,
        )  # fmt: skip

    def _is_torn(self, image: Image, line: TracedLine) -> bool:
        """Whether the upper and lower part of an image were taken at different times."""
        steps = self._seams.steps(image)
        if not steps.rows.size:
            return False
        # As fitted: what was traced runs along a seam, too.
        heights = line.shape.at(line.x) + line.knowledge.zero(line.x)
        u, v = self._view.project_face(line.x, heights).T
        return self._seams.is_torn(steps, (u, v))

    def _bow(self, line: TracedLine) -> FittedLine:
        """Fits the curved contact line at rest without second-order waves, which look alike.

        Raises:
            SloshCameraError: its curvature shows a camera that is not level.
        """
        waves = line.shape.waves
        assert isinstance(waves, RoundWaves)
        start = replace(line.shape, waves=waves.at_rest())
        none = np.empty(0), np.empty(0)
        shape = refined_shape(line.x, line.z, start, TUNING.least_scatter, none)
        elevation = float(np.arctan(shape.coefficients[BOW] / (0.5 * shape.width)))
        if abs(elevation) > ELEVATION:
            raise SloshCameraError(
                f"still image: the liquid's line is bent as seen from {np.degrees(elevation):.0f} "
                f"deg above it, must be within {np.degrees(ELEVATION):.0f} deg: lower or raise "
                "the camera to the still level and let it look level"
            )
        return shape

    def _learnt(self, light: Light, still: Knowledge) -> Knowledge:
        """Stores grey levels of liquid and background from an image of the liquid at rest."""
        columns = np.arange(self._region.inside.shape[1])
        rows = self._region.rows_at(np.zeros(columns.size))
        corner = np.array([self._region.left, self._region.top])
        x, _ = self._view.on_face(np.column_stack((columns, rows)) + corner)
        rows = self._region.rows_at(still.zero(x))
        weights = light.appearance.weights
        appearance = learnt_appearance(light.channel, self._region, weights, rows)
        return replace(still, appearance=appearance)


def _limits(line: TracedLine) -> Flag:
    flags = Flag.NONE
    if line.hidden > TUNING.most_hidden:
        flags |= Flag.OCCLUDED
    if float(np.median(line.softness)) > TUNING.blurred:
        flags |= Flag.BLURRED
    return flags


def _measurement(
    stamp_ns: int, flags: Flag, line: TracedLine, profile: Profile, scale_error: float
) -> SideMeasurement:
    """Creates the measurement from a contact line; azimuth is 0 for x > 0, pi for x < 0."""
    peak, fitted = profile.peak, profile.fitted
    return SideMeasurement(
        stamp_ns=stamp_ns,
        msh=peak.height,
        msh_stddev=float(np.hypot(peak.stddev, scale_error * peak.height)),
        azimuth=_azimuth(peak.x),
        fitted_msh=fitted.height,
        fitted_msh_stddev=float(np.hypot(fitted.stddev, scale_error * fitted.height)),
        fitted_azimuth=_azimuth(fitted.x),
        sh_left=profile.left,
        sh_right=profile.right,
        azimuth_left=float(np.pi),
        azimuth_right=0.0,
        slope_angle=profile.slope_angle,
        slope_stddev=profile.slope_stddev,
        profile_x=profile.x,
        profile_height=profile.height,
        edge_pixels=line.pixels,
        peak_pixel=profile.peak_pixel,
        peak_side=PeakSide.FRONT,
        flags=flags,
    )


def _azimuth(x: float) -> float:
    return 0.0 if x >= 0.0 else float(np.pi)


def outer_edges(view: BoxView) -> list[Edge]:
    """Projects the face's two sides, its floor and, if known, its rim into the image.

    Args:
        view: the container as the camera sees it.
    """
    box = view.box
    half = 0.5 * box.width
    levels, middle = along_side(box.fill_height), along_end(half)
    edges = [Edge(view.project_face(side, levels), True) for side in (-half, half)]
    edges.append(Edge(view.project_face(middle, -box.fill_height), False))
    if box.rim_level is not None:
        edges.append(Edge(view.project_face(middle, box.rim_level), False))
    return edges
