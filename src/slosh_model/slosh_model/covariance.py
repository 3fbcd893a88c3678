"""Covariance of parameters identified from measurements."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from slosh_base.types import Array
from slosh_model.errors import SloshModelError

ROUNDING = 1e-9
"""A correlation may miss symmetry, and the smallest eigenvalue of all of them zero, by so much."""
KEY = "covariance"


@dataclass(frozen=True, slots=True)
class Covariance:
    """Covariance of identified parameters.

    Attributes:
        parameters: their names, as in model.yaml: `damping_ratio`, `natural_frequency`,
            `container.fill_height`, `EFFECT.PARAMETER`.
        matrix: covariance of their errors, in the product of the SI units of row and column.

    Raises:
        SloshModelError: a name twice, a matrix of another size, a number that is not finite, or
            none that a covariance can be: not symmetric, or with a negative variance somewhere.
    """

    parameters: tuple[str, ...]
    matrix: tuple[tuple[float, ...], ...]

    def __post_init__(self) -> None:
        count = len(self.parameters)
        for index, name in enumerate(self.parameters):
            if name in self.parameters[:index]:
                raise _refusal(f"names {name!r:.60} twice", "parameters")
        if len(self.matrix) != count or any(len(row) != count for row in self.matrix):
            raise _refusal(f"of {count} parameters needs a matrix of {count} by {count}", "matrix")
        if not all(math.isfinite(value) for row in self.matrix for value in row):
            raise _refusal("holds a number that is not finite", "matrix")
        self._check_definite()

    def _check_definite(self) -> None:
        variances = np.diag(self.array)
        if (variances < 0.0).any():
            raise _refusal("has a negative variance", "matrix")
        scale = np.sqrt(np.where(variances > 0.0, variances, 1.0))
        correlation = self.array / np.outer(scale, scale)
        if np.abs(correlation - correlation.T).max(initial=0.0) > ROUNDING:
            raise _refusal("is not symmetric", "matrix")
        if len(scale) and float(np.linalg.eigvalsh(correlation)[0]) < -ROUNDING * len(scale):
            raise _refusal("has a negative eigenvalue: such errors are not possible", "matrix")

    @property
    def array(self) -> Array:
        """The covariance as an array (P, P); a copy."""
        count = len(self.parameters)
        return np.array(self.matrix, dtype=np.float64).reshape(count, count)

    @property
    def standard_errors(self) -> Array:
        """Standard errors (P,): square roots of the variances."""
        errors: Array = np.sqrt(np.diag(self.array))
        return errors

    @property
    def principal_steps(self) -> Array:
        """Parameter changes (P, P) of one standard error along each principal axis, in columns."""
        scale = np.where(self.standard_errors > 0.0, self.standard_errors, 1.0)
        values, axes = np.linalg.eigh(self.array / np.outer(scale, scale))
        steps: Array = axes * np.sqrt(np.maximum(values, 0.0)) * scale[:, np.newaxis]
        return steps


def covariance_of(parameters: tuple[str, ...], matrix: Array) -> Covariance:
    """Creates a covariance from a computed matrix (P, P), which is made symmetric."""
    even = 0.5 * (matrix + matrix.T)
    return Covariance(parameters, tuple(tuple(row) for row in even.tolist()))


def _refusal(problem: str, key: str) -> SloshModelError:
    return SloshModelError(f"{KEY} {problem}", (KEY, key))
