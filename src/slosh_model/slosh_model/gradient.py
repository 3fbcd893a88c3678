"""Computes the gradient of the maximum height with respect to the acceleration samples.

The highest of the samples' heights is differentiated where it is attained: exact while that is one
sample. Where two samples are equally high there is a kink, as of every maximum; what is told there
is a subgradient. An optimiser that stumbles over kinks takes the smooth maximum instead.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from slosh_base.types import Array
from slosh_model.errors import SloshModelError
from slosh_model.gradient_kernel import pull_back
from slosh_model.layout import divided
from slosh_model.model import VERTICAL, Model
from slosh_model.response import Response
from slosh_model.simulate import MAXIMUM_STEP, Inputs, simulate, store_of

CURVED = "surface_nonlinearity"
COVERED = (VERTICAL, CURVED)
"""Effects on the dynamics whose derivatives are known, beside those that change the modes."""


@dataclass(frozen=True, slots=True, eq=False)
class HeightGradient:
    """The maximum height of a motion and its gradient.

    Attributes:
        height: highest MSH of the samples, or its smooth maximum [m].
        index: sample at which the highest is attained.
        gradient: (N, 3) derivative by the acceleration samples [m per m/s²].
        response: the liquid's answer.
    """

    height: float
    index: int
    gradient: Array
    response: Response


def peak_gradient(
    model: Model, inputs: Inputs, *, smoothing: float = 0.0, max_step: float = MAXIMUM_STEP
) -> HeightGradient:
    """Computes the maximum height of a motion from rest, and its gradient.

    >>> from slosh_model import Model
    >>> t = np.linspace(0.0, 1.0, 201)
    >>> move = Inputs(t, np.outer(np.sin(12.0 * t), [1.0, 0.0, 0.0]))  # m/s²
    >>> found = peak_gradient(Model.from_cup(diameter=0.08, fill_height=0.06), move)
    >>> round(found.height, 4), found.gradient.shape
    (0.0077, (201, 3))

    By the adjoint of the simulation's own steps: in about the time of a few simulations, however
    many samples there are. Covered are the linear model and `vertical_acceleration`,
    `surface_nonlinearity`, further modes and every effect that changes the modes' constants alone
    or what is measured, which does not count here.

    Args:
        model: the model.
        inputs: the motion of a container that stands upright.
        smoothing: s [m] of the smooth maximum s log Σ exp(MSH/s), which lies above the highest
            height, by at most s log N; 0: the highest height itself.
        max_step: longest sub-step [s].

    Raises:
        SloshModelError: an effect that is not covered, a container that tilts or turns, a
            smoothing that is negative, a solution that left the finite numbers.
    """
    check_covered(model)
    if len(inputs.poses):
        raise SloshModelError(
            "gradients are available for upright containers only: leave out attitude and "
            "angular velocity"
        )
    if not (math.isfinite(smoothing) and smoothing >= 0.0):
        raise SloshModelError(f"smoothing = {smoothing!r} m must not be negative")
    response = simulate(model, inputs, max_step=max_step)[0]
    msh = response.msh
    index = int(np.argmax(msh))
    height, shares = float(msh[index]), np.zeros(len(msh))
    shares[index] = 1.0
    if smoothing > 0.0:
        shares = np.exp((msh - height) / smoothing)
        height += smoothing * math.log(float(shares.sum()))
        shares /= shares.sum()
    gradient = pulled_back(model, inputs, shares[:, None] * _by_heights(response), max_step)
    return HeightGradient(height, index, gradient, response)


def pulled_back(
    model: Model, inputs: Inputs, weights: Array, max_step: float = MAXIMUM_STEP
) -> Array:
    """Returns the gradient (N, 3) of Σ weights · heights by acceleration [m per m/s²].

    Args:
        model: one that is covered; see `peak_gradient`.
        inputs: the motion of a container that stands upright, from rest.
        weights: (N, 2) of the wall heights at +x and +y [1].
        max_step: longest sub-step [s].
    """
    intervals = np.diff(inputs.t, prepend=inputs.t[0])
    store = store_of(model, max_step)
    steps = int(np.ceil(intervals[1:] / divided(store)[0][0]["max_step"]).sum())
    gradient = np.zeros((len(inputs.t), 3))
    alpha = model.acting[CURVED]["alpha"] if CURVED in model.acting else -1.0
    axes = divided(store)[0][0]["axes"]
    weights = _turned(weights, -axes)
    acceleration = _turned(inputs.acceleration, -axes)
    for array in (intervals, weights, acceleration):
        array.setflags(write=False)
    pull_back(
        store, intervals, acceleration, weights, float(VERTICAL in model.acting), alpha,
        np.empty((max(steps, 1), 4)), gradient,
    )  # fmt: skip
    return _turned(gradient, axes)


def _turned(vectors: Array, angle: float) -> Array:
    """Returns a copy of vectors (N, 2 or 3) rotated about z by an angle [rad]."""
    found = np.array(vectors, dtype=np.float64, order="C")
    if angle != 0.0:
        c, s = math.cos(angle), math.sin(angle)
        found[:, :2] = found[:, :2] @ np.array([[c, s], [-s, c]])
    return found


def check_covered(model: Model) -> None:
    """Raises SloshModelError if the model has an effect whose derivative is not implemented.

    >>> from slosh_model import Model
    >>> check_covered(Model.from_cup(diameter=0.08, fill_height=0.06))
    """
    if model.container.one_directional:
        raise SloshModelError("no gradients in a container whose outline has no axis of symmetry")
    for hook in ("drive", "modulation", "term"):
        for effect, _ in model.uses(hook):
            if effect.name not in COVERED and not effect.needs_rotation:
                raise SloshModelError(
                    f"no gradients with the effect {effect.name!r}: supported are "
                    f"{', '.join(COVERED)} and effects that change only the modes"
                )


def _by_heights(response: Response) -> Array:
    """Returns the derivative (N, 2) of the maximum height with respect to heights at +x and +y."""
    heights = np.column_stack([response.sh_x, response.sh_y])
    if response.container is not None and len(response.container.corners):
        corners = response.container.corners
        return np.asarray(corners[np.argmax(heights @ corners.T, axis=1)])
    if response.container is not None and response.container.cornered:
        return np.sign(heights)
    size = response.msh[:, None]
    return np.divide(heights, size, out=np.zeros_like(heights), where=size > 0.0)
