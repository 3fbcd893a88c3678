"""The mesh of the surface: heights at the wall, triangles over the whole cross-section."""

import math

import numpy as np
import pytest

from slosh_bringup.surface_mesh import AROUND, surface_mesh
from slosh_model.containers import Container
from slosh_model.shapes.round_cups import Frustum
from slosh_testing.mode_solver import needs_solver

CUP, BOX = Container.of(radius=0.05, fill_height=0.07), Container.of(
    width=0.08, depth=0.04, fill_height=0.06
)  # fmt: skip
FRUSTUM = Frustum(bottom_radius=0.03, top_radius=0.05, height=0.1, fill_height=0.06)
SHAPES = {"cylinder": CUP, "rectangle": BOX, "frustum": FRUSTUM}


def area(mesh):
    a, b, c = (mesh.points[mesh.triangles[:, k]] for k in range(3))
    (ux, uy), (vx, vy) = (b - a).T, (c - a).T
    return 0.5 * (ux * vy - uy * vx)


@pytest.mark.parametrize(
    "name",
    [pytest.param(one, marks=needs_solver) if one == "frustum" else one for one in SHAPES],
)
def test_the_triangles_cover_the_cross_section_once(name):
    container = SHAPES[name]
    mesh = surface_mesh(container)
    x, y = container.reaches
    whole = 4.0 * x * y if container.cornered else math.pi * x * y
    areas = area(mesh)
    assert np.all(areas > 0.0)  # counter-clockwise, so that the light comes from above
    assert areas.sum() == pytest.approx(whole, rel=0.06)


def test_in_a_cup_the_wall_has_the_waves_height_by_azimuth():
    mesh = surface_mesh(CUP)
    heights = mesh.heights(0.003, -0.004)
    azimuth = np.arctan2(*mesh.wall.T[::-1])
    expected = 0.003 * np.cos(azimuth) - 0.004 * np.sin(azimuth)
    np.testing.assert_allclose(heights[-AROUND:], expected, atol=1e-12)
    assert heights[0] == 0.0
    # The crest of 5 mm, to half a step of the vertices.
    assert heights.max() == pytest.approx(0.005, rel=1.0 - math.cos(math.pi / AROUND))
    np.testing.assert_allclose(mesh.on_wall(-0.9273), [0.03, -0.04], atol=3e-4)


def test_in_a_box_the_corner_is_the_highest_place():
    mesh = surface_mesh(BOX)
    np.testing.assert_allclose(np.abs(mesh.wall).max(axis=0), BOX.reaches, rtol=1e-3)
    heights = mesh.heights(0.003, 0.001)
    x, y = mesh.points[heights.argmax()]
    assert (x, y) == pytest.approx(BOX.reaches, rel=0.2)
    assert heights.max() == pytest.approx(BOX.msh(0.003, 0.001), rel=0.08)
    np.testing.assert_allclose(heights, -mesh.heights(-0.003, -0.001))


def test_a_wave_along_x_alone_leaves_the_other_axis_still():
    for container in (CUP, BOX):
        mesh = surface_mesh(container)
        across = np.abs(mesh.points[:, 0]) < 1e-9
        assert np.all(mesh.heights(0.01, 0.0)[across] == 0.0)
