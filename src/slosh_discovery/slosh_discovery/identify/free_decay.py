"""The state in which a free decay begins: it is fitted, too, and the fit starts from a guess."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slosh_discovery.discover.problem import LONGEST_STEP, PreparedMotion
from slosh_model.measure import measured_heights
from slosh_model.model import Model
from slosh_model.simulate import Inputs, Response, State, simulate

Array = NDArray[np.float64]

IN_LINE = 1e-6
"""Azimuths whose sines differ by less lie on one line through the middle."""
LEAST_WIDTH = 0.05
"""Least width of a path that the maximum over the wall tells of, relative to its length: of a
straight one the width could not be fitted."""
_STILL = np.zeros(4)


def state_basis(prepared: PreparedMotion) -> Array:
    """(4, D) which states of a mode the heights tell of: x, y and the velocities over ω [m].

    Heights along one line tell of the state along it; the maximum over the wall does not tell how
    the path is turned, and it is turned so that it begins on the x axis.
    """
    azimuths = prepared.azimuths
    if azimuths is None:
        return np.eye(4)[:, [0, 2, 3]]
    if np.abs(np.sin(azimuths - azimuths[0])).max() < IN_LINE:
        c, s = math.cos(azimuths[0]), math.sin(azimuths[0])
        return np.array([[c, 0.0], [s, 0.0], [0.0, c], [0.0, s]])
    return np.eye(4)


def decayed(prepared: PreparedMotion, model: Model, state: Array) -> Array:
    """(N, 2) the liquid's heights at +x and +y after it was let go, at the inputs' moments [m].

    Args:
        prepared: the motion.
        model: the model.
        state: (4,) of the first mode at the inputs' start, velocities over ω [m].
    """
    response = _response(prepared.inputs_for(model), model, state)
    return np.column_stack([response.sh_x, response.sh_y])


def guessed_state(prepared: PreparedMotion, model: Model) -> Array:
    """(D,) the state, in `state_basis`, from which the model decays about as measured."""
    if prepared.azimuths is None:
        return _guess_from_maximum(prepared, model)
    basis, kept = state_basis(prepared), prepared.kept
    linear = model.linear()
    columns = []
    for direction in range(basis.shape[1]):
        response = _response(prepared.coarse, linear, basis[:, direction])
        heights = measured_heights(linear, response, prepared.azimuths)[prepared.rows]
        columns.append(heights[kept])
    measured = prepared.heights[kept]
    state = np.linalg.lstsq(np.column_stack(columns), measured, rcond=None)[0]
    return np.asarray(state, dtype=np.float64)


def _response(inputs: Inputs, model: Model, state: Array) -> Response:
    modes = model.mode_constants()
    modal = np.zeros((len(modes), 4))
    omega = modes[0].natural_frequency
    modal[0] = state * np.array([1.0, 1.0, omega, omega])
    begin = State(float(inputs.t[0]), modal, _STILL)
    return simulate(model, inputs, begin, max_step=LONGEST_STEP)[0]


def _guess_from_maximum(prepared: PreparedMotion, model: Model) -> Array:
    """Of the maximum's square, which has no kinks: a constant and a wave of twice the frequency.

    Both decay alike. An ellipse with the half axes P and Q gives (P² ± Q²)/2 of the two.
    """
    mode, gain = model.mode_constants()[0], model.height_gains()[0]
    since = prepared.t - prepared.coarse.t[0]
    turned = mode.natural_frequency * math.sqrt(1.0 - mode.damping_ratio**2) * since
    decay = np.exp(-2.0 * mode.damping_ratio * mode.natural_frequency * since)
    columns = np.column_stack([decay, decay * np.cos(2 * turned), decay * np.sin(2 * turned)])
    squares = (prepared.heights[:, 0] / gain) ** 2
    mean, cosine, sine = np.linalg.lstsq(columns, squares, rcond=None)[0].tolist()
    wave, phase = math.hypot(cosine, sine), 0.5 * math.atan2(sine, cosine)
    long = math.sqrt(max(mean + wave, 0.0))
    short = max(math.sqrt(max(mean - wave, 0.0)), LEAST_WIDTH * long)
    place = complex(long * math.cos(phase), -short * math.sin(phase))
    speed = complex(long * math.sin(phase), short * math.cos(phase))
    # Turned so that it begins on the x axis.
    size = abs(place)
    speed *= place.conjugate() / size if size > 0.0 else 1.0
    return np.array([size, speed.real, speed.imag])
