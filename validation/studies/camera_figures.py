"""Computes the accuracy of a detector against exact heights, without any output."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
import with_tools  # noqa: F401
from camera_sequences import FrameTruth, Image, RenderedSequence, read_image
from numpy.typing import NDArray

from slosh_camera.measurement import Flag, Measurement, PeakSide
from slosh_camera.optics.calibration import Calibration

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

# Below this height the azimuth of a peak and its wall say little.
HIGH = 0.005
# An error of this size must not go without a flag.
LARGE = 0.001
NAN = math.nan


class Detector(Protocol):
    """Interface of the detector under test."""

    def learn_still(self, image: Image) -> float:
        """Uses an image of the liquid at rest as reference."""

    def update(self, stamp_ns: int, image: Image) -> Measurement:
        """Measures the next image of a sequence."""


DetectorFactory = Callable[[Calibration], Detector]
Change = Callable[[Image, RenderedSequence, FrameTruth | None], Image]


@dataclass(frozen=True, slots=True)
class Options:
    """Options for measuring a sequence: use of the image at rest, grey images.

    Attributes:
        still: learn from the image of the liquid at rest.
        grey: read the images in grey.
    """

    still: bool = True
    grey: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class FrameResult:
    """Exact and measured values of one frame."""

    truth: FrameTruth
    measured: Measurement
    camera_azimuth: float

    @property
    def fitted_side(self) -> PeakSide:
        """Wall (front or rear) on which the fitted highest point lies."""
        azimuth = value_of(self.measured, "fitted_azimuth")
        if math.isnan(azimuth):
            return PeakSide.UNKNOWN
        front = math.cos(azimuth - self.camera_azimuth) > 0.0
        return PeakSide.FRONT if front else PeakSide.REAR


@dataclass(frozen=True, slots=True)
class HeightFigures:
    """Accuracy of one kind of height, raw or fitted, over all complete frames.

    Attributes:
        count: frames with a height.
        missing: frames without.
        rms: of the error [m].
        largest: largest size of the error [m].
        bias: mean error [m].
        azimuth_rms: of the peak's azimuth where it is high [rad].
        side_count: frames with a high peak clearly on the front or the rear wall.
        side_right: those for which that wall was named.
        within_1: share of the errors within the claimed standard deviation.
        within_2: share within twice that.
        sigma: median of the claimed standard deviation [m].
        silent: errors of more than a millimetre without any flag.
    """

    count: int
    missing: int
    rms: float
    largest: float
    bias: float
    azimuth_rms: float
    side_count: int
    side_right: int
    within_1: float
    within_2: float
    sigma: float
    silent: int

    @property
    def side_share(self) -> float:
        """Share of frames with the right wall named; NaN if no wall was named."""
        return self.side_right / self.side_count if self.side_count else NAN


@dataclass(frozen=True, slots=True)
class SequenceFigures:
    """Accuracy of all measured quantities in one sequence.

    Attributes:
        name: of the sequence.
        frames: number of frames.
        uncut: frames whose liquid does not touch the image's top.
        raw: the highest point.
        fitted: the fitted line.
        left_rms: error of the height at the left edge, uncut frames [m].
        right_rms: at the right edge [m].
        cut: frames whose liquid touches the image's top.
        cut_flagged: those that carry SATURATED.
        cut_silent: those that carry no flag at all.
        bound_broken: those whose raw height is more than 1 mm above the truth.
        outside: frames whose peak projects outside the image.
        outside_flagged: those that carry SATURATED.
        false_saturated: uncut frames that carry SATURATED.
        other_flags: how often each other flag is set, over all frames.
    """

    name: str
    frames: int
    uncut: int
    raw: HeightFigures
    fitted: HeightFigures
    left_rms: float
    right_rms: float
    cut: int
    cut_flagged: int
    cut_silent: int
    bound_broken: int
    outside: int
    outside_flagged: int
    false_saturated: int
    other_flags: Mapping[str, int]


def evaluate(
    sequence: RenderedSequence, factory: DetectorFactory, options: Options | None = None
) -> SequenceFigures:
    """Measures a sequence and returns the accuracy against its exact heights."""
    return figures(sequence.name, measure_sequence(sequence, factory, options or Options()))


def measure_sequence(
    sequence: RenderedSequence,
    factory: DetectorFactory,
    options: Options,
    change: Change | None = None,
) -> tuple[FrameResult, ...]:
    """Measures all frames of a sequence with a new detector.

    Args:
        sequence: the frames.
        factory: makes the detector.
        options: how.
        change: changes an image before it is measured; None stands for the still image.

    Raises:
        SloshCameraError: an image is missing or the detector refuses it.
    """

    def image(path: Path, truth: FrameTruth | None) -> Image:
        plain = read_image(path, grey=options.grey)
        return plain if change is None else change(plain, sequence, truth)

    detector = factory(sequence.calibration)
    if options.still and sequence.still is not None:
        detector.learn_still(image(sequence.still, None))
    azimuth = sequence.calibration.view.camera_azimuth
    return tuple(
        FrameResult(truth, detector.update(truth.stamp_ns, image(truth.path, truth)), azimuth)
        for truth in sequence.frames
    )


def figures(name: str, results: Sequence[FrameResult]) -> SequenceFigures:
    """Computes the accuracy from the results of frames, of one or several sequences."""
    uncut = [result for result in results if not result.truth.touches_top]
    cut = [result for result in results if result.truth.touches_top]
    outside = [result for result in results if result.truth.peak_outside]
    left = [result.measured.sh_left - result.truth.sh_left for result in uncut]
    right = [result.measured.sh_right - result.truth.sh_right for result in uncut]
    return SequenceFigures(
        name=name,
        frames=len(results),
        uncut=len(uncut),
        raw=_raw_figures(uncut),
        fitted=_fitted_figures(uncut),
        left_rms=rms(left),
        right_rms=rms(right),
        cut=len(cut),
        cut_flagged=_saturated(cut),
        cut_silent=sum(not result.measured.flags for result in cut),
        bound_broken=sum(result.measured.msh > result.truth.msh + 1e-3 for result in cut),
        outside=len(outside),
        outside_flagged=_saturated(outside),
        false_saturated=_saturated(uncut),
        other_flags=flag_counts(results, without=Flag.SATURATED),
    )


def flag_counts(results: Iterable[FrameResult], without: Flag = Flag.NONE) -> dict[str, int]:
    """Counts by flag the frames that carry it."""
    names = (
        str(flag.name)
        for result in results
        for flag in _flags(result.measured)
        if flag not in without
    )
    return dict(sorted(Counter(names).items()))


def rms(errors: Sequence[float] | FloatArray) -> float:
    """Returns the root mean square of the finite values; NaN if there are none."""
    values = np.asarray(errors, dtype=np.float64)
    values = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(values**2))) if values.size else NAN


def value_of(measured: Measurement, name: str) -> float:
    """Returns a number of a measurement; NaN if the detector does not provide it."""
    return float(getattr(measured, name, NAN))


def _raw_figures(uncut: Sequence[FrameResult]) -> HeightFigures:
    sides = [result.measured.peak_side for result in uncut]
    return _height_figures(uncut, ("msh", "msh_stddev", "azimuth"), sides)


def _fitted_figures(uncut: Sequence[FrameResult]) -> HeightFigures:
    names = ("fitted_msh", "fitted_msh_stddev", "fitted_azimuth")
    return _height_figures(uncut, names, [result.fitted_side for result in uncut])


def _height_figures(
    uncut: Sequence[FrameResult], names: tuple[str, str, str], sides: Sequence[PeakSide]
) -> HeightFigures:
    height, sigma, azimuth = (
        np.array([value_of(result.measured, name) for result in uncut]) for name in names
    )
    true = np.array([result.truth.msh for result in uncut])
    unflagged = np.array([not result.measured.flags for result in uncut], dtype=np.bool_)
    turned = azimuth - np.array([result.truth.azimuth for result in uncut])
    error = (height - true)[np.isfinite(height)]
    claimed = sigma[np.isfinite(height)]
    known = np.isfinite(claimed)
    to_name = [
        (result.truth.side, side)
        for result, side in zip(uncut, sides, strict=True)
        if result.truth.msh > HIGH and result.truth.side is not PeakSide.UNKNOWN
    ]
    return HeightFigures(
        count=error.size,
        missing=len(uncut) - error.size,
        rms=rms(error),
        largest=float(np.max(np.abs(error))) if error.size else NAN,
        bias=float(np.mean(error)) if error.size else NAN,
        azimuth_rms=rms(np.arctan2(np.sin(turned), np.cos(turned))[true > HIGH]),
        side_count=len(to_name),
        side_right=sum(truth is side for truth, side in to_name),
        within_1=_share(np.abs(error[known]) <= claimed[known]),
        within_2=_share(np.abs(error[known]) <= 2.0 * claimed[known]),
        sigma=float(np.median(claimed[known])) if known.any() else NAN,
        silent=int(np.count_nonzero(unflagged & (np.abs(height - true) > LARGE))),
    )


def _share(condition: BoolArray) -> float:
    return float(np.mean(condition)) if condition.size else NAN


def _saturated(results: Iterable[FrameResult]) -> int:
    return sum(Flag.SATURATED in result.measured.flags for result in results)


def _flags(measured: Measurement) -> Iterator[Flag]:
    return (flag for flag in Flag if flag and flag in measured.flags)
