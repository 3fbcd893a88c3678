import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numba.types import int64, void

from slosh_base.compiled.compilation import CHANGED_1, CHANGED_2, entry_point
from slosh_base.compiled.normal_equations import factorize, substitute


@entry_point(void(CHANGED_2, int64, CHANGED_1))
def solve(matrix, size, right):
    factorize(matrix, size)
    substitute(matrix, size, right)


@given(st.integers(1, 9), st.integers(0, 2**32 - 1), st.floats(-6.0, 6.0))
def test_a_positive_definite_system_is_solved(size, seed, scale):
    random = np.random.default_rng(seed)
    root = random.normal(size=(size + 3, size)) * 10.0**scale
    matrix = root.T @ root
    wanted = random.normal(size=size)
    found = matrix @ wanted
    solve(matrix.copy(), size, found)
    assert np.max(np.abs(found - wanted)) < 1e-14 * np.linalg.cond(matrix) + 1e-12


def test_only_the_lower_triangle_of_the_system_is_read():
    right = np.array([8.0, 9.0, 7.0])
    solve(np.array([[4.0, np.nan, np.nan], [2.0, 5.0, np.nan], [np.nan] * 3]), 2, right)
    assert np.allclose(right, [22.0 / 16.0, 20.0 / 16.0, 7.0], atol=1e-15)


def test_what_is_not_positive_gives_nan():
    right = np.array([1.0, 1.0])
    solve(np.array([[1.0, 2.0], [2.0, 1.0]]), 2, right)
    assert np.isnan(right).all()
