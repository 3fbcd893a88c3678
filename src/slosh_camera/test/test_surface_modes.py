import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import jv

from slosh_camera.cylinder import silhouette
from slosh_camera.cylinder.surface import (
    RADIAL_STEPS,
    RADIAL_TABLE,
    SHAPES,
    Shape,
    shapes_at,
)

# Zeros of J0', J1' (two) and J2', as tables have them.
XI_01, XI_11, XI_12, XI_21 = 3.8317059702, 1.8411837813, 5.3314427735, 3.0542369282
ABS = 1e-9
BESSEL = {
    Shape.FIRST_X: (1, XI_11, np.cos),
    Shape.FIRST_Y: (1, XI_11, np.sin),
    Shape.SECOND_X: (1, XI_12, np.cos),
    Shape.SECOND_Y: (1, XI_12, np.sin),
    Shape.MEAN: (0, XI_01, np.cos),
    Shape.DOUBLE_X: (2, XI_21, np.cos),
    Shape.DOUBLE_Y: (2, XI_21, np.sin),
}
WAVES = sorted(BESSEL)


@pytest.mark.parametrize("shape", WAVES, ids=lambda shape: shape.name)
def test_shapes_are_bessel_functions(shape):
    order, root, wave = BESSEL[shape]
    rho, angle = (
        part.ravel() for part in np.meshgrid(np.linspace(0, 1, 41), np.arange(0, 7, 0.5))
    )
    expected = jv(order, root * rho) / jv(order, root) * wave(order * angle)
    found = shapes_at(rho * np.cos(angle), rho * np.sin(angle))[:, shape]
    np.testing.assert_allclose(found, expected, atol=ABS)


@pytest.mark.parametrize("shape", WAVES, ids=lambda shape: shape.name)
def test_no_liquid_flows_through_the_wall(shape):
    # The potential has the surface's shape: no flow through the wall is no slope towards it.
    angle = np.linspace(0.0, 2.0 * np.pi, 25)
    step = 1e-5
    outside, inside = (
        shapes_at(rho * np.cos(angle), rho * np.sin(angle))[:, shape]
        for rho in (1.0 + step, 1.0 - step)
    )
    assert np.max(np.abs(outside - inside) / (2.0 * step)) < 1e-6


def test_the_table_is_as_exact_as_it_says():
    # Of the heights, on the line where each is highest; between the table's places and at them.
    rho = np.sqrt(np.linspace(0.0, 1.0, 20001))
    place = rho**2 * RADIAL_STEPS
    k = np.minimum(place.astype(int), len(RADIAL_TABLE) - 2)
    part = (place - k)[:, np.newaxis]
    table = (1.0 - part) * RADIAL_TABLE[k] + part * RADIAL_TABLE[k + 1]
    exact = shapes_at(rho, 0.0 * rho)
    for column, (shape, power) in enumerate(
        ((Shape.FIRST_X, 1), (Shape.SECOND_X, 1), (Shape.MEAN, 0), (Shape.DOUBLE_X, 2))
    ):
        assert np.max(np.abs(rho**power * table[:, column] - exact[:, shape])) < 2e-5


@settings(deadline=None, derandomize=True)
@given(st.floats(0.0, 1.0), st.floats(-np.pi, np.pi))
def test_compiled_shapes_are_the_same_over_the_disc(rho, angle):
    x, y = rho * np.cos(angle), rho * np.sin(angle)
    compiled = silhouette.shapes_of(np.array([[x, y, 0.123]]))
    assert compiled.shape == (1, SHAPES)
    np.testing.assert_allclose(compiled, shapes_at(x, y), atol=2e-5)
