"""Simulates what a height sensor measures of the liquid's true surface."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from validation.blind.truth_model import Truth

Array = NDArray[np.float64]


def measure(
    truth: Truth,
    t: Array,
    wave: Array,
    heading: Array,
    level: Array,
    times: Array,
    azimuths: Array | None,
) -> Array:
    """Returns the maximum height (M, 1) or wall heights (M, K) as measured, without noise [m].

    The order is the light's: the wave's shape, the film that it leaves on the wall, the part of
    the wall in view, the frame's edge, the sensor's lag, then the conversion to metres and the
    clock.

    Args:
        truth: what acts.
        t: (G,) fine times of the simulation [s].
        wave: (G, 2) height vector at the wall, in axes that do not yaw [m].
        heading: (G,) the container's yaw [rad].
        level: (G,) still level above the one at the motion's start [m].
        times: (M,) sample times [s].
        azimuths: (K,) [rad] from the container's +x; None: MSH.
    """
    seen = np.clip(times - truth.value("time_offset", "tau", 0.0), t[0], t[-1])
    if truth.has("draining_film") or truth.has("sensor_lag"):
        surface = _surface(truth, wave, heading, level, azimuths)
        if truth.has("draining_film"):
            speed = truth.value("draining_film", "speed", np.inf)
            descent = speed * (t - t[0])[:, np.newaxis]
            surface = np.maximum.accumulate(surface + descent, axis=0) - descent
        if truth.has("sensor_lag"):
            surface = np.minimum(surface, truth.value("frame_saturation", "cap", np.inf))
            surface = _lag(t, surface, truth.value("sensor_lag", "time", 0.0))
        surface = np.stack([np.interp(seen, t, row) for row in surface.T], axis=1)
    else:
        curve = CubicSpline(t, np.column_stack([wave, heading, level]))(seen)
        surface = _surface(truth, curve[:, :2], curve[:, 2], curve[:, 3], azimuths)
    surface = np.minimum(surface, truth.value("frame_saturation", "cap", np.inf))
    gain = truth.value("height_scale", "gain", 1.0)
    return np.asarray(gain * surface + truth.value("height_offset", "offset", 0.0))


def _surface(
    truth: Truth, wave: Array, heading: Array, level: Array, azimuths: Array | None
) -> Array:
    """Returns the true maximum or wall heights above the still level at the start [m]."""
    size = np.hypot(wave[:, 0], wave[:, 1])
    crest = np.arctan2(wave[:, 1], wave[:, 0]) - heading
    if azimuths is not None:
        height = size[:, np.newaxis] * np.cos(azimuths - crest[:, np.newaxis])
    elif truth.has("visible_arc"):
        centre = truth.value("visible_arc", "centre", 0.0)
        half = 0.5 * truth.value("visible_arc", "width", 2.0 * np.pi)
        away = np.abs((crest - centre + np.pi) % (2.0 * np.pi) - np.pi)
        height = (size * np.cos(np.maximum(away - half, 0.0)))[:, np.newaxis]
    else:
        height = size[:, np.newaxis]
    sharp = truth.value("crest_asymmetry", "kappa", 0.0) / truth.radius
    return np.asarray(height + sharp * height**2 + level[:, np.newaxis])


def _lag(t: Array, surface: Array, time: float) -> Array:
    """Applies a first-order lag, exactly for heights that vary linearly between samples."""
    out = np.empty_like(surface)
    out[0] = surface[0]
    for i, step in enumerate(np.diff(t)):
        keep = np.exp(-step / time)
        rate = (surface[i + 1] - surface[i]) / step
        behind = out[i] - surface[i] + rate * time
        out[i + 1] = surface[i + 1] - rate * time + keep * behind
    return out
