"""Computes how much image disturbances reduce the camera's accuracy, without any output."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import with_tools  # noqa: F401
from camera_disturbances import Disturbance
from camera_figures import (
    Detector,
    DetectorFactory,
    FrameResult,
    Options,
    flag_counts,
    measure_sequence,
    rms,
    value_of,
)
from camera_sequences import RenderedSequence

from slosh_camera.errors import SloshCameraError
from slosh_camera.measurement import Flag
from slosh_camera.optics.calibration import Calibration

# Flags with which the detector says that it cannot be trusted in this frame.
WARNINGS = (
    Flag.TOO_DARK
    | Flag.TOO_BRIGHT
    | Flag.BLURRED
    | Flag.OCCLUDED
    | Flag.NOT_FOUND
    | Flag.BAD_IMAGE
    | Flag.SATURATED
)
# From here on an RMS counts as worse.
WORSE = 2.0
NAN = math.nan


@dataclass(frozen=True, slots=True, eq=False)
class Disturbed:
    """Results of one sequence under one disturbance, over all complete frames.

    Attributes:
        sequence: name of the sequence.
        frames: number of frames.
        results: of each; none where the detector refused the sequence.
        refusal: why it did.
        crash: how it failed otherwise.
    """

    sequence: str
    frames: int
    results: tuple[FrameResult, ...]
    refusal: str = ""
    crash: str = ""


@dataclass(frozen=True, slots=True)
class Spread:
    """Errors of one kind of height in frames without a warning.

    Attributes:
        rms: [m].
        largest: [m].
        ratio: rms over that of the undisturbed frames without a warning [1].
    """

    rms: float
    largest: float
    ratio: float


@dataclass(frozen=True, slots=True)
class DisturbedFigures:
    """Effect of one disturbance on the accuracy of one or several sequences.

    Attributes:
        name: of the disturbance.
        sequence: name of the sequence.
        on_still: the image of the liquid at rest was disturbed as well.
        frames: frames that are not cut off.
        warned: those that carry a warning; a refused sequence warns of all.
        silent: those without a height and without a warning.
        flags: how often each flag is set.
        raw: errors of the highest point.
        fitted: errors of the fitted line.
        refusals: why the detector refused sequences.
        crashes: how it failed otherwise.
    """

    name: str
    sequence: str
    on_still: bool
    frames: int
    warned: int
    silent: int
    flags: dict[str, int]
    raw: Spread
    fitted: Spread
    refusals: tuple[str, ...] = ()
    crashes: tuple[str, ...] = ()

    @property
    def shortfalls(self) -> tuple[str, ...]:
        """Names of quantities that become twice as wrong without a warning."""
        checks = {
            "highest point": self.raw.ratio >= WORSE,
            "fitted line": self.fitted.ratio >= WORSE,
            f"{self.silent} without height or flag": self.silent > 0,
            f"crash: {'; '.join(self.crashes)}": bool(self.crashes),
        }
        return tuple(text for text, bad in checks.items() if bad)


def measure_disturbed(
    sequence: RenderedSequence,
    factory: DetectorFactory,
    options: Options,
    disturbance: Disturbance,
) -> Disturbed:
    """Measures a sequence under a disturbance, without frames that are cut off.

    Args:
        sequence: undisturbed.
        factory: makes the detector.
        options: how to measure.
        disturbance: which; UNDISTURBED too.
    """
    frames = tuple(truth for truth in sequence.frames if not truth.touches_top)
    part = replace(sequence, frames=frames)

    def told(calibration: Calibration) -> Detector:
        # The images' own calibration stays as it is: the disturbance is drawn with it.
        return factory(disturbance.calibration(calibration))

    try:
        results = measure_sequence(part, told, options, disturbance)
    except SloshCameraError as error:
        return Disturbed(sequence.name, len(frames), (), refusal=str(error))
    except Exception as error:
        # A failure under one disturbance is a result; the others are wanted all the same.
        return Disturbed(sequence.name, len(frames), (), crash=f"{type(error).__name__}: {error}")
    return Disturbed(sequence.name, len(frames), results)


def disturbed_figures(
    disturbance: Disturbance, name: str, parts: Sequence[Disturbed], plain: Sequence[Disturbed]
) -> DisturbedFigures:
    """Computes the accuracy under one disturbance, relative to the undisturbed one.

    Args:
        disturbance: which.
        name: of the sequence or of all.
        parts: measured under it.
        plain: the same sequences undisturbed.
    """
    results = [result for part in parts for result in part.results]
    refused = [part for part in parts if part.refusal]
    unwarned = _unwarned(parts)
    return DisturbedFigures(
        name=disturbance.name,
        sequence=name,
        on_still=disturbance.on_still,
        frames=sum(part.frames for part in parts),
        warned=len(results) - len(unwarned) + sum(part.frames for part in refused),
        silent=sum(math.isnan(result.measured.msh) for result in unwarned),
        flags=flag_counts(results),
        raw=_spread("msh", unwarned, _unwarned(plain)),
        fitted=_spread("fitted_msh", unwarned, _unwarned(plain)),
        refusals=tuple(part.refusal for part in refused),
        crashes=tuple(part.crash for part in parts if part.crash),
    )


def _unwarned(parts: Sequence[Disturbed]) -> list[FrameResult]:
    return [
        result for part in parts for result in part.results if not result.measured.flags & WARNINGS
    ]


def _spread(kind: str, results: Sequence[FrameResult], plain: Sequence[FrameResult]) -> Spread:
    errors, reference = (
        np.array([value_of(entry.measured, kind) - entry.truth.msh for entry in entries])
        for entries in (results, plain)
    )
    known = np.abs(errors[np.isfinite(errors)])
    base = rms(reference)
    size = rms(errors)
    return Spread(size, float(known.max()) if known.size else NAN, size / base if base else NAN)
