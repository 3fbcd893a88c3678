"""Reads bags whose measured heights use another clock and zero level than the motion does.

Such a bag is one run. The measured times are shifted so that the heights lie over the motion as
well as a model can tell; what is left of the offset is unknown and small.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array
from slosh_discovery.discover.motion import MeasuredMotion
from slosh_discovery.discover_data.heights import without_spikes
from slosh_discovery.discover_data.recording import BagRecording, Tell
from slosh_discovery.discover_data.splitting import DWELL_NS, recorded_spans
from slosh_discovery.errors import SloshDiscoveryError
from slosh_model.constants import GRAVITY
from slosh_model.errors import SloshModelError
from slosh_model.model import Model
from slosh_model.simulate import Inputs, simulate
from slosh_motion.recorded.motion import RecordedMotion
from slosh_motion.recorded.sources import noted_container
from slosh_motion.signals.alignment import (
    despike,
    estimate_clock_offset,
    find_still_level,
    onset_offset,
)
from slosh_report.errors import SloshReportError

SEARCH = 2.0
"""Half-width of the search around the onsets' offset [s]: where a container tilts, measured and
predicted heights may rise more than a second apart."""
ENDS_AT_REST = 0.5
"""A command whose last acceleration is smaller ends with the container at rest [m/s²]."""


def unrelated_motion(
    name: str, recording: BagRecording, model: Model | None, tell: Tell
) -> MeasuredMotion:
    """Reads the motion of a bag whose heights and inputs have unrelated clocks.

    Args:
        name: of the motion.
        recording: the bag's.
        model: of whose container and liquid the 3D-NL model lays the clocks over each other; None:
            the container that the bag's metadata names, or the onsets of acceleration and height
            where it names none.
        tell: is told what was done, one line each.

    Raises:
        SloshDiscoveryError: the container does not move, or too few heights lie over its motion.
    """
    path = recording.path
    if not recorded_spans(recording.motion):
        raise SloshDiscoveryError(
            f"{path}: the container does not move; there is nothing to compare"
        )
    motion = held_at_rest(recording.motion, DWELL_NS)
    origin = int(motion.stamps[0])
    t = (motion.stamps - origin) / SECOND
    heights = recording.heights
    measured_t = (heights.stamps - heights.stamps[0]) / SECOND
    clean, spikes = without_spikes(heights.msh)
    if spikes:
        tell(f"{path}: {spikes} single spikes of the measured height are left out")
    used = noted_model(recording.facts) if model is None else plain(model)
    offset, how = _offset(t, motion, measured_t, heights.msh, used)
    tell(f"{path}: the clocks are unrelated; the heights were shifted by {-offset:.3f} s ({how})")
    shifted = measured_t - offset
    kept = np.isfinite(clean) & (shifted >= t[0]) & (shifted <= t[-1])
    stddev = heights.stddev[kept]
    try:
        return MeasuredMotion(
            name,
            Inputs(t, motion.acceleration, motion.attitude, motion.angular_velocity),
            shifted[kept],
            msh=clean[kept],
            stddev=stddev if np.isfinite(stddev).any() else None,
            same_clock=False,
            level_known=False,
        )
    except (SloshDiscoveryError, SloshModelError) as error:
        raise SloshDiscoveryError(f"{path}: {error}") from None


def noted_model(facts: Mapping[str, str]) -> Model | None:
    """Returns a model of water in the container that a bag's metadata name, or None."""
    container = noted_container(facts)
    return None if container is None else plain(Model(container))


def plain(model: Model) -> Model:
    """Returns the 3D nonlinear model of a model's container and liquid, without any effects."""
    effectless = Model(model.container, model.liquid, model.damping_ratio)
    return effectless.spatial().nonlinear()


def held_at_rest(motion: RecordedMotion, duration_ns: int) -> RecordedMotion:
    """Extends a motion at its end by a standstill of a chosen duration [ns].

    A commanded motion ends where the container comes to rest; the camera goes on. The inputs go on
    with it: without acceleration, in the last attitude. A motion that is cut off stays as it is.

    Args:
        motion: at least two samples.
        duration_ns: of the rest [ns].
    """
    if len(motion.stamps) < 2 or np.linalg.norm(motion.acceleration[-1]) > ENDS_AT_REST:
        return motion
    step = int(np.median(np.diff(motion.stamps)))
    count = duration_ns // step
    still = np.zeros((count, 3))
    turning, attitude = motion.angular_velocity, motion.attitude
    return replace(
        motion,
        stamps=np.concatenate(
            [motion.stamps, motion.stamps[-1] + step * np.arange(1, count + 1, dtype=np.int64)]
        ),
        acceleration=np.concatenate([motion.acceleration, still]),
        attitude=None
        if attitude is None
        else np.concatenate([attitude, np.repeat(attitude[-1:], count, axis=0)]),
        angular_velocity=None if turning is None else np.concatenate([turning, still]),
    )


def _offset(
    t: Array, motion: RecordedMotion, measured_t: Array, height: Array, model: Model | None
) -> tuple[float, str]:
    """Returns the clock offset, heights minus motion [s], and the method that found it."""
    apparent = apparent_acceleration(motion)
    moving = recorded_spans(motion)
    origin = int(motion.stamps[0])
    first, last = ((ns - origin) / SECOND for ns in (moving[0].start_ns, moving[-1].end_ns))
    over = (t >= first) & (t <= last)
    try:
        if model is not None:
            predicted = simulate(model, Inputs(t, apparent))[0].msh
            still = find_still_level(measured_t, height)
            centre = onset_offset(measured_t, height, t, predicted, still)
            found = estimate_clock_offset(
                measured_t, height, t[over], predicted[over], centre=centre, search=SEARCH
            )
            return found.offset, f"by the model {model.name}"
        still = find_still_level(measured_t, height)
        size = np.hypot(apparent[:, 0], apparent[:, 1])
        return onset_offset(measured_t, height, t, size, still), "by the onset of the motion"
    except (SloshModelError, SloshReportError):
        return _peak_offset(t, apparent, measured_t, height), "by the peaks"


def _peak_offset(t: Array, apparent: Array, measured_t: Array, height: Array) -> float:
    peak = int(np.nanargmax(despike(height)))
    return float(measured_t[peak] - t[int(np.argmax(np.hypot(apparent[:, 0], apparent[:, 1])))])


def apparent_acceleration(motion: RecordedMotion) -> Array:
    """Returns the exciting acceleration (N, 3) [m/s²], with gravity's part along a tilted floor.

    Rz(ψ) Rᵀ (a + g ẑ) - g ẑ in axes that do not follow the yaw ψ. Only the offset is found by it:
    whether the model knows about tilt is for the discovery to find.
    """
    if motion.attitude is None:
        return motion.acceleration
    turn = motion.attitude * np.array([0.0, 0.0, 1.0, 1.0])
    swing = Rotation.from_quat(motion.attitude) * Rotation.from_quat(turn).inv()
    force: Array = swing.inv().apply(motion.acceleration + np.array([0.0, 0.0, GRAVITY]))
    force[:, 2] -= GRAVITY
    return force
