import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.camera import PinholeCamera, Pose, camera_from_info, look_at
from slosh_camera.optics.cup import Cup, CupView, Wall

# Straight rays; test_lens.py has the wall that bends them.
CUP = Cup(0.05, 0.07, wall_thickness=0.002, rim_height=0.12, wall_refractive_index=1.0)
BARREL = (-0.25, 0.08, 0.001, -0.002, 0.01)


def make_camera(distortion=(0.0,) * 5):
    return PinholeCamera(640, 480, 900.0, 905.0, 322.0, 238.0, distortion)


def make_view(distortion=(0.0,) * 5, elevation=0.1, azimuth=-1.2, distance=0.45):
    centre = np.array(
        [distance * np.cos(azimuth), distance * np.sin(azimuth), distance * np.tan(elevation)]
    )
    return CupView(make_camera(distortion), look_at(centre, (0.0, 0.0, 0.0)), CUP)


coefficients = st.tuples(
    st.floats(-0.3, 0.3),
    st.floats(-0.1, 0.1),
    st.floats(-0.005, 0.005),
    st.floats(-0.005, 0.005),
    st.floats(-0.05, 0.05),
)


def test_points_behind_the_camera_have_no_pixel():
    assert np.all(np.isnan(make_camera().project([[0.0, 0.0, -0.5], [0.0, 0.0, 0.0]])))


def test_beyond_the_fold_of_the_distortion_there_is_no_pixel_and_no_ray():
    camera = make_camera((-0.5, 0.0, 0.0, 0.0, 0.0))
    assert np.all(np.isnan(camera.project([[2.0, 0.0, 1.0]])))
    assert np.all(np.isnan(camera.rays([[322.0 + 900.0, 238.0]])))


@given(
    st.floats(-np.pi, np.pi),
    st.floats(-0.06, 0.05),
    st.floats(-0.3, 0.6),
    st.floats(-np.pi, np.pi),
    st.sampled_from([(0.0,) * 5, BARREL]),
)
def test_wall_to_pixel_to_wall(azimuth, height, elevation, camera_azimuth, distortion):
    view = make_view(distortion, elevation, camera_azimuth)
    left, _ = view.tangent_azimuths()
    away = np.cos(azimuth - view.camera_azimuth)
    limit = np.cos(left - view.camera_azimuth)
    if abs(away - limit) < 0.05:
        return  # a grazing ray magnifies rounding
    wall = Wall.FRONT if away > limit else Wall.REAR
    found_azimuth, found_height = view.on_wall(view.project_wall(azimuth, height), wall)
    assert abs(np.angle(np.exp(1j * (found_azimuth[0] - azimuth)))) < 1e-5
    assert abs(found_height[0] - height) < 1e-6


def test_tangent_azimuths_of_a_level_camera():
    view = make_view(azimuth=-np.pi / 2.0, elevation=0.0, distance=0.45)
    half = np.arccos(0.05 / 0.45)
    left, right = view.tangent_azimuths()
    assert_allclose([left, right], [-np.pi / 2.0 - half, -np.pi / 2.0 + half])
    u = view.project_wall([left, right], 0.0)[:, 0]
    # The edges are the extreme columns of the whole circle.
    circle = view.project_wall(np.linspace(-np.pi, np.pi, 3601), 0.0)[:, 0]
    assert_allclose(u, [circle.min(), circle.max()], atol=1e-3)


@pytest.mark.parametrize(
    ("rotation", "translation", "word"),
    [
        (2.0 * np.eye(3), np.zeros(3), "orthonormal"),
        (np.diag([1.0, 1.0, -1.0]), np.zeros(3), "mirrors"),
        (np.full((3, 3), np.nan), np.zeros(3), "finite"),
        (np.eye(3), np.array([0.0, np.inf, 1.0]), "finite"),
        (np.eye(2), np.zeros(3), "shape"),
    ],
)
def test_poses_that_are_none_are_refused(rotation, translation, word):
    with pytest.raises(SloshCameraError, match=word):
        Pose(rotation, translation)


@pytest.mark.parametrize(
    ("centre", "target", "word"),
    [
        ((0.0, -0.03, 0.0), (0.0, 0.0, 0.0), "inside"),
        ((0.0, -0.45, 0.0), (0.0, -0.9, 0.0), "in front"),
    ],
)
def test_views_that_cannot_see_the_wall_are_refused(centre, target, word):
    with pytest.raises(SloshCameraError, match=word):
        CupView(make_camera(), look_at(centre, target), CUP)


def test_camera_straight_above_has_no_upright_pose():
    with pytest.raises(SloshCameraError, match="axis"):
        look_at((0.0, 0.0, 1.0), (0.0, 0.0, 0.0))


K = [900.0, 0.0, 320.0, 0.0, 900.0, 240.0, 0.0, 0.0, 1.0]


@pytest.mark.parametrize(
    ("k", "d", "size", "model", "word"),
    [
        ([0.0] * 9, [], (640, 480), "plumb_bob", "not calibrated"),
        (K[:6], [], (640, 480), "plumb_bob", "needs 9"),
        (K, [0.1] * 3, (640, 480), "plumb_bob", "0, 4 or 5"),
        (K, [0.1] * 5, (640, 480), "equidistant", "equidistant has 0 or 4"),
        (K, [0.1] * 8, (640, 480), "plumb_bob", "with 8 the model is rational_polynomial"),
        (K, [0.1] * 4, (640, 480), "inverse_brown_conrady", "not supported, use one of plumb_bob"),
        (K, [0.1] * 14, (640, 480), "rational_polynomial", "tilted sensor"),
        (K, [0.1] * 4, (640, 480), "none", "has no coefficients, but 4 are given"),
        ([np.nan, *K[1:]], [], (640, 480), "plumb_bob", "finite"),
        ([-900.0, *K[1:]], [], (640, 480), "plumb_bob", "positive"),
        (K, [np.nan] * 5, (640, 480), "plumb_bob", "finite"),
        (K, [], (0, 480), "plumb_bob", "positive"),
        ([900.0, 3.0, *K[2:]], [], (640, 480), "plumb_bob", "camera_matrix"),
    ],
)
def test_camera_info_that_cannot_be_used(k, d, size, model, word):
    with pytest.raises(SloshCameraError, match=word) as caught:
        camera_from_info(k, d, *size, model)
    assert "\n" not in str(caught.value)


def test_an_image_of_another_camera_is_told_by_its_width_height_and_channels():
    camera = make_camera()
    camera.check(np.zeros((480, 640), np.uint8))
    camera.check(np.zeros((480, 640, 3), np.uint8))
    with pytest.raises(
        SloshCameraError, match="image: 641 x 480 x 3 of uint8, the calibration is"
    ):
        camera.check(np.zeros((480, 641, 3), np.uint8))
