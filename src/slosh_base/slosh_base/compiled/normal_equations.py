"""Solves small symmetric positive definite systems in compiled code.

The operations and their order stand here, so that the answers are the same bits on every
processor; a linear algebra library chooses its code, and with it the rounding, by the processor.
"""

from __future__ import annotations

import math

from slosh_base.compiled.compilation import compiled


@compiled
def factorize(matrix, size):  # type: ignore[no-untyped-def]
    """Computes the Cholesky factor L of A = L Lᵀ in place; NaN if A is not positive definite.

    Args:
        matrix: at least (size, size); of A only the lower triangle is read.
        size: rows of A.
    """
    for i in range(size):
        for j in range(i + 1):
            rest = matrix[i, j]
            for k in range(j):
                rest -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = math.sqrt(rest) if i == j else rest / matrix[j, j]


@compiled
def substitute(factor, size, right):  # type: ignore[no-untyped-def]
    """Solves L Lᵀ x = b in place, given the Cholesky factor L.

    Args:
        factor: what `factorize` left.
        size: rows of the system.
        right: (size,) b; receives x.
    """
    for i in range(size):
        rest = right[i]
        for k in range(i):
            rest -= factor[i, k] * right[k]
        right[i] = rest / factor[i, i]
    for back in range(size):
        i = size - 1 - back
        rest = right[i]
        for k in range(i + 1, size):
            rest -= factor[k, i] * right[k]
        right[i] = rest / factor[i, i]
