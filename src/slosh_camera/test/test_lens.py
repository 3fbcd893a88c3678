"""Tests lens models against OpenCV, and the names of lens models in files and messages."""

import itertools
import json
import os
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.optimize import minimize

from slosh_camera.calibrate.board_views import format_camera
from slosh_camera.calibrate.intrinsics import read_known_camera
from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.camera import PinholeCamera, Pose, camera_from_info, look_at
from slosh_camera.optics.cup import Cup, CupView, Wall
from slosh_camera.optics.lens import COEFFICIENTS, lens_of, lens_parameters
from slosh_camera.optics.refraction import GlassWall

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
    """In an ideal fisheye image the distance from the centre is proportional to the angle."""
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


# The glass wall against Fermat's principle, the straight limit and the ray-traced sequences.


SEQUENCES = (
    Path(os.environ.get("SLOSH_SHARED_DATA", Path(__file__).parents[4] / "shared" / "data"))
    / "rendered"
)
NO_SEQUENCES = f"no rendered sequences in {SEQUENCES}: name their folder in SLOSH_SHARED_DATA"
CAMERA = PinholeCamera(640, 480, 1000.0, 1000.0, 319.5, 239.5)
FRONT = {-100.0, -60.0, -20.0, -8.0}
REAR = {20.0, 90.0, 140.0, 175.0}


def view(height=0.1, thickness=0.003, index=1.49):
    pose = look_at((0.0, -0.45, height), (0.0, 0.0, 0.0))
    return CupView(CAMERA, pose, Cup(0.05, 0.07, thickness, None, index))


def optical_length(places, target, origin, glass):
    """Returns the optical length of a path through given points of the outer and inner wall."""
    path = [origin, _on(glass.outer_radius, *places[:2])]
    if len(places) == 4:
        path.append(_on(glass.radius, *places[2:]))
    path.append(target)
    lengths = [np.linalg.norm(b - a) for a, b in itertools.pairwise(path)]
    return sum(n * length for n, length in zip((1.0, glass.index, 1.0), lengths, strict=False))


def _on(radius, angle, height):
    return np.array([radius * np.cos(angle), radius * np.sin(angle), height])


@pytest.mark.parametrize("azimuth", sorted(FRONT | REAR))
def test_light_takes_the_quickest_way(azimuth):
    # Through the front wall, or through the front wall and the air: a stationary optical length.
    glass = GlassWall(0.05, 0.003, 1.49)
    origin = np.array([0.0, -0.45, 0.1])
    target = _on(0.05, np.radians(azimuth), 0.02)
    rear = azimuth in REAR
    direction = glass.sight(origin, target[np.newaxis], np.array([rear]))
    facing = np.radians(-90.0) if rear else np.radians(azimuth)
    start = [facing, 0.04, facing, 0.04] if rear else [facing, 0.04]
    best = minimize(
        optical_length, start, (target, origin, glass), method="BFGS", options={"gtol": 1e-10}
    )
    seen = _on(glass.outer_radius, *best.x[:2]) - origin
    apparent = direction[0] / np.linalg.norm(direction[0])
    assert apparent == pytest.approx(seen / np.linalg.norm(seen), abs=2e-6)


@given(
    azimuth=st.floats(-np.pi, np.pi),
    height=st.floats(-0.06, 0.06),
    camera_height=st.floats(-0.1, 0.4),
    thickness=st.floats(0.0, 0.006),
    index=st.floats(1.0, 1.9),
    wall=st.sampled_from(Wall),
)
def test_a_projected_point_is_found_where_it_was(
    azimuth, height, camera_height, thickness, index, wall
):
    cup = view(camera_height, thickness, index)
    pixel = cup.project_wall(azimuth, height, wall)
    if np.isnan(pixel).any():
        return
    found_azimuth, found_height = cup.on_wall(pixel, wall)
    # Straight rays are projected whichever wall they meet first.
    if np.isnan(found_azimuth[0]) or not cup._glass.bends:
        return
    turn = found_azimuth[0] - azimuth
    assert np.arctan2(np.sin(turn), np.cos(turn)) == pytest.approx(0.0, abs=1e-6)
    assert found_height[0] == pytest.approx(height, abs=1e-8)


@pytest.mark.skipif(not SEQUENCES.is_dir(), reason=NO_SEQUENCES)
@pytest.mark.parametrize("name", ["A_planar", "A_rotating", "B_rotating", "D_rotating"])
def test_peaks_are_projected_where_the_ray_tracer_shows_them(name):
    truth = json.loads((SEQUENCES / name / "truth.json").read_text())
    camera = truth["camera"]
    cup = CupView(
        camera_from_info(np.ravel(camera["K"]), camera["dist"], camera["width"], camera["height"]),
        Pose(np.array(camera["R_cup2cam"]), np.array(camera["t_cup2cam"])),
        Cup(truth["R"], truth["h"], truth["wall_thickness"], None, truth["n_wall"]),
    )
    frames = [f for f in truth["frames"] if f["peak_px"] and not f["peak_out_of_frame"]]
    azimuth = np.radians([frame["peak_az"] for frame in frames])
    pixels = cup.project_wall(azimuth, [frame["MSH"] for frame in frames])
    assert pixels == pytest.approx(np.array([frame["peak_px"] for frame in frames]), abs=1e-5)
    # Without the wall they would be some pixels away.
    bare = CupView(cup.camera, cup.pose, Cup(truth["R"], truth["h"]))
    straight = np.array([frame["peak_px_norefraction"] for frame in frames])
    assert bare.project_wall(azimuth, [f["MSH"] for f in frames]) == pytest.approx(
        straight, abs=1e-5
    )
    assert np.max(np.abs(straight - pixels)) > 1.0


def test_over_the_rim_rays_go_straight_and_sight_finds_them_again():
    glass = GlassWall(0.05, 0.003, 1.49, rim=0.03)
    origin = np.array([0.0, -0.4, 0.3])
    points = np.array([[0.01, 0.0489898, -0.06], [0.01, 0.0489898, 0.02]])
    through, over = glass.sight(origin, points)
    straight = points - origin
    straight /= np.hypot(straight[:, 0], straight[:, 1])[:, np.newaxis]
    # The lower point is seen through the glass, the upper one past it.
    assert np.linalg.norm(through - straight[0]) > 1e-3
    assert over == pytest.approx(straight[1], abs=1e-12)
    trace = glass.trace(origin, np.vstack((through, over)))
    assert trace.rear == pytest.approx(points, abs=1e-7)
    assert trace.front[0, 2] < 0.03 < trace.front[1, 2]
