"""Tests intrinsic parameters from rendered images of boards with a known camera."""

import cv2
import numpy as np
import pytest

from slosh_camera.calibrate.board import Board, drawn_board
from slosh_camera.calibrate.board_views import Chessboard, fit_camera, parse_target
from slosh_camera.errors import SloshCameraError
from slosh_testing.board_scene import (
    CAMERA,
    LENS,
    MATRIX,
    POSES,
    chessboard_page,
    chessboard_pictures,
    pose,
    rays_of,
    render,
)

BOARD = Chessboard(8, 5, 0.02)
CHARUCO = Board(True, 8, 5, 0.02, 0.015)
GRID = Board(False, 5, 4, 0.03, 0.01)
TRUTH = dict(zip(("fx", "fy", "cx", "cy"), MATRIX[[0, 1, 0, 1], [0, 1, 2, 2]], strict=True))
needs_markers = pytest.mark.skipif(
    not hasattr(getattr(cv2, "aruco", None), "CharucoBoard"),
    reason=f"OpenCV {cv2.__version__} is built without aruco",
)


def named(pictures):
    return [(f"{number}.png", picture) for number, picture in enumerate(pictures)]


@pytest.fixture(scope="module")
def pictures():
    return chessboard_pictures()


@pytest.fixture(scope="module")
def fit(pictures):
    return fit_camera(named(pictures), BOARD)


def assert_within_claims(found):
    for name, truth in TRUTH.items():
        error = getattr(found.camera, name) - truth
        assert abs(error) < 3.0 * found.stddev[name], (name, error, found.stddev[name])
        assert found.stddev[name] < 6.0


def test_a_chessboard_gives_the_camera_within_what_is_claimed(fit):
    assert_within_claims(fit)
    assert fit.rms < 0.3
    # What the lens does to the directions matters, not each coefficient.
    u, v = np.meshgrid(np.linspace(80, 560, 7), np.linspace(60, 420, 7))
    pixels = np.column_stack((u.ravel(), v.ravel()))
    rays = fit.camera.rays(pixels)
    truth, _ = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), MATRIX, LENS)
    assert np.abs(truth.reshape(-1, 2) - pixels).max() < 6.0
    assert fit.camera.distortion[0] == pytest.approx(LENS[0], abs=0.05)


WIDE = {
    "rational_polynomial": CAMERA._replace(
        focal=(450.0, 449.0), lens=(0.35, -0.05, 0.001, -0.0008, 0.0, 0.55, 0.05, 0.0)
    ),
    "equidistant": CAMERA._replace(focal=(300.0, 299.0), lens=(-0.02, 0.01, -0.004, 0.001)),
}


@pytest.mark.long
@pytest.mark.parametrize(
    "model", [pytest.param("rational_polynomial", marks=pytest.mark.long), "equidistant"]
)
def test_pictures_of_a_wide_lens_give_the_camera(model):
    truth = WIDE[model]
    # Nearer, and farther aside: a wide lens shows itself at the edge of the image.
    poses = [(x, y, 1.8 * right, 1.8 * down, 0.6 * far) for x, y, right, down, far in POSES]
    pictures = chessboard_pictures(poses=poses, camera=truth)
    found = fit_camera(named(pictures), BOARD, model)
    assert found.camera.distortion_model == model
    assert found.rms < 0.3
    assert len(found.used) >= len(POSES) - 1
    pixels = np.array([[120.0, 100.0], [320.0, 90.0], [520.0, 380.0], [330.0, 236.0]])
    expected = rays_of(pixels, truth)
    turned = np.cross(found.camera.rays(pixels), expected)
    angle = np.linalg.norm(turned, axis=1) / np.sum(expected**2, axis=1)
    assert np.all(angle < 3.0 / truth.focal[0])  # three pixels


def test_too_small_an_error_is_not_claimed_of_pictures_that_tell_little(fit, pictures):
    few = fit_camera(named(pictures[:5]), BOARD)
    assert few.stddev["fx"] > 1.3 * fit.stddev["fx"]
    assert abs(few.camera.fx - TRUTH["fx"]) < 3.0 * few.stddev["fx"]


@pytest.mark.long
def test_pictures_that_tell_nothing_new_are_left_out_with_the_reason(pictures):
    images = [*pictures[:6], pictures[2], np.full_like(pictures[0], 120), bent()]
    found = fit_camera(named(images), BOARD)
    reasons = found.left_out
    assert reasons["6.png"] == "the same pose as 2.png"
    assert reasons["7.png"].startswith("the board is not found")
    assert "blurred, or the board bent" in reasons["8.png"]
    assert len(found.used) == 6
    assert_within_claims(found)


def bent():
    """Renders a board on a page that is not flat."""
    page = chessboard_page(8, 5, 0.02, 4000.0)
    rows, columns = np.indices(page.shape).astype(np.float32)
    page = cv2.remap(page, columns + 8 * np.sin(rows / 120), rows, cv2.INTER_LINEAR)
    return render(page, 4000.0, *pose((0.18, 0.12), 10, -15, 0.0, 0.0, 0.4), seed=99)


@pytest.mark.long
def test_pictures_without_tilt_are_refused():
    flat = [(0, 0, right, down, 0.5) for right in (-0.2, 0.2) for down in (-0.2, 0.2)]
    with pytest.raises(SloshCameraError, match=r"pictures: .*tilt") as caught:
        fit_camera(named(chessboard_pictures(poses=flat)), BOARD)
    assert "\n" not in str(caught.value)


def test_pictures_of_different_size_are_refused(pictures):
    small = cv2.resize(pictures[1], (320, 240))
    with pytest.raises(SloshCameraError, match=r"1\.png: 320 x 240 pixels, but 0\.png has 640 x"):
        fit_camera(named([pictures[0], small]), BOARD)


def test_too_few_pictures_are_refused(pictures):
    one = named([pictures[0], pictures[0]])
    with pytest.raises(SloshCameraError, match=r"pictures: 1 of 2 can be used, 4 are .*same"):
        fit_camera(one, BOARD)
    with pytest.raises(SloshCameraError, match="pictures: 0 of 0 can be used"):
        fit_camera([], BOARD)
    with pytest.raises(SloshCameraError, match=r"board is not found.*inner corners"):
        fit_camera(named(pictures[:1]), Chessboard(9, 6, 0.02))


@pytest.mark.long
@needs_markers
@pytest.mark.parametrize(
    ("board", "size"), [(CHARUCO, (0.16, 0.1)), (GRID, (0.19, 0.15))], ids=["charuco", "aruco"]
)
def test_a_board_of_markers_gives_the_camera(board, size):
    page = drawn_board(board.opencv()[0], round(4000 * size[0]), round(4000 * size[1]))
    images = [render(page, 4000.0, *pose(size, *where), seed=k) for k, where in enumerate(POSES)]
    assert_within_claims(fit_camera(named(images), board))


@pytest.mark.parametrize(
    ("text", "square", "match"),
    [
        ("9x6", None, "square: is needed"),
        ("9x6", -1.0, "square: is needed"),
        ("2x6", 0.02, "3 to 50 inner corners"),
        ("board", 0.02, "'board' is not COLSxROWS, .* or charuco:"),
        ("charuco:7x5:0.02:0.015", 0.02, "square: a marker board's"),
        ("charuco:7x5:0.02", None, "is not charuco:COLS"),
    ],
)
def test_bad_boards(text, square, match):
    with pytest.raises(SloshCameraError, match=match):
        parse_target(text, square)
