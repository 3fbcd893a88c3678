"""Computes the force that accelerates the liquid from the container's modal masses.

A container that a sensor carries is pushed with P = M f + Σ mₙ ẍₙ, f the specific force less its
rest, M the mass of container and liquid, mₙ and xₙ mass and displacement of a mode relative to the
container (Ibrahim 2005, ch. 5; Dodge 2000, ch. 3). In free oscillation the mass gives back
-mₙ ẍₙ = mₙ (ωₙ² xₙ + 2 ζ ωₙ ẋₙ).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from slosh_base.types import Array
from slosh_discovery.identify.parameters import fitted_model
from slosh_model.containers import X_AXIS, Y_AXIS
from slosh_model.errors import SloshModelError
from slosh_model.model import Model
from slosh_model.parameters import DAMPING, FREQUENCY
from slosh_model.response import Response
from slosh_model.simulate import Inputs, simulate

SPRING = "surface_nonlinearity"
"""High waves in a round container are not those of a linear spring; low ones do not feel it."""
STIFFNESS = f"{SPRING}.alpha"


def liquid_model(model: Model) -> Model:
    """Returns the model with a second mode and, where the container has it, a stiffness term."""
    model = replace(model, modes=min(max(model.modes, 2), model.container.most_modes))
    if model.container.follows_yaw or model.has(SPRING):
        return model
    try:
        return model.with_effect(SPRING)
    except SloshModelError:
        return model


def modal_force(model: Model, inputs: Inputs, values: dict[str, float]) -> Array | None:
    """Returns the modes' acceleration Σ (mₙ/m₁) ẍₙ (N, 3) [m/s²]; None for impossible values.

    Args:
        model: the model.
        inputs: the motion, on an even grid.
        values: of `natural_frequency` [rad/s], `damping_ratio`, and of effects' parameters.
    """
    changed = fitted_model(model, values)
    if changed is None:
        return None
    try:
        response, _ = simulate(changed, inputs)
    except SloshModelError:
        return None
    return response_force(model, inputs, response)


def response_force(model: Model, inputs: Inputs, response: Response) -> Array:
    """Returns the modes' acceleration Σ (mₙ/m₁) ẍₙ (N, 3) [m/s²] of a simulated response."""
    container, first = model.container, model.container.mass_ratio(1, X_AXIS)
    step = float(inputs.t[1] - inputs.t[0])
    speed = np.zeros((len(inputs.t), 2))
    for n in range(response.modal.shape[1]):
        shares = [container.mass_ratio(n + 1, axis) / first for axis in (X_AXIS, Y_AXIS)]
        speed += response.modal[:, n, 2:4] * shares
    force = np.asarray(np.gradient(speed, step, axis=0), dtype=np.float64)
    azimuth = model.modal_azimuth(inputs.yaws)
    if azimuth.any():
        force = turned(force, azimuth)
    return np.column_stack([force, np.zeros(len(force))])


def turned(vectors: Array, angle: Array) -> Array:
    """Returns the vectors (N, 2) rotated by angles (N,) [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    x, y = vectors.T
    return np.column_stack([c * x - s * y, s * x + c * y])


def start_values(model: Model) -> dict[str, float]:
    """Returns the model's natural frequency [rad/s] and damping ratio as initial values."""
    damping = model.mode_constants()[0].damping_ratio
    return {FREQUENCY: model.mode_frequency(1), DAMPING: damping}
