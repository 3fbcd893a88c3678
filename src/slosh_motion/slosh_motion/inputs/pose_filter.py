"""Differentiates poses twice by polynomials that are fitted to a sliding window.

At each pose a polynomial of degree 5 is fitted to the poses around it (least squares; Savitzky and
Golay's filter, for samples at any spacing), of degree 4 where there are only 5 or 6 of them. Its
second derivative is the acceleration; where poses come slowly it is read off between the poses,
too, so that the straight lines between accelerations lose nothing.

The window is a time. For a wave of frequency ω a window that reaches to H on both sides has a gain
of 0.995 at ωH = 1.43, whatever the rate: the window is as long as that allows at the highest
natural frequency, for it averages the noise of the poses. A cubic, of degree 3, would have a fifth
to a quarter of the window at the same gain, and about nine times the noise; one of degree 7 twice
the delay.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba.types import UniTuple, float64, int64

from slosh_base.compiled.compilation import CHANGED_1, GIVEN_1, GIVEN_2, compiled, entry_point
from slosh_base.compiled.normal_equations import factorize, substitute
from slosh_motion.inputs.sampling import Modes, interpolation_gain
from slosh_motion.tuning import TUNING

FEWEST, MOST = 2, 100
"""Poses on each side of the centre; more than the second make nothing better but cost time."""
_MOST_PARTS = 9
_QUINTIC, _QUARTIC = 6, 5
CUBIC, LINEAR = 4, 2
"""Terms of the polynomials of old recordings, and of a straight line."""


class PoseFilter(NamedTuple):
    """Window length and polynomial degree of a filter that differentiates poses.

    Attributes:
        fastest: highest natural frequency [rad/s].
        reach: of the window on both sides [s].
        order: of the derivative that is taken: 2 of poses, 1 of velocities.
        most: terms of the polynomial; 0: six for poses, four for velocities.
    """

    fastest: float
    reach: float
    order: int = 2
    most: int = 0

    @classmethod
    def of(cls, modes: Modes, window: float, order: int = 2) -> PoseFilter:
        """Creates the filter that passes the frequencies of given sloshing modes.

        Args:
            modes: to be carried; none: of a small cup.
            window: length of the window [s]; 0: the longest one that carries them.
        """
        fastest = max((frequency for _, frequency in modes), default=TUNING.fastest_mode)
        longest = TUNING.reach if order == 2 else TUNING.velocity_reach
        return cls(fastest, 0.5 * window if window > 0.0 else longest / fastest, order)

    @classmethod
    def smoothing(cls, modes: Modes, delay: float, order: int = 2) -> PoseFilter:
        """Creates a filter with a given delay [s] and the lowest degree that passes the modes.

        A higher degree carries them over a longer window, which averages more noise.

        Args:
            modes: to be carried; none: of a small cup.
            delay: half of the window [s].
        """
        plain = cls.of(modes, 2.0 * delay, order)
        phase = plain.fastest * plain.reach
        reaches = TUNING.pose_reaches if order == 2 else TUNING.velocity_reaches
        higher = sum(phase > reach for reach in reaches)
        return plain._replace(most=(CUBIC if order == 2 else LINEAR) + 2 * higher)

    def terms(self, count: int) -> int:
        """Returns how many polynomial terms to fit to a given number of poses."""
        if self.most and count > self.most + 1:
            return self.most
        if self.order == 1:
            return CUBIC
        return _QUINTIC if count > 2 * FEWEST + 2 else _QUARTIC

    def side(self, interval: float) -> int:
        """Returns how many poses lie on each side of a window's centre, at a pose interval [s]."""
        # A pose stands for half an interval on both sides.
        return min(max(math.floor(self.reach / interval - 0.5), FEWEST), MOST)

    def parts(self, spacing: float) -> int:
        """Returns how many samples to compute per interval of `spacing` seconds between poses."""
        needed = min(math.ceil(self.fastest * spacing / TUNING.phase_step), _MOST_PARTS)
        return needed + 1 - needed % 2

    def gain(self, frequency: float, interval: float) -> float:
        """Returns the filter's amplitude gain for a wave, with linear interpolation of its output.

        Args:
            frequency: of the wave [rad/s].
            interval: between the poses [s].
        """
        side, parts = self.side(interval), self.parts(interval)
        places = np.arange(-side, side + 1.0)
        powers = np.vander(places / side, self.terms(len(places)), increasing=True)
        fit = np.linalg.pinv(powers)
        phase = frequency * interval
        passed = 0.0
        for part in range(parts):
            offset = (part - 0.5 * (parts - 1)) / parts
            angle, at, number = phase * (places - offset), offset / side, range(len(fit))
            if self.order == 1:
                slope = [k * at ** max(k - 1, 0) for k in number]
                passed += float(np.array(slope) @ fit @ np.sin(angle)) / (phase * side)
                continue
            curvature = [k * (k - 1) * at ** max(k - 2, 0) for k in number]
            passed -= float(np.array(curvature) @ fit @ np.cos(angle)) / (phase * side) ** 2
        return passed / parts * interpolation_gain(frequency, interval / parts)


@compiled
def _fit(tau: Any, scale: float, values: Any, terms: int) -> Any:
    """Fits polynomials in scaled time to a pose window; returns coefficients (3, terms).

    The centre is where tau is 0.
    """
    centre = values[np.argmin(np.abs(tau))]
    normal = np.zeros((terms, terms))
    right = np.zeros((3, terms))
    powers = np.ones(terms)
    for i in range(len(tau)):
        for p in range(1, terms):
            powers[p] = powers[p - 1] * tau[i] / scale
        for p in range(terms):
            for q in range(terms):
                normal[p, q] += powers[p] * powers[q]
            for axis in range(3):
                right[axis, p] += powers[p] * (values[i, axis] - centre[axis])
    factorize(normal, terms)
    for axis in range(3):
        substitute(normal, terms, right[axis])
    return right


@compiled
def _reach(tau: Any) -> float:
    """Returns the largest time distance from the window's centre [s], the time scale of fits."""
    reach = 0.0
    for one in tau:
        reach = max(reach, abs(one))
    return reach


@compiled
def _change(row: Any, x: float) -> float:
    """Returns a polynomial's value at x minus its value at the window's centre."""
    total = 0.0
    for k in range(len(row) - 1, 0, -1):
        total = (total + row[k]) * x
    return total


@compiled
def _even(tau: Any, interval: float, out: Any) -> None:
    """Writes evenly spaced times for measured times, each a multiple of `interval` apart.

    They count from the one that belongs to the centre; the last place receives that one's own.
    """
    count = len(tau)
    tick = 0.0
    steps, times, squares, products = 0.0, 0.0, 0.0, 0.0
    for i in range(count):
        if i > 0:
            tick += max(math.floor((tau[i] - tau[i - 1]) / interval + 0.5), 1.0)
        out[i] = tick
        steps += tick
        times += tau[i]
        squares += tick * tick
        products += tick * tau[i]
    slope = (products - steps * times / count) / (squares - steps * steps / count)
    middle = out[np.argmin(np.abs(tau))]
    for i in range(count):
        out[i] = slope * (out[i] - middle)
    out[count] = times / count + slope * (middle - steps / count)


@compiled
def _misfit(tau: Any, positions: Any, terms: int) -> float:
    """Returns the sum of squared residuals [m²] of polynomials fitted to positions."""
    scale = _reach(tau)
    rows = _fit(tau, scale, positions, terms)
    centre = positions[np.argmin(np.abs(tau))]
    total = 0.0
    for i in range(len(tau)):
        for axis in range(3):
            value = rows[axis, 0] + _change(rows[axis], tau[i] / scale)
            total += (positions[i, axis] - centre[axis] - value) ** 2
    return total


@compiled
def _slope(row: Any, x: float) -> Any:
    """Returns the first derivative of a polynomial at x."""
    total = 0.0
    for k in range(len(row) - 1, 1, -1):
        total = (total + k * row[k]) * x
    return total + row[1]


@compiled
def _half_curvature(row: Any, x: float) -> Any:
    """Returns half of the second derivative of a polynomial at x."""
    if x == 0.0:
        return row[2]
    total = 0.0
    for k in range(len(row) - 1, 2, -1):
        total = (total + 0.5 * k * (k - 1) * row[k]) * x
    return total + row[2]


@entry_point(UniTuple(float64, 3)(GIVEN_1, GIVEN_2, int64, float64))
def second_derivative(tau: Any, positions: Any, terms: int, offset: float) -> Any:
    """Returns the acceleration [m/s²] from a polynomial fitted to positions.

    Args:
        tau: (N,) time from the centre, at which it is 0 [s].
        positions: (N, 3) [m].
        offset: from the centre, where it is wanted [s].

    Returns:
        its three components [m/s²].
    """
    scale = _reach(tau)
    rows = _fit(tau, scale, positions, terms)
    factor, x = 2.0 / (scale * scale), offset / scale
    return (
        _half_curvature(rows[0], x) * factor,
        _half_curvature(rows[1], x) * factor,
        _half_curvature(rows[2], x) * factor,
    )


@entry_point(UniTuple(float64, 3)(GIVEN_1, GIVEN_2, int64, float64))
def first_derivative(tau: Any, velocities: Any, terms: int, offset: float) -> Any:
    """Returns the acceleration [m/s²] from a polynomial fitted to velocities.

    Args:
        tau: (N,) time from the centre, at which it is 0 [s].
        velocities: (N, 3) [m/s].
        offset: from the centre, where it is wanted [s].

    Returns:
        its three components [m/s²].
    """
    scale = _reach(tau)
    rows = _fit(tau, scale, velocities, terms)
    x = offset / scale
    return (
        _slope(rows[0], x) / scale, _slope(rows[1], x) / scale, _slope(rows[2], x) / scale
    )  # fmt: skip


@entry_point(UniTuple(float64, 3)(CHANGED_1, GIVEN_2, GIVEN_1, int64, float64))
def even_times(ticks: Any, positions: Any, tau: Any, first: int, interval: float) -> Any:
    """Fits a uniform clock to stamps, and checks whether the poses agree with it.

    Args:
        ticks: (N,) receives when a window's poses were taken, from the centre's tick [s].
        positions: (N, 3) of the window's poses [m].
        tau: (M,) time from the centre, at which it is 0, of the window's and of earlier poses [s].
        interval: between the poses [s].

    Returns:
        the mean squares by which cubics miss the positions at their stamps, and at the ticks [m²],
        and the centre's stamp from its tick [s].
    """
    found = np.empty(len(tau) + 1)
    _even(tau, interval, found)
    count = len(ticks)
    ticks[:] = found[first : first + count]
    stamped = _misfit(tau[first : first + count], positions, CUBIC)
    freedom = 3.0 * (count - CUBIC)
    return stamped / freedom, _misfit(ticks, positions, CUBIC) / freedom, -found[len(tau)]


@compiled
def _product(p: Any, q: Any) -> Any:
    """Returns the product of two quaternions."""
    px, py, pz, pw = p
    qx, qy, qz, qw = q
    return (
        pw * qx + px * qw + py * qz - pz * qy,
        pw * qy - px * qz + py * qw + pz * qx,
        pw * qz + px * qy - py * qx + pz * qw,
        pw * qw - px * qx - py * qy - pz * qz,
    )


@compiled
def _turned(attitude: Any, px: float, py: float, pz: float) -> Any:
    """Rotates an attitude by a rotation vector that is given in its own axes."""
    angle = math.sqrt(px * px + py * py + pz * pz)
    factor = math.sin(0.5 * angle) / angle if angle > 0.0 else 0.5
    return _product(attitude, (factor * px, factor * py, factor * pz, math.cos(0.5 * angle)))


@compiled
def _off_frame(px: float, py: float, pz: float, ux: float, uy: float, uz: float) -> Any:
    """Converts a rotation vector p's derivative u to angular velocity, to first order in p."""
    return (
        ux - 0.5 * (py * uz - pz * uy),
        uy - 0.5 * (pz * ux - px * uz),
        uz - 0.5 * (px * uy - py * ux),
    )


@entry_point(UniTuple(float64, 10)(GIVEN_1, GIVEN_2, int64, float64))
def turning(tau: Any, attitudes: Any, terms: int, offset: float) -> Any:
    """Returns attitude, angular velocity and angular acceleration from fitted attitudes.

    The rotations φ that lead from the centre's attitude to the others are differentiated, in the
    container's axes: at φ = 0 their derivatives are the angular velocity and acceleration.

    Args:
        tau: (N,) time from the centre, at which it is 0 [s].
        attitudes: (N, 4) quaternions x, y, z, w, world ← container, of any length but zero.
        offset: from the centre, where it is wanted [s].

    Returns:
        the attitude, of length 1, angular velocity [rad/s] and acceleration [rad/s²].
    """
    x, y, z, w = attitudes[np.argmin(np.abs(tau))]
    length = math.sqrt(x * x + y * y + z * z + w * w)
    x, y, z, w = x / length, y / length, z / length, w / length
    rotations = np.empty((len(tau), 3))
    for i in range(len(tau)):
        bx, by, bz, bw = attitudes[i]
        # The centre's conjugate times the other.
        rx, ry, rz = (
            w * bx - x * bw - y * bz + z * by,
            w * by - y * bw - z * bx + x * bz,
            w * bz - z * bw - x * by + y * bx,
        )
        rw = w * bw + x * bx + y * by + z * bz
        if rw < 0.0:
            rx, ry, rz, rw = -rx, -ry, -rz, -rw
        size = math.sqrt(rx * rx + ry * ry + rz * rz)
        factor = 2.0 * math.atan2(size, rw) / size if size > 0.0 else 0.0
        rotations[i, 0], rotations[i, 1], rotations[i, 2] = factor * rx, factor * ry, factor * rz
    scale = _reach(tau)
    rows = _fit(tau, scale, rotations, terms)
    second = 2.0 / (scale * scale)
    if offset == 0.0:
        return (
            x, y, z, w, rows[0, 1] / scale, rows[1, 1] / scale, rows[2, 1] / scale,
            rows[0, 2] * second, rows[1, 2] * second, rows[2, 2] * second,
        )  # fmt: skip
    at = offset / scale
    px, py, pz = _change(rows[0], at), _change(rows[1], at), _change(rows[2], at)
    ux, uy, uz = (
        _slope(rows[0], at) / scale, _slope(rows[1], at) / scale, _slope(rows[2], at) / scale,
    )  # fmt: skip
    vx, vy, vz = (
        _half_curvature(rows[0], at) * second,
        _half_curvature(rows[1], at) * second,
        _half_curvature(rows[2], at) * second,
    )
    ux, uy, uz = _off_frame(px, py, pz, ux, uy, uz)
    vx, vy, vz = _off_frame(px, py, pz, vx, vy, vz)
    x, y, z, w = _turned((x, y, z, w), px, py, pz)
    return x, y, z, w, ux, uy, uz, vx, vy, vz
