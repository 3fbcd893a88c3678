"""Tests surface shapes, wall profiles and the choice of the characteristic height."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import dblquad
from scipy.special import j1, jnp_zeros

from slosh_model.errors import SloshModelError
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.simulate import Inputs, simulate
from slosh_testing.surface import (
    bessel_surface,
    motion_axis,
    plane_surface,
    sloshing_height,
    surface_height,
    wall_profile,
)

CUP = Cylinder(0.05, 0.07)
MODAL = np.array([[0.004, -0.007, 0.0, 0.0], [0.001, 0.002, 0.0, 0.0]])


def centre_of_gravity(surface):
    """Returns the centre of gravity x_G, y_G of the liquid below a surface (DL22, eq. (17))."""
    volume = math.pi * CUP.radius**2 * CUP.fill_height

    def moment(part):
        def density(r, angle):
            return r * r * part(angle) * float(surface(r / CUP.radius, angle))

        return dblquad(density, 0.0, 2.0 * math.pi, 0.0, CUP.radius, epsabs=1e-13)[0]

    return [moment(math.cos) / volume, moment(math.sin) / volume]


@pytest.mark.parametrize("model", [Model(CUP, modes=2), Model(CUP, modes=2).nonlinear()])
def test_the_surface_has_the_sloshing_masses_centre_of_gravity(model):
    """Tests that the surface has the centre of gravity of the sloshing masses (DL22)."""
    found = centre_of_gravity(lambda r, angle: surface_height(model, MODAL, r, angle))
    masses = [CUP.mass_ratio(n) for n in (1, 2)]
    assert found == pytest.approx(masses @ MODAL[:, :2], rel=1e-6)


@pytest.mark.parametrize("model", [Model(CUP, modes=3), Model(CUP, modes=3).nonlinear()])
def test_at_the_wall_the_surface_has_the_simulated_heights(model):
    t = np.linspace(0.0, 1.0, 501)
    push = np.stack([2.0 * np.sin(15.0 * t), np.cos(9.0 * t), 0.0 * t], axis=1)
    response, _ = simulate(model, Inputs(t, push))
    azimuth = np.linspace(-math.pi, math.pi, 721)
    for row in (200, 500):
        wall = surface_height(model, response.modal[row], 1.0, azimuth)
        profile = wall_profile(response.sh_x[row], response.sh_y[row], azimuth)
        assert wall == pytest.approx(profile, abs=1e-12)
        assert wall.max() == pytest.approx(response.msh[row], rel=1e-5)
        assert azimuth[wall.argmax()] == pytest.approx(response.azimuth[row], abs=0.01)


def test_the_shapes_are_those_of_the_paper():
    heights, radius, azimuth = [[0.0, 0.01]], np.linspace(0.0, 1.0, 7), 0.6
    plane = plane_surface(heights, radius, azimuth)
    assert plane == pytest.approx(0.01 * radius * math.sin(0.6))
    xi = jnp_zeros(1, 2)
    expected = 0.01 * j1(xi[0] * radius) / j1(xi[0]) * math.sin(0.6)
    assert bessel_surface(heights, radius, azimuth) == pytest.approx(expected)
    second = 0.01 * j1(xi[1] * radius) / j1(xi[1]) * math.sin(0.6)
    assert bessel_surface(heights, radius, azimuth, numbers=[2]) == pytest.approx(second)


def test_wall_heights_of_another_shape_are_refused():
    with pytest.raises(SloshModelError, match=r"shape \(2,\), expected \(modes, 2\)"):
        plane_surface([0.01, 0.0], 0.5, 0.0)


def along(angle, size=2.0):
    t = np.linspace(0.0, 1.0, 401)
    push = size * np.sin(14.0 * t)
    return Inputs(t, np.stack([push * math.cos(angle), push * math.sin(angle), np.cos(t)], axis=1))


@settings(max_examples=40, deadline=None)
@given(st.floats(-math.pi, math.pi))
def test_a_straight_motion_has_a_signed_height_along_its_line(angle):
    inputs = along(angle)
    axis = motion_axis(inputs.acceleration)
    assert -math.pi / 2.0 < axis <= math.pi / 2.0
    assert abs(math.sin(axis - angle)) < 1e-6
    response, _ = simulate(Model(CUP).spatial().nonlinear(), inputs)
    kind, height = sloshing_height(response, inputs.acceleration)
    assert kind == "SH"
    assert np.abs(height) == pytest.approx(response.msh, abs=1e-8)
    reference, _ = simulate(Model(CUP).spatial().nonlinear(), along(0.0))
    assert height == pytest.approx(math.cos(axis - angle) * reference.sh_x, abs=1e-8)


def test_the_figures_two_branches():
    still = np.zeros((5, 3))
    assert motion_axis(still) == pytest.approx(math.pi / 2.0)  # no ẍ0: Table 1
    assert motion_axis(along(-math.pi / 2.0).acceleration) == pytest.approx(math.pi / 2.0)
    planar = along(0.3).acceleration + along(1.0, size=0.1).acceleration[::-1]
    assert motion_axis(planar) is None
    inputs = Inputs(np.linspace(0.0, 1.0, 401), planar)
    response, _ = simulate(Model(CUP), inputs)
    kind, height = sloshing_height(response, planar)
    assert kind == "MSH"
    assert np.array_equal(height, response.msh)
