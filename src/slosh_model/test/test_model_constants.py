"""Tests modes, gains, damping and surface shapes against closed forms and papers."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.special import jnp_zeros, jvp

from slosh_model.bessel import bessel_derivative_root, radial_shape
from slosh_model.constants import GRAVITY
from slosh_model.errors import SloshModelError
from slosh_model.liquid import Liquid
from slosh_model.model import Model
from slosh_model.modes import Mode
from slosh_model.shapes.cylinder import Cylinder

CUP = Cylinder(0.05, 0.07)
radii = st.floats(0.01, 1.0)
ratios = st.floats(0.2, 5.0)


def test_roots_are_those_of_the_bessel_functions_derivative():
    roots = [bessel_derivative_root(n) for n in range(1, 30)]
    assert roots[:3] == pytest.approx([1.841183781, 5.331442774, 8.536316366], abs=1e-9)
    assert roots == jnp_zeros(1, 29).tolist()
    assert np.max(np.abs(jvp(1, roots))) < 1e-12
    assert np.all(np.diff(roots) > 3.0)


def test_natural_frequency_of_the_papers_container():
    assert CUP.natural_frequency(1) == pytest.approx(18.897, abs=5e-4)


def test_frequency_and_damping_of_the_measured_container():
    cup = Cylinder(0.049, 0.078)
    assert cup.natural_frequency(1) / (2.0 * math.pi) == pytest.approx(3.046, abs=1e-3)
    assert cup.damping_ratio(Liquid().kinematic_viscosity) == pytest.approx(0.0052, abs=5e-5)


@given(radii, ratios)
def test_one_linear_mode_holds_the_static_slope_almost(radius, ratio):
    cup = Cylinder(radius, radius * ratio)
    mode = Mode(1, cup, 0.0)
    static_height = mode.plane_gain / mode.natural_frequency**2
    assert static_height * GRAVITY / radius == pytest.approx(0.987, abs=5e-4)


def test_a_measured_frequency_leaves_the_static_slope():
    by_geometry, measured = Model(CUP, modes=2), Model(CUP, modes=2, natural_frequency=17.0)
    heights = []
    for model in (by_geometry, measured):
        modes, gains = model.mode_constants(), model.height_gains()
        heights.append([g / m.natural_frequency**2 for m, g in zip(modes, gains, strict=True)])
    assert measured.mode_constants()[0].natural_frequency == pytest.approx(17.0, rel=1e-14)
    assert measured.mode_constants()[1].natural_frequency == pytest.approx(
        CUP.natural_frequency(2) * 17.0 / CUP.natural_frequency(1), rel=1e-14
    )
    assert heights[1] == pytest.approx(heights[0], rel=1e-13)


def test_an_effect_on_the_container_keeps_the_measured_ratio():
    filled = Model(CUP, natural_frequency=17.0).with_effect("fill_level", delta=0.02)
    expected = 17.0 * Cylinder(0.05, 0.09).natural_frequency(1) / CUP.natural_frequency(1)
    assert filled.mode_constants()[0].natural_frequency == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize(("gain", "tail"), [("plane_gain", 1e-6), ("curved_gain", 1.1e-3)])
def test_all_modes_together_hold_the_static_slope(gain, tail):
    modes = [Mode(n, CUP, 0.0) for n in range(1, 201)]
    height = sum(getattr(mode, gain) / mode.natural_frequency**2 for mode in modes)
    assert height * GRAVITY / CUP.radius == pytest.approx(1.0, abs=tail)


@pytest.mark.parametrize("n", [1, 2, 3])
def test_gains_keep_the_centre_of_gravity(n):
    """Tests that the surface and the sloshing mass have the same centre of gravity."""
    mode = Mode(n, CUP, 0.0)
    radius, height = CUP.radius, CUP.fill_height

    def offset(shape):
        integral, _ = quad(lambda r: r * r * shape(r / radius), 0.0, radius)
        return integral / (radius**2 * height)

    displaced = CUP.mass_ratio(n)
    assert mode.plane_gain * offset(lambda s: s) == pytest.approx(displaced)
    assert mode.curved_gain * offset(lambda s: float(radial_shape(n, s))) == pytest.approx(
        displaced
    )


@pytest.mark.parametrize(
    ("radius", "fill", "rim"),
    [(0.0, 0.07, None), (-1.0, 0.07, None), (math.nan, 0.07, None), (50.0, 70.0, None),
     (0.05, 0.07, 0.07), (0.05, 0.07, 0.01)],
)  # fmt: skip
def test_impossible_containers_are_refused(radius, fill, rim):
    with pytest.raises(SloshModelError):
        Cylinder(radius, fill, rim)


def test_names_and_twins():
    model = Model(CUP)
    assert model.name == "2D-L"
    assert model.spatial().name == "3D-L"
    assert model.spatial().nonlinear().name == "3D-NL"
    assert model.spatial().nonlinear().planar().name == "2D-NL"
    assert model.nonlinear().linear() == model
    kept = model.with_effect("surface_nonlinearity", alpha=0.3)
    assert kept.nonlinear() == kept


def test_unknown_effect_lists_the_known_ones():
    with pytest.raises(SloshModelError, match=r"'swirl'.*surface_nonlinearity, "):
        Model(CUP).with_effect("swirl")
