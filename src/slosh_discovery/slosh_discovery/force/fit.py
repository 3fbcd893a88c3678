"""Fits a measured force by least squares: liquid, payload, sensor axes and sensor delay.

Of the parameters, frequency, damping, delay and the stiffness of high waves are searched; masses
and the sensor's zero follow linearly from them (variable projection, Golub and Pereyra 1973). The
sensor's axes come from the force itself (orthogonal Procrustes problem). The covariance is the
sandwich of an estimator whose residuals remember (Newey and West 1987).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from slosh_base.types import Array
from slosh_discovery.errors import SloshDiscoveryError
from slosh_discovery.force.liquid import SPRING, STIFFNESS, modal_force, start_values
from slosh_discovery.force.prepared import PreparedForce
from slosh_discovery.force.tuning import TUNING
from slosh_model.model import Model
from slosh_model.parameters import DAMPING, FREQUENCY, parameter_value

STEP = 1e-4
"""Step of the derivatives, in the parameters' own units."""


class Linear(NamedTuple):
    """Linear least-squares fit of masses and sensor offsets, for given nonlinear parameters.

    Attributes:
        basis: (n, k, 2 + k L) unweighted columns: M, m₁, then each direction's zero.
        values: (2 + k L,) of the columns.
        residual: (n, k) modelled less measured [N].
    """

    basis: Array
    values: Array
    residual: Array


@dataclass(frozen=True, slots=True, eq=False)
class ForceProblem:
    """Least-squares problem of the force fit as a function of its nonlinear parameters.

    Attributes:
        data: the record.
        model: of the liquid.
        start: values of natural frequency and damping ratio at the vector's origin.
        across: (3, k) directions of the motion, in the container's axes.
        sensor: (3, k) the same in the sensor's axes.
        weights: (n, k) one over the noise [1/N]; 0: not measured.
        stiffness: α's expected value; None: it is not searched.
    """

    data: PreparedForce
    model: Model
    start: dict[str, float]
    across: Array
    sensor: Array
    weights: Array
    stiffness: float | None

    @property
    def size(self) -> int:
        """Number of the nonlinear parameters."""
        return 3 if self.stiffness is None else 4

    def values(self, vector: Array) -> dict[str, float]:
        """Returns the model parameters of a vector of unknowns, by name."""
        found = {
            FREQUENCY: self.start[FREQUENCY] * math.exp(vector[0]),
            DAMPING: self.start[DAMPING] * math.exp(vector[1]),
        }
        if self.stiffness is not None:
            found[STIFFNESS] = max(float(vector[3]), 0.0)
        return found

    def liquid(self, vector: Array) -> Array:
        """Returns the acceleration (N, 3) [m/s²] of the modes below the cutoff frequency."""
        force = modal_force(self.model, self.data.inputs, self.values(vector))
        if force is None or not np.isfinite(force).all():
            return np.zeros_like(self.data.drive)
        return self.data.below_cutoff(force)

    def basis(self, liquid: Array, rigid: Array, delay: float) -> Array:
        """Returns the design matrix of the linear fit, by sample and direction of motion."""
        data, k = self.data, self.across.shape[1]
        parts = [data.at(values @ self.across, delay) for values in (rigid, liquid)]
        zeros = data.offsets.shape[1]
        basis = np.zeros((len(data.rows), k, 2 + k * zeros))
        for place, part in enumerate(parts):
            basis[:, :, place] = part
        for j in range(k):
            basis[:, j, 2 + j * zeros : 2 + (j + 1) * zeros] = data.offsets
        return basis

    def linear(self, basis: Array) -> Linear:
        """Fits masses and sensor offsets to the measured force, given the columns of `basis`."""
        measured = self.data.force @ self.sensor
        weighted = (basis * self.weights[:, :, None]).reshape(-1, basis.shape[2])
        wanted = (measured * self.weights).ravel()
        values = np.asarray(np.linalg.lstsq(weighted, wanted, rcond=None)[0], dtype=np.float64)
        return Linear(basis, values, basis @ values - measured)

    def solved(self, vector: Array, rigid: Array) -> Linear:
        """Solves the linear fit for given nonlinear parameters."""
        return self.linear(self.basis(self.liquid(vector), rigid, float(vector[2])))

    def residuals(self, vector: Array, rigid: Array) -> Array:
        """Returns the least-squares residuals: weighted force errors, and the prior error of α."""
        found = (self.solved(vector, rigid).residual * self.weights).ravel()
        if self.stiffness is None:
            return found
        return np.append(found, (vector[3] - self.stiffness) / self.alpha_width)

    @property
    def alpha_width(self) -> float:
        """Prior standard deviation of the stiffness parameter α, scaled to the force's noise."""
        return TUNING.alpha_width / math.sqrt(self.memory)

    @property
    def memory(self) -> float:
        """Number of successive samples over which the residual is correlated."""
        t, rows = self.data.inputs.t, self.data.rows
        step = float(t[rows[1]] - t[rows[0]])
        return max(1.0, TUNING.memory * 2.0 * math.pi / self.start[FREQUENCY] / step)


class Fit(NamedTuple):
    """A fit of liquid, payload and sensor to a measured force.

    Attributes:
        problem: with the sensor's axes and the noise as found.
        vector: of the searched parameters.
        linear: what follows from it.
        covariance: of frequency and damping (as logarithms), delay, α if any, M and m₁.
        noise: standard deviation of the residual at rest and in motion [N].
    """

    problem: ForceProblem
    vector: Array
    linear: Linear
    covariance: Array
    noise: tuple[float, float]


def fit_force(data: PreparedForce, model: Model) -> Fit:
    """Fits liquid, payload and sensor to a force record.

    Args:
        data: the record.
        model: from which to start.

    Raises:
        SloshDiscoveryError: no force follows the motion, or none of it is the liquid's.
    """
    rigid = data.below_cutoff(data.drive)
    across = directions(rigid)
    delay, sensor = _rigid(data, rigid, across)
    stiffness = parameter_value(model, STIFFNESS) if model.has(SPRING) else None
    weights = np.repeat(data.usable.astype(np.float64)[:, None], across.shape[1], axis=1)
    weights[data.moving] *= 0.1
    problem = ForceProblem(data, model, start_values(model), across, sensor, weights, stiffness)
    vector = _scanned(problem, rigid, delay)
    noise = (1.0, 1.0)
    for _ in range(TUNING.rounds):
        vector = _searched(problem, rigid, vector)
        linear = problem.solved(vector, rigid)
        problem = replace(problem, sensor=_axes(problem, rigid, vector, linear))
        linear = problem.solved(vector, rigid)
        noise = _noise(data, linear.residual)
        problem = replace(problem, weights=_weights(data, noise, across.shape[1]))
    vector = _searched(problem, rigid, vector)
    linear = problem.solved(vector, rigid)
    covariance = _covariance(problem, vector, rigid, linear)
    return Fit(problem, vector, linear, covariance, noise)


def directions(rigid: Array) -> Array:
    """Returns the principal directions of the motion, one per column, without negligible ones."""
    centred = rigid - np.median(rigid, axis=0)
    _, sizes, rows = np.linalg.svd(centred, full_matrices=False)
    kept = rows[sizes > TUNING.across * sizes[0]]
    # Each along the container's axis that it is nearest to.
    signs = np.sign(kept[np.arange(len(kept)), np.abs(kept).argmax(axis=1)])
    return np.asarray((kept * signs[:, None]).T)


class _Following(NamedTuple):
    """How a rigid body's force follows a motion: residual [N], delay [s], axes (k, 3)."""

    left: float
    delay: float
    axes: Array


def _following(data: PreparedForce, rigid: Array, across: Array) -> _Following:
    """Returns the best of all delays of the sensor."""
    span, step = TUNING.delay_span, TUNING.delay_step
    found = []
    for delay in np.arange(-span, span + 0.5 * step, step):
        columns = np.hstack([data.at(rigid @ across, float(delay)), data.offsets])[data.usable]
        solved, *_ = np.linalg.lstsq(columns, data.force[data.usable], rcond=None)
        left = float(np.linalg.norm(columns @ solved - data.force[data.usable]))
        axes = np.asarray(solved[: across.shape[1]], dtype=np.float64)
        found.append(_Following(left, float(delay), axes))
    return min(found, key=lambda one: one.left)


def _rigid(data: PreparedForce, rigid: Array, across: Array) -> tuple[float, Array]:
    """Fits the force sensor's delay [s] and axes (columns), as if the liquid were a rigid body."""
    span, step = TUNING.delay_span, TUNING.delay_step
    total = np.linalg.norm((data.force - np.median(data.force, axis=0))[data.usable])

    def unlike(one: _Following) -> bool:
        return bool(abs(one.delay) > span - 2.0 * step or one.left > TUNING.unlike * total)

    best = _following(data, rigid, across)
    if data.inputs.attitude is not None:
        fixed = data.below_cutoff(data.inputs.acceleration)
        other = _following(data, fixed, directions(fixed))
        if not unlike(other) and (unlike(best) or other.left < TUNING.fixed_axes * best.left):
            raise SloshDiscoveryError(
                "the force follows the motion in axes that do not turn with the container: it is "
                "given in the axes of the robot's base; record it in the sensor's own axes"
            )
    if unlike(best):
        raise SloshDiscoveryError(
            f"the force does not follow the motion at any delay up to {span:g} s: another motion, "
            "an unrelated clock or another sensor's topic"
        )
    return best.delay, _orthonormal(best.axes.T)


def _orthonormal(matrix: Array) -> Array:
    left, _, right = np.linalg.svd(matrix, full_matrices=False)
    return np.asarray(left @ right)


def _axes(problem: ForceProblem, rigid: Array, vector: Array, linear: Linear) -> Array:
    """Returns the sensor's axes, one per column, fitted with the forces of payload and liquid."""
    data, delay = problem.data, float(vector[2])
    pushed = linear.values[0] * rigid + linear.values[1] * problem.liquid(vector)
    columns = np.hstack([data.at(pushed @ problem.across, delay), data.offsets])
    weights = problem.weights.max(axis=1)[:, None]
    found, *_ = np.linalg.lstsq(columns * weights, data.force * weights, rcond=None)
    return _orthonormal(found[: problem.across.shape[1]].T)


def _scanned(problem: ForceProblem, rigid: Array, delay: float) -> Array:
    """Returns initial parameters whose natural frequency best explains the force at rest."""
    reach = math.log(TUNING.frequency_span)
    trials = np.linspace(-reach, reach, TUNING.frequency_trials)
    vectors = [np.array([trial, 0.0, delay, problem.stiffness or 0.0]) for trial in trials]
    left = [float(np.sum(problem.residuals(v[: problem.size], rigid) ** 2)) for v in vectors]
    return vectors[int(np.argmin(left))][: problem.size]


def _searched(problem: ForceProblem, rigid: Array, vector: Array) -> Array:
    reach, damping = math.log(TUNING.frequency_span), problem.start[DAMPING]
    span = TUNING.delay_span
    lower = [-reach, math.log(TUNING.least_damping / damping), -span, 0.0][: problem.size]
    upper = [reach, math.log(TUNING.most_damping / damping), span, 5.0][: problem.size]
    begin = np.clip(vector, np.add(lower, STEP), np.subtract(upper, STEP))
    scale = [0.01, 0.2, 0.005, TUNING.alpha_width][: problem.size]

    def derivative(at: Array, slow: Array) -> Array:
        return _derivative(problem, at, slow)

    found = least_squares(
        problem.residuals, begin, bounds=(lower, upper), x_scale=scale, args=(rigid,),
        jac=derivative, max_nfev=40, xtol=1e-7, ftol=1e-9,
    )  # fmt: skip
    return np.asarray(found.x, dtype=np.float64)


def _derivative(problem: ForceProblem, vector: Array, rigid: Array) -> Array:
    columns = []
    for place in range(problem.size):
        moved = [vector.copy(), vector.copy()]
        moved[0][place] += STEP
        moved[1][place] -= STEP
        ahead, behind = (problem.residuals(one, rigid) for one in moved)
        columns.append((ahead - behind) / (2.0 * STEP))
    return np.column_stack(columns)


def _noise(data: PreparedForce, residual: Array) -> tuple[float, float]:
    """Returns the rms residual at rest and in motion [N]."""
    rest, moving = data.usable & ~data.moving, data.usable & data.moving
    sizes = [
        float(np.sqrt(np.mean(residual[rows] ** 2))) if rows.any() else math.nan
        for rows in (rest, moving)
    ]
    known = [size for size in sizes if math.isfinite(size)]
    least = max(max(known), 1e-12)
    at_rest, in_motion = (size if size > 0.0 else least for size in sizes)
    return at_rest, in_motion


def _weights(data: PreparedForce, noise: tuple[float, float], count: int) -> Array:
    one = np.where(data.moving, 1.0 / noise[1], 1.0 / noise[0])
    return np.repeat(np.where(data.usable, one, 0.0)[:, None], count, axis=1)


def _covariance(problem: ForceProblem, vector: Array, rigid: Array, linear: Linear) -> Array:
    """Returns the covariance of the nonlinear parameters and the two masses; see `Fit`."""
    weights, searched = problem.weights, []
    for place in range(problem.size):
        moved = [vector.copy(), vector.copy()]
        moved[0][place] += STEP
        moved[1][place] -= STEP
        ahead, behind = (
            problem.basis(problem.liquid(one), rigid, float(one[2])) @ linear.values
            for one in moved
        )
        searched.append((ahead - behind) / (2.0 * STEP))
    jacobian = np.concatenate([np.stack(searched, axis=2), linear.basis], axis=2)
    jacobian = jacobian * weights[:, :, None]
    scores = np.einsum("nkp,nk->np", jacobian, linear.residual * weights)
    flat = jacobian.reshape(-1, jacobian.shape[2])
    bread = flat.T @ flat
    lags = min(math.ceil(problem.memory), len(scores) - 1)
    meat = scores.T @ scores
    for lag in range(1, lags + 1):
        part = scores[lag:].T @ scores[:-lag]
        meat += (1.0 - lag / (lags + 1.0)) * (part + part.T)
    if problem.stiffness is not None:
        bread[3, 3] += 1.0 / problem.alpha_width**2
        meat[3, 3] += TUNING.alpha_width**2 / problem.alpha_width**4
    inverse = np.linalg.pinv(bread, hermitian=True)
    wanted = problem.size + 2
    return np.asarray((inverse @ meat @ inverse)[:wanted, :wanted])
