"""Tests board detection with boards that an independent homography draws into images."""

import dataclasses

import cv2
import numpy as np
import pytest

from slosh_camera.calibrate.board import (
    Board,
    check_hint,
    find_board,
    hint_of_flat_board,
    parse_board,
    pose_by_board,
)
from slosh_camera.calibrate.curves import Curve
from slosh_camera.calibrate.edges import edge_image
from slosh_camera.calibrate.outline import find_outline
from slosh_camera.calibrate.pose import CameraPlace, place_of, pose_of
from slosh_camera.calibrate.still import calibrate_by_edges
from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.camera import PinholeCamera, Pose
from slosh_camera.optics.cup import Cup, Wall

pytestmark = pytest.mark.skipif(
    not hasattr(getattr(cv2, "aruco", None), "CharucoBoard"),
    reason=f"OpenCV {cv2.__version__} is built without aruco",
)

CHARUCO = Board(True, 5, 4, 0.02, 0.015)
GRID = Board(False, 3, 2, 0.03, 0.006)
CAMERA = PinholeCamera(1280, 960, 1500.0, 1500.0, 639.5, 479.5)
CUP = Cup(0.05, 0.07)
PLACE = CameraPlace(0.5, 0.25, 0.0, 0.45, 0.02)
# Face up: the board's z, into the page, is down; its x lies along the container's x.
FACE_UP = np.diag([1.0, -1.0, -1.0])


def sheet(board, pixels_per_metre=8000):
    """Returns the printed page of a board without margin, and its width and height [m]."""
    if board.charuco:
        width, height = board.columns * board.size, board.rows * board.size
    else:
        width = board.columns * (board.size + board.inner) - board.inner
        height = board.rows * (board.size + board.inner) - board.inner
    size = round(width * pixels_per_metre), round(height * pixels_per_metre)
    known, _ = board.opencv()
    draw = known.generateImage if hasattr(known, "generateImage") else known.draw
    return draw(size, marginSize=0), (width, height)


def put(image, board, pose, camera=CAMERA):
    """Draws a board with a white margin into an image, at a pose (board -> camera)."""
    page, (width, height) = sheet(board)
    rim = 60
    page = cv2.copyMakeBorder(page, rim, rim, rim, rim, cv2.BORDER_CONSTANT, value=255)
    ends = np.array([[0, 0, 0], [width, 0, 0], [width, height, 0], [0, height, 0]], float)
    turn, _ = cv2.Rodrigues(pose.rotation)
    seen, _ = cv2.projectPoints(ends, turn, pose.translation, camera.matrix, None)
    columns, rows = page.shape[1] - 2 * rim, page.shape[0] - 2 * rim
    # Pixels of the page are areas: its edge lies half a pixel beyond the first centre.
    source = np.array([[0, 0], [columns, 0], [columns, rows], [0, rows]], float) + rim - 0.5
    matrix, _ = cv2.findHomography(source, seen.reshape(-1, 2))
    size = (camera.width, camera.height)
    # Four samples a side to a pixel, as a sensor averages.
    fine = np.array([[4.0, 0.0, 1.5], [0.0, 4.0, 1.5], [0.0, 0.0, 1.0]]) @ matrix
    large = (4 * size[0], 4 * size[1])
    warped = cv2.resize(cv2.warpPerspective(page, fine, large), size, interpolation=cv2.INTER_AREA)
    inside = cv2.warpPerspective(np.full_like(page, 255), matrix, size) > 0
    return np.where(inside, warped, image)


def on_table(x=0.07, y=-0.06, base=0.0):
    """Returns the pose (board -> camera) of a board on the container's support plane."""
    container = pose_of(PLACE, -0.5 * np.pi)
    origin = np.array([x, y, -CUP.fill_height - base])
    return Pose(container.rotation @ FACE_UP, container.rotation @ origin + container.translation)


def grey(value=120):
    return np.full((CAMERA.height, CAMERA.width), value, np.uint8)


@pytest.mark.parametrize("board", [CHARUCO, GRID], ids=["charuco", "aruco"])
def test_finds_a_board(board):
    truth = on_table()
    found = find_board(put(grey(), board, truth), CAMERA, board)
    assert np.allclose(found.pose.rotation, truth.rotation, atol=4e-3)
    assert np.allclose(found.pose.translation, truth.translation, atol=1.5e-3)
    assert found.residual < 0.5


def test_a_flat_board_tells_height_pitch_and_roll():
    found = find_board(put(grey(), CHARUCO, on_table(base=0.003)), CAMERA, CHARUCO)
    hint = hint_of_flat_board(found, CUP, 0.003)
    error = hint.numbers - PLACE.numbers
    assert np.array_equal(np.isnan(hint.numbers), [True, False, True, False, False])
    assert np.all(np.abs(error[[1, 3, 4]]) < [2e-3, 4e-3, 4e-3])
    assert np.all(np.abs(error[[1, 3, 4]]) < 3.0 * hint.stddev[[1, 3, 4]])


def test_a_board_at_a_known_place_gives_the_pose():
    turn, _ = cv2.Rodrigues(np.array([0.0, 0.0, 0.4]))
    place = Pose(turn @ FACE_UP, np.array([0.02, -0.08, -0.05]))
    container = pose_of(PLACE, 0.3)
    truth = Pose(
        container.rotation @ place.rotation,
        container.rotation @ place.translation + container.translation,
    )
    pose, covariance = pose_by_board(
        find_board(put(grey(), CHARUCO, truth), CAMERA, CHARUCO), place
    )
    found, azimuth = place_of(pose)
    error = np.abs(found.numbers - PLACE.numbers)
    assert np.all(error < [2e-3, 2e-3, 4e-3, 4e-3, 4e-3])
    assert azimuth == pytest.approx(0.3, abs=5e-3)
    assert np.all(np.sqrt(np.diag(covariance)) < 5e-3)


@pytest.mark.long
def test_board_and_edges_together(make_scene):
    scene = make_scene(
        width=1280, height=960, focal=1500.0, camera_height=0.25, distance=0.5, aim=-0.01
    )
    view = scene.calibration().view
    flat = np.array([0.08, -0.05, -CUP.fill_height])
    board_pose = Pose(
        view.pose.rotation @ FACE_UP, view.pose.rotation @ flat + view.pose.translation
    )
    image = put(scene.draw(), CHARUCO, board_pose, view.camera)
    hint = hint_of_flat_board(find_board(image, view.camera, CHARUCO), CUP, 0.0)
    fit = calibrate_by_edges(image, view.camera, CUP, hint=hint)
    check_hint(hint, fit.place.numbers)
    truth = place_of(view.pose)[0].numbers
    assert np.all(np.abs(fit.place.numbers - truth) < [2e-3, 1e-3, 1e-3, 2e-3, 1e-3])
    free = calibrate_by_edges(image, view.camera, CUP)
    assert np.all(fit.stddev[[1, 3]] < free.stddev[[1, 3]])
    # The same board said to be a third larger puts the plane elsewhere.
    wrong = Board(True, 5, 4, 0.027, 0.02)
    with pytest.raises(SloshCameraError, match="board: contradicts the container's edges, by"):
        check_hint(
            hint_of_flat_board(find_board(image, view.camera, wrong), CUP, 0.0), fit.place.numbers
        )


def test_an_upright_board_is_not_flat():
    upright = Pose(np.eye(3), np.array([-0.05, -0.04, 0.5]))
    found = find_board(put(grey(), CHARUCO, upright), CAMERA, CHARUCO)
    with pytest.raises(SloshCameraError, match="board: does not lie flat and face up"):
        hint_of_flat_board(found, CUP, 0.0)


def test_no_board_is_one_line():
    with pytest.raises(SloshCameraError, match=r"board: 0 corners of it are seen, 4 are needed"):
        find_board(grey(), CAMERA, CHARUCO)


def test_wrong_intrinsics_show_as_residual():
    image = put(grey(), CHARUCO, on_table())
    with pytest.raises(SloshCameraError, match=r"board: its corners lie .* px rms"):
        find_board(image, PinholeCamera(1280, 960, 700.0, 1500.0, 639.5, 479.5), CHARUCO)


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("", "is not charuco:COLS"),
        ("chess:7x5:0.02:0.015", "is not charuco:COLS"),
        ("charuco:7:0.02:0.015", "is not charuco:COLS"),
        ("charuco:7x5:wide:0.015", "is not charuco:COLS"),
        ("charuco:7x5:0.02:0.03", "do not fit"),
        ("charuco:1x5:0.02:0.01", "both must be 2 to 50"),
        ("charuco:900x900:0.02:0.01", "both must be 2 to 50"),
        ("charuco:7x5:nan:0.01", "must be positive"),
        ("aruco:2x2:-1:0.01", "must be positive"),
    ],
)
def test_bad_descriptions(text, match):
    with pytest.raises(SloshCameraError, match=match) as caught:
        parse_board(text)
    assert "\n" not in str(caught.value)


def test_unknown_or_short_dictionaries():
    with pytest.raises(SloshCameraError, match="OpenCV has no dictionary DICT_4X4_49"):
        Board(True, 5, 4, 0.02, 0.015, "4X4_49").opencv()
    with pytest.raises(SloshCameraError, match="needs 400 markers, DICT_4X4_50 has 50"):
        Board(False, 20, 20, 0.02, 0.005).opencv()


# A container by its sides first: its level among printed rings, from above and below.


RINGS = np.arange(-0.06, 0.05, 0.00186)
"""Every 2 mL of a graduated cylinder of 250 mL."""


def tall(make_scene, **look):
    """Draws a graduated cylinder whose printed rings are darker than its liquid."""
    scene = make_scene(
        radius=0.0185, distance=0.33, width=260, height=700, focal=900.0, oversampling=2, **look
    )
    image = scene.with_sides(scene.draw())
    return scene, scene.with_rings(image, RINGS, (-20.0, 60.0)), scene.calibration().view


def front_of(outline):
    """Returns the middle of the front contact line, (2,) [px]."""
    (front,) = (curve for curve in outline.curves if curve.curve is Curve.FRONT)
    return front.pixels[len(front.pixels) // 2]


LOOKS = {
    "level with the camera": {"liquid": 150},
    "from above": {"liquid": 150, "surface": 170, "camera_height": 0.06},
    "from far above": {"liquid": 150, "surface": 170, "camera_height": 0.12},
    "from below": {"liquid": 190, "camera_height": -0.06},
}


@pytest.mark.parametrize("look", LOOKS)
def test_the_level_is_found_between_rings(make_scene, look):
    _, image, truth = tall(make_scene, **LOOKS[look])
    outline = find_outline(edge_image(image), truth.camera, truth.cup)
    ((_, v),) = truth.project_wall(truth.camera_azimuth, 0.0, Wall.FRONT)
    assert outline is not None
    # 1 mm is 2.9 px.
    assert front_of(outline)[1] == pytest.approx(v, abs=1.5)


def test_of_two_lines_round_the_glass_a_click_tells_the_level(make_scene):
    scene, image, truth = tall(make_scene, liquid=214, surface=214)
    image = scene.with_rings(image, (0.0, 0.01))
    with pytest.raises(SloshCameraError, match=r"two levels are possible.*--level U V"):
        find_outline(edge_image(image), truth.camera, truth.cup)
    for height in (0.0, 0.01):
        ((u, v),) = truth.project_wall(truth.camera_azimuth, height, Wall.FRONT)
        outline = find_outline(edge_image(image), truth.camera, truth.cup, (u + 3.0, v + 2.0))
        assert outline is not None
        assert front_of(outline)[1] == pytest.approx(v, abs=2.2)


def test_the_flank_of_a_ring_just_below_the_reach_of_the_level_is_no_level(make_scene):
    """A ring so low that the fill height rules its middle out, but not its upper flank."""
    scene = make_scene(
        radius=0.0185,
        distance=0.33,
        width=260,
        height=700,
        focal=900.0,
        oversampling=2,
        liquid=209,
    )
    image, truth = scene.with_rings(scene.with_sides(scene.draw()), (-0.012,)), scene.calibration()
    cup = dataclasses.replace(truth.view.cup, fill_height=0.088)
    with pytest.raises(SloshCameraError, match=r"two levels are possible.*--level U V"):
        find_outline(edge_image(image), truth.view.camera, cup)


def test_rings_alone_are_no_level(make_scene):
    scene = make_scene(radius=0.0185, distance=0.33, width=260, height=700, focal=900.0)
    image = scene.with_rings(scene.with_sides(scene.empty()), RINGS, (-20.0, 60.0))
    view = scene.calibration().view
    assert find_outline(edge_image(image), view.camera, view.cup) is None


def test_no_sides_no_container(make_scene):
    view = make_scene().calibration().view
    image = make_scene(noise=3.0).empty()
    assert find_outline(edge_image(image), view.camera, view.cup) is None


def test_a_shallow_liquid_needs_a_click(make_scene):
    _, image, truth = tall(make_scene, liquid=150)
    edges, cup = edge_image(image), dataclasses.replace(truth.cup, fill_height=0.02)
    assert find_outline(edges, truth.camera, cup) is None
    ((u, v),) = truth.project_wall(truth.camera_azimuth, 0.0, Wall.FRONT)
    outline = find_outline(edges, truth.camera, cup, (u, v))
    assert outline is not None
    assert front_of(outline)[1] == pytest.approx(v, abs=1.5)


@pytest.mark.long
def test_a_large_picture_of_a_graduated_cylinder_is_calibrated(make_scene):
    scene = make_scene(
        radius=0.0185, distance=0.33, width=620, height=1660, focal=2200.0, oversampling=1,
        liquid=150, surface=170, camera_height=0.06,
    )  # fmt: skip
    image = scene.with_rings(scene.with_sides(scene.draw()), RINGS, (-20.0, 60.0))
    truth = scene.calibration().view
    fit = calibrate_by_edges(image, truth.camera, truth.cup)
    for height in (-0.01, 0.0, 0.01):
        pixel = truth.project_wall(truth.camera_azimuth, height, Wall.FRONT)
        assert fit.view.on_wall(pixel, Wall.FRONT)[1][0] == pytest.approx(height, abs=0.8e-3)


def test_a_wall_of_a_few_rows_shows_no_level(make_scene, monkeypatch):
    """Two lines of another object look like the sides of a container that is far away."""
    _, image, truth = tall(make_scene, liquid=150)
    monkeypatch.setattr("slosh_camera.calibrate.outline._extent", lambda *_: (-9.0, -8.0))
    assert find_outline(edge_image(image), truth.camera, truth.cup) is None
