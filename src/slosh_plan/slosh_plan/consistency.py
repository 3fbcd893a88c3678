"""Checks that positions, velocities and accelerations describe the same motion.

The second difference of the position over steps of `W`, (p(t + 2W) - 2 p(t + W) + p(t)) / W², is
the mean of the acceleration over these 2 W, weighted with a triangle. It holds exactly, whatever
the velocity, and nothing drifts as an integral over the whole motion would. A first difference is
the plain mean over W.
"""

from __future__ import annotations

import numpy as np

from slosh_base.types import Array
from slosh_model.interpolation import columns_at
from slosh_plan.errors import SloshPlanError
from slosh_plan.tuning import TUNING

NOISE = {"positions": 2.5e-4, "velocities": 2.5e-3}
"""and what the lower field itself may be wrong by [m, m/s]."""
_UNITS = {"velocities": "m/s", "accelerations": "m/s²"}
_ORDERS = {("positions", "velocities"): 1, ("positions", "accelerations"): 2,
           ("velocities", "accelerations"): 1}  # fmt: skip


def check_consistent(
    name: str,
    t: Array,
    positions: Array | None = None,
    velocities: Array | None = None,
    accelerations: Array | None = None,
) -> None:
    """Raises an error if a motion's positions, velocities and accelerations contradict each other.

    Velocities that are all zero count as not given: they are often filled in, and not used.

    Args:
        name: of the motion, for the error.
        t: (N,) rising [s].
        positions, velocities, accelerations: (N, 3) in the world's axes [m, m/s, m/s²]; None: not
            given.

    Raises:
        SloshPlanError: two of them contradict each other; where, by how much, and the remedy.
    """
    if velocities is not None and not velocities.any():
        velocities = None
    fields = {"positions": positions, "velocities": velocities, "accelerations": accelerations}
    for (lower, upper), order in _ORDERS.items():
        below, above = fields[lower], fields[upper]
        if below is not None and above is not None:
            _check_pair(name, t, (lower, below), (upper, above), order)


def _check_pair(
    name: str, t: Array, lower: tuple[str, Array], upper: tuple[str, Array], order: int
) -> None:
    step = max(TUNING.window, TUNING.window_samples * float(np.median(np.diff(t))))
    step = min(step, float(t[-1] - t[0]) / (order + 1))
    told = _differences(t, lower[1], order, step)
    meant = _differences(t, _integrated(t, upper[1], order), order, step)
    apart = np.linalg.norm(told - meant, axis=1)
    greatest = max(np.linalg.norm(side, axis=1).max() for side in (told, meant))
    row = int(np.argmax(apart))
    if apart[row] <= TUNING.share * greatest + 2.0**order * NOISE[lower[0]] / step**order:
        return
    axis = int(np.argmax(np.abs(told[row] - meant[row])))
    unit = _UNITS[upper[0]]
    raise SloshPlanError(
        f"{name}: {lower[0]} and {upper[0]} contradict each other: from t = {t[row]:.4g} s to "
        f"{t[row] + order * step:.4g} s the {lower[0]} give a mean of {told[row, axis]:.3g} "
        f"{unit} in {'xyz'[axis]}, the {upper[0]} {meant[row, axis]:.3g} {unit}; correct the "
        f"{upper[0]}, or leave one of the two out"
    )


def _differences(t: Array, values: Array, order: int, step: float) -> Array:
    """Returns first or second differences (M, 3) of vectors (N, 3) that are a fixed time apart."""
    begin = t[: max(int(np.searchsorted(t, t[-1] - order * step, side="right")), 1)]
    at = [columns_at(begin + k * step, t, values) for k in range(order + 1)]
    change = at[1] - at[0] if order == 1 else at[2] - 2.0 * at[1] + at[0]
    return np.asarray(change / step**order)


def _integrated(t: Array, values: Array, order: int) -> Array:
    """Integrates a piecewise linear function of time once or twice, starting from 0."""
    dt = np.diff(t)[:, np.newaxis]
    first, last = values[:-1], values[1:]
    once = np.zeros_like(values)
    once[1:] = np.cumsum(0.5 * dt * (first + last), axis=0)
    if order == 1:
        return once
    twice = np.zeros_like(values)
    twice[1:] = np.cumsum(dt * once[:-1] + dt**2 * (2.0 * first + last) / 6.0, axis=0)
    return twice
