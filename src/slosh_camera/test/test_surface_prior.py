"""Tests the expected shape of the surface, which follows from the first mode's physics."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slosh_camera.cylinder.surface import SHAPES, Prior, Shape

RADIUS = 0.05
REST = Prior(np.zeros(SHAPES), first=0.01)
FIRST, DOUBLE = [Shape.FIRST_X, Shape.FIRST_Y], [Shape.DOUBLE_X, Shape.DOUBLE_Y]
azimuths = st.floats(-np.pi, np.pi)
sizes = st.floats(1e-3, 0.04)


def wave(size, azimuth, double=(0.0, 0.0)):
    """Returns mode amplitudes [m] of a first mode with its crest at an azimuth."""
    heights = np.zeros(SHAPES)
    heights[FIRST] = size * np.cos(azimuth), size * np.sin(azimuth)
    heights[DOUBLE] = double
    return heights


def at_double_azimuth(size, azimuth):
    """Returns the amplitudes of the mode cos 2(θ - φ) with a crest at azimuth φ."""
    return size * np.cos(2.0 * azimuth), size * np.sin(2.0 * azimuth)


@given(sizes, azimuths)
def test_a_crest_is_expected_to_be_sharper_than_a_trough(size, azimuth):
    """The second-order term raises both the crest and the trough of a wave."""
    centre, _ = REST.conditional(wave(size, azimuth), RADIUS)
    expected = 0.15 * size**2 / RADIUS
    np.testing.assert_allclose(centre[DOUBLE], at_double_azimuth(expected, azimuth), atol=1e-12)
    sharper = REST.surprise(wave(size, azimuth, at_double_azimuth(expected, azimuth)), RADIUS)
    blunter = REST.surprise(wave(size, azimuth, at_double_azimuth(-expected, azimuth)), RADIUS)
    assert sharper < blunter


@given(sizes, azimuths)
def test_less_is_known_along_the_wave_than_across_it(size, azimuth):
    """The sharpness along the wave is less certain than its symmetry across the wave."""
    centre, _ = REST.conditional(wave(size, azimuth), RADIUS)
    more = np.array(at_double_azimuth(1e-3, azimuth))
    askew = np.array(at_double_azimuth(1e-3, azimuth + np.pi / 4))
    along = REST.surprise(wave(size, azimuth, centre[DOUBLE] + more), RADIUS)
    across = REST.surprise(wave(size, azimuth, centre[DOUBLE] + askew), RADIUS)
    assert along < across


def test_what_is_expected_surprises_by_its_first_mode_alone():
    centre, precision = REST.conditional(wave(0.02, 0.3), RADIUS)
    centre[FIRST] = 0.02 * np.cos(0.3), 0.02 * np.sin(0.3)
    first = 0.02 * (0.02 / REST.first) ** 2
    assert REST.surprise(centre, RADIUS) == pytest.approx(first)
    assert np.all(np.linalg.eigvalsh(precision) > 0.0)
