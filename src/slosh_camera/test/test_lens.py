"""Models of a lens against OpenCV, and what a file or a driver calls them."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from slosh_camera.calibrate.intrinsics import read_known_camera
from slosh_camera.errors import SloshCameraError
from slosh_camera.intrinsics.solve import format_camera
from slosh_camera.optics.camera import PinholeCamera
from slosh_camera.optics.lens import COEFFICIENTS, lens_of, lens_parameters

RADIAL = st.floats(-0.3, 0.3)
SMALL = st.floats(-0.01, 0.01)
POLYNOMIAL = st.tuples(
    RADIAL, st.floats(-0.1, 0.1), SMALL, SMALL, st.floats(-0.05, 0.05), RADIAL,
    st.floats(-0.1, 0.1), st.floats(-0.05, 0.05), SMALL, SMALL, SMALL, SMALL,
)  # fmt: skip
FISHEYE = st.tuples(*(st.floats(-0.03, 0.03),) * 4)
MODELS = st.one_of(
    st.tuples(st.just("rational_polynomial"), POLYNOMIAL.map(lambda given: given[:8])),
    st.tuples(st.just("thin_prism"), POLYNOMIAL),
    st.tuples(st.just("equidistant"), FISHEYE),
)
POINTS = np.array(
    [[0.05, -0.03, 0.4], [-0.1, 0.07, 0.5], [0.0, 0.0, 1.0], [0.1, 0.1, 0.6], [-0.2, 0.1, 0.3]]
)


def camera_with(model, lens):
    return PinholeCamera(640, 480, 500.0, 505.0, 322.0, 238.0, tuple(lens), model)


def by_opencv(camera, points):
    lens, still = np.array(camera.distortion), np.zeros(3)
    if camera.distortion_model == "equidistant":
        pixels, _ = cv2.fisheye.projectPoints(
            points.reshape(1, -1, 3), still, still, camera.matrix, lens
        )
    else:
        pixels, _ = cv2.projectPoints(points, still, still, camera.matrix, lens)
    return pixels.reshape(-1, 2)


@given(MODELS)
def test_projection_is_that_of_opencv(lens):
    camera = camera_with(*lens)
    found = camera.project(POINTS)
    known = np.all(np.isfinite(found), axis=1)
    assert known[:4].all()
    assert_allclose(found[known], by_opencv(camera, POINTS)[known], atol=1e-7)


@given(MODELS, st.floats(0.0, 639.0), st.floats(0.0, 479.0))
def test_a_ray_leads_back_to_its_pixel(lens, u, v):
    camera = camera_with(*lens)
    ray = camera.rays([[u, v]])
    if np.all(np.isfinite(ray)):
        assert_allclose(camera.project(3.0 * ray), [[u, v]], atol=1e-5)


@given(MODELS)
def test_the_jacobian_is_the_derivative(lens):
    distort = lens_of(*lens).distort
    places = np.array([[0.1, -0.2], [0.3, 0.25], [-0.4, 0.02]])
    _, jacobian = distort(places)
    step = 1e-6
    for axis in range(2):
        shift = step * np.eye(2)[axis]
        slope = (distort(places + shift)[0] - distort(places - shift)[0]) / (2.0 * step)
        assert_allclose(jacobian[:, :, axis], slope, atol=1e-7)


def test_a_fisheye_lens_sees_almost_half_the_space():
    """An ideal one: the distance from the centre is the angle."""
    camera = camera_with("equidistant", (0.0,) * 4)
    angle = np.deg2rad(80.0)
    (pixel,) = camera.project([[np.sin(angle), 0.0, np.cos(angle)]])
    assert pixel[0] - 322.0 == pytest.approx(500.0 * angle)
    (ray,) = camera.rays([pixel])
    assert ray[0] == pytest.approx(np.tan(angle))
    assert np.isnan(camera.rays([[322.0 + 500.0 * 1.6, 238.0]])).all()


@pytest.mark.parametrize(
    ("named", "given", "expected"),
    [
        ("rational_polynomial", [0.1] * 5 + [0.0] * 3, "plumb_bob"),
        ("rational_polynomial", [0.1] * 8 + [0.0] * 6, "rational_polynomial"),
        ("rational_polynomial", [0.1] * 12, "thin_prism"),
        ("thin_prism", [0.1] * 12, "thin_prism"),
        ("fisheye", [0.1] * 4, "equidistant"),
        ("Kannala_Brandt4", [0.1] * 4, "equidistant"),
        ("radtan", [0.1] * 4, "plumb_bob"),
        ("none", [0.0] * 5, "plumb_bob"),
        ("", [], "plumb_bob"),
        ("equidistant", [], "equidistant"),
    ],
)
def test_names_of_drivers_and_programs(named, given, expected):
    model, lens = lens_parameters(named, given)
    assert model == expected
    assert len(lens) == COEFFICIENTS[expected]
    assert_allclose(lens[: len(given)], given[: len(lens)])


@pytest.mark.parametrize("model", COEFFICIENTS)
def test_a_file_of_each_lens_is_read_back(model, tmp_path):
    lens = np.linspace(0.01, 0.02, COEFFICIENTS[model])
    camera = camera_with(model, lens)
    path = tmp_path / "ost.yaml"
    path.write_text(format_camera(camera, "wide"))
    assert read_known_camera(path).camera == camera


FISHEYE_FILE = """
image_width: 640
image_height: 480
camera_name: wide
camera_matrix: {rows: 3, cols: 3, data: [300, 0, 320, 0, 300, 240, 0, 0, 1]}
%s
distortion_coefficients: {rows: 1, cols: 4, data: [0.05, -0.02, 0.01, -0.003]}
"""


@pytest.mark.parametrize("line", ["camera_model: fisheye", "distortion_model: fisheye"])
def test_a_fisheye_file_is_not_taken_for_plumb_bob(line, tmp_path):
    path = tmp_path / "ost.yaml"
    path.write_text(FISHEYE_FILE % line)
    camera = read_known_camera(path).camera
    assert camera.distortion_model == "equidistant"
    assert camera.distortion == (0.05, -0.02, 0.01, -0.003)


def test_two_names_that_contradict_are_refused(tmp_path):
    path = tmp_path / "ost.yaml"
    path.write_text(FISHEYE_FILE % "camera_model: fisheye\ndistortion_model: plumb_bob")
    with pytest.raises(SloshCameraError, match=r"camera_model.*contradicts.*equidistant"):
        read_known_camera(path)
