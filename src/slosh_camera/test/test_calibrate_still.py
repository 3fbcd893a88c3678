"""Tests calibration against drawn and ray-traced images with known pose."""

import dataclasses
import json
import os
from pathlib import Path

import cv2
import numpy as np
import pytest

from slosh_camera.calibrate.fit import Hint
from slosh_camera.calibrate.pose import GivenDeviations, place_of, pose_of
from slosh_camera.calibrate.still import calibrate_by_edges, check_pose
from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.camera import Pose, camera_from_info
from slosh_camera.optics.cup import Cup, CupView, Wall

SHARED = Path(os.environ.get("SLOSH_SHARED_DATA", Path(__file__).parents[4] / "shared" / "data"))
RENDERED = SHARED / "rendered"
NO_SEQUENCES = f"no rendered sequences in {RENDERED}: name their folder in SLOSH_SHARED_DATA"


def height_errors(truth, found, wall):
    """Returns the height errors of a pose for wall points at heights of -20 to 20 mm [m]."""
    arc = np.deg2rad(np.linspace(-60.0, 60.0, 25)) + (np.pi if wall is Wall.REAR else 0.0)
    azimuth = truth.camera_azimuth + np.tile(arc, 3)
    height = np.repeat([-0.02, 0.0, 0.02], arc.size)
    _, read = found.on_wall(truth.project_wall(azimuth, height, wall), wall)
    return read - height


def worst_error(truth, fit):
    return max(np.max(np.abs(height_errors(truth, fit.view, wall))) for wall in Wall)


def rendered(name):
    truth = json.loads((RENDERED / name / "truth.json").read_text())
    known = truth["camera"]
    camera = camera_from_info(np.ravel(known["K"]), known["dist"], known["width"], known["height"])
    cup = Cup(
        truth["R"], truth["h"], truth["wall_thickness"], truth["h"] + truth["rim_z"],
        truth["n_wall"],
    )  # fmt: skip
    view = CupView(camera, Pose(np.array(known["R_cup2cam"]), np.array(known["t_cup2cam"])), cup)
    return cv2.imread(str(RENDERED / name / truth["static"]["file"])), view


@pytest.mark.long
@pytest.mark.skipif(not RENDERED.is_dir(), reason=NO_SEQUENCES)
@pytest.mark.parametrize(
    "name",
    [
        pytest.param("A_planar", marks=pytest.mark.long),
        pytest.param("B_rotating", marks=pytest.mark.long),
        "D_rotating",
    ],
)
def test_ray_traced_cup(name, record_property):
    image, truth = rendered(name)
    fit = calibrate_by_edges(image, truth.camera, truth.cup)
    worst = worst_error(truth, fit)
    record_property("worst_mm", 1e3 * float(worst))
    assert worst < 0.25e-3
    assert fit.residual < 0.4
    assert worst < 3.0 * max(fit.height_stddev.values())


SCENES = {
    "level": {},
    "from above, rolled": {"camera_height": 0.08, "roll": 0.03, "aim": 0.01},
    "from below": {"camera_height": -0.05},
    "distorting lens": {
        "camera_height": 0.05,
        "aim": 0.04,
        "distortion": (-0.4, 0.1, 0.004, -0.004, 0.0),
    },
    "rational lens": {
        "camera_height": 0.05,
        "aim": 0.04,
        "distortion": (0.4, -0.6, 0.001, -0.001, 0.05, 0.7, -0.55, 0.02),
        "distortion_model": "rational_polynomial",
    },
    "fisheye lens": {
        "camera_height": 0.05,
        "aim": 0.04,
        "distortion": (0.2, -0.02, 0.01, -0.003),
        "distortion_model": "equidistant",
    },
    "slightly from above": {"camera_height": 0.02},
    "light liquid, noise": {"liquid": 200, "surface": 150, "background": 60, "noise": 4.0},
}


@pytest.mark.first(2)
@pytest.mark.parametrize("name", SCENES)
def test_drawn_cup(make_scene, name):
    scene = make_scene(**SCENES[name])
    truth = scene.calibration().view
    cup = Cup(scene.radius, scene.fill_height)
    truth = CupView(truth.camera, truth.pose, cup)
    fit = calibrate_by_edges(scene.draw(), truth.camera, cup)
    assert worst_error(truth, fit) < 0.25e-3
    assert fit.place.roll == pytest.approx(place_of(truth.pose)[0].roll, abs=2e-3)


@pytest.mark.long
def test_without_the_floor_the_second_line_tells_above_from_below(make_scene):
    scene = make_scene(camera_height=0.05)
    view, cup = scene.calibration().view, Cup(scene.radius, scene.fill_height)
    camera = dataclasses.replace(view.camera, height=290)
    fit = calibrate_by_edges(np.ascontiguousarray(scene.draw()[:290]), camera, cup)
    assert worst_error(CupView(camera, view.pose, cup), fit) < 0.25e-3


def test_a_label_is_not_the_container(make_scene):
    scene = make_scene(camera_height=0.05)
    camera, cup = scene.calibration().view.camera, Cup(scene.radius, scene.fill_height)
    image = scene.draw()
    image[225:310, 300:350] = 225
    image[270:280, 305:345] = 60
    fit = calibrate_by_edges(image, camera, cup)
    assert worst_error(CupView(camera, scene.calibration().view.pose, cup), fit) < 0.25e-3


@pytest.mark.long
def test_large_image_is_searched_small_and_fitted_whole(make_scene):
    scene = make_scene(width=1920, height=1080, focal=2400.0, camera_height=0.04, oversampling=2)
    truth = scene.calibration().view
    cup = Cup(scene.radius, scene.fill_height)
    truth = CupView(truth.camera, truth.pose, cup)
    fit = calibrate_by_edges(scene.draw(), truth.camera, cup)
    assert worst_error(truth, fit) < 0.1e-3


@pytest.mark.long
def test_a_hint_moves_the_fit_as_far_as_it_is_sure(make_scene):
    scene = make_scene(camera_height=0.05)
    camera, cup = scene.calibration().view.camera, Cup(scene.radius, scene.fill_height)
    image = scene.draw()
    free = calibrate_by_edges(image, camera, cup)
    wrong = free.place.numbers + 0.002
    known = np.array([np.nan, np.nan, np.nan, wrong[3], np.nan])
    pitches = [
        calibrate_by_edges(image, camera, cup, hint=Hint(known, np.full(5, stddev))).place.pitch
        for stddev in (1.0, 1e-5)
    ]
    assert pitches[0] == pytest.approx(free.place.pitch, abs=1e-4)
    assert pitches[1] == pytest.approx(wrong[3], abs=1e-4)


def refusal(image, camera, cup):
    with pytest.raises(SloshCameraError) as caught:
        calibrate_by_edges(image, camera, cup)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def cut(image, camera, left=0, top=0):
    """Cuts off left columns and upper rows of an image; returns it with its camera."""
    part = np.ascontiguousarray(image[top:, left:])
    height, width = part.shape[:2]
    return part, dataclasses.replace(
        camera, width=width, height=height, cx=camera.cx - left, cy=camera.cy - top
    )


def test_refuses_what_does_not_show_a_container(make_scene):
    scene = make_scene(camera_height=0.05)
    camera, cup = scene.calibration().view.camera, Cup(scene.radius, scene.fill_height)
    noise = np.random.default_rng(1).integers(0, 255, (480, 640), dtype=np.uint8)
    for image in (np.zeros((480, 640), np.uint8), noise, scene.empty()):
        assert "no round container is found" in refusal(image, camera, cup)


def test_refuses_a_cut_container(make_scene):
    scene = make_scene(camera_height=0.05)
    camera, cup = scene.calibration().view.camera, Cup(scene.radius, scene.fill_height)
    # The left side is at column 208, the still level at rows 231 to 257.
    for left, top in ((240, 0), (320, 0), (0, 300)):
        assert "no round container is found" in refusal(*cut(scene.draw(), camera, left, top), cup)


def test_refuses_a_moving_surface(make_scene):
    scene = make_scene(camera_height=0.05)
    camera, cup = scene.calibration().view.camera, Cup(scene.radius, scene.fill_height)
    assert "still level is visible on" in refusal(scene.draw(0.005, 0.0), camera, cup)


def drawn(scene):
    """Returns image, true view and container of a scene."""
    view, cup = scene.calibration().view, Cup(scene.radius, scene.fill_height)
    return scene.draw(), CupView(view.camera, view.pose, cup), cup


@pytest.mark.long
def test_a_blurred_image_has_larger_standard_errors(make_scene):
    image, truth, cup = drawn(make_scene(camera_height=0.05))
    sharp = calibrate_by_edges(image, truth.camera, cup)
    blurred = np.asarray(cv2.GaussianBlur(image, (0, 0), 4.0))
    fit = calibrate_by_edges(blurred, truth.camera, cup)
    assert max(fit.height_stddev.values()) > 1.5 * max(sharp.height_stddev.values())
    assert worst_error(truth, fit) < 3.0 * max(fit.height_stddev.values())


def test_refuses_a_container_too_small_to_measure(make_scene):
    image, truth, cup = drawn(make_scene(camera_height=0.05, distance=4.0))
    assert "still image: " in refusal(image, truth.camera, cup)


@pytest.mark.long
def test_what_is_in_doubt_is_estimated_and_its_error_is_in_the_heights(make_scene):
    image, truth, cup = drawn(make_scene(camera_height=0.08))
    zoomed = dataclasses.replace(
        truth.camera, fx=1.03 * truth.camera.fx, fy=1.03 * truth.camera.fy
    )
    told = dataclasses.replace(cup, fill_height=cup.fill_height + 0.002)
    known = calibrate_by_edges(image, truth.camera, cup)
    doubted = calibrate_by_edges(
        image, zoomed, told, doubt=GivenDeviations(focal_length=0.05, fill_height=0.003)
    )
    assert max(doubted.height_stddev.values()) > max(known.height_stddev.values())
    assert worst_error(truth, doubted) < 3.0 * max(doubted.height_stddev.values())
    focal, wall, fill = doubted.stddev[5:]
    assert abs(doubted.view.camera.fx / truth.camera.fx - 1.0) < 3.0 * focal
    assert focal > 0.0
    assert wall == 0.0
    assert abs(doubted.view.cup.fill_height - cup.fill_height) < 3.0 * fill


@pytest.mark.long
def test_two_sides_and_a_level_alone_may_be_a_labels(make_scene):
    # A wall of glass would show above the level, the floor is outside the image.
    image, truth, cup = drawn(make_scene(camera_height=0.05))
    camera = dataclasses.replace(truth.camera, height=290)
    glass = Cup(cup.radius - 0.002, cup.fill_height, 0.002)
    cut_off = np.ascontiguousarray(image[:290])
    assert "neither the glass above the level nor the floor" in refusal(cut_off, camera, glass)
    fit = calibrate_by_edges(cut_off, camera, glass, distance=0.46)
    assert fit.place.distance == pytest.approx(0.45, rel=0.02)


@pytest.mark.long
def test_a_told_distance_chooses_between_two_containers(make_scene):
    image, truth, cup = drawn(make_scene(camera_height=0.05))
    beside = cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    wide = np.full((480, 960), image[0, 0], np.uint8)
    wide[:, :640], wide[120:360, 640:] = image, beside
    camera = dataclasses.replace(truth.camera, width=960)
    fit = calibrate_by_edges(wide, camera, cup, distance=0.43)
    assert worst_error(CupView(camera, truth.pose, cup), fit) < 0.5e-3


@pytest.mark.long
def test_refuses_to_choose_between_two_containers(make_scene):
    scene = make_scene(camera_height=0.05)
    camera, cup = scene.calibration().view.camera, Cup(scene.radius, scene.fill_height)
    image = scene.draw()
    both = np.hstack((image[:, 160:480], image[:, 160:480]))
    assert "two poses fit equally well" in refusal(both, camera, cup)


@pytest.mark.long
def test_refuses_what_stands_between_the_sides_of_another_container(make_scene):
    """Another glass with clearer edges stands behind the container."""
    scene = make_scene(camera_height=0.05)
    camera, cup = scene.calibration().view.camera, Cup(scene.radius, scene.fill_height)
    image = scene.draw()
    small = cv2.resize(image[:, 160:480], None, fx=0.3, fy=0.3, interpolation=cv2.INTER_AREA)
    faint = cv2.addWeighted(image, 0.15, np.full_like(image, image[0, 0]), 0.85, 0.0)
    part = faint[200 : 200 + small.shape[0], 272 : 272 + small.shape[1]]
    part[:] = np.minimum(part, small)
    assert "between the sides of what may be the container" in refusal(faint, camera, cup)


def test_refuses_images_of_another_camera(make_scene):
    camera, cup = make_scene().calibration().view.camera, Cup(0.05, 0.07)
    assert "1 x 1 pixels, the camera is calibrated for 640 x 480" in refusal(
        np.zeros((1, 1), np.uint8), camera, cup
    )
    assert "2-dimensional float64" in refusal(np.zeros((480, 640)), camera, cup)


def test_checking_a_known_pose_sees_how_far_it_is_off(make_scene):
    scene = make_scene(camera_height=0.05)
    view = scene.calibration().view
    cup = Cup(scene.radius, scene.fill_height)
    place, azimuth = place_of(view.pose)
    covariance = np.diag(np.full(5, 1e-8))
    offsets = []
    for rise in (0.0, 0.002):
        moved = dataclasses.replace(place, height=place.height + rise)
        fit = check_pose(
            scene.draw(), CupView(view.camera, pose_of(moved, azimuth), cup), covariance
        )
        offsets.append({curve.name: curve.offset for curve in fit.curves}["still level, front"])
    # Predicted too low by 2 mm of a wall 400 to 440 mm away, at 1000 px.
    assert offsets[0] == pytest.approx(0.0, abs=0.2)
    assert offsets[1] == pytest.approx(4.7, abs=0.3)
    blank = check_pose(scene.empty(), CupView(view.camera, view.pose, cup), covariance)
    assert np.isnan(blank.residual)


# A scale begins at the cup's rim or at its floor, and the level is anywhere in it.
SCALES = {
    "above a dyed liquid": (np.arange(0.006, 0.05, 0.006), (-76.0, 76.0), {"liquid": 120}),
    "above it, half round": (np.arange(0.006, 0.05, 0.006), (-20.0, 76.0), {"liquid": 120}),
    "everywhere on pale liquid": (np.arange(-0.054, 0.05, 0.012), (-20.0, 70.0), {"liquid": 150}),
    "from above": (
        np.arange(0.018, 0.05, 0.006),
        (-76.0, 40.0),
        {"liquid": 120, "surface": 170, "camera_height": 0.06},
    ),
}


@pytest.mark.first(2)
@pytest.mark.parametrize("name", SCALES)
def test_a_printed_scale_is_not_the_level(make_scene, name):
    heights, arc, look = SCALES[name]
    scene = make_scene(**look)
    image, truth, cup = drawn(scene)
    fit = calibrate_by_edges(scene.with_rings(image, heights, arc), truth.camera, cup)
    assert worst_error(truth, fit) < 1.5e-3


@pytest.mark.first(1)
@pytest.mark.parametrize("height", [pytest.param(-0.025, marks=pytest.mark.long), 0.02])
def test_of_two_lines_alike_a_click_tells_the_level(make_scene, height):
    scene = make_scene(liquid=214, surface=214)
    truth = scene.calibration().view
    image = scene.with_rings(scene.with_sides(scene.draw()), (0.0, height, -0.07))
    assert "two levels are possible" in refusal(image, truth.camera, truth.cup)
    ((u, v),) = truth.project_wall(truth.camera_azimuth + 0.3, 0.0, Wall.FRONT)
    fit = calibrate_by_edges(image, truth.camera, truth.cup, level=(u, v + 1.5))
    assert fit.level_shows
    ((_, found),) = fit.view.project_wall(truth.camera_azimuth + 0.3, 0.0, Wall.FRONT)
    # Either edge of a line two pixels thick; 1 mm is 2.2 px.
    assert found == pytest.approx(v, abs=2.2)


@pytest.mark.first(2)
@pytest.mark.parametrize("camera_height", [0.04, 0.0])
@pytest.mark.parametrize(("ring", "fill"), [(0.0, 0.04), (0.055, 0.07)], ids=["ring", "rim"])
def test_a_line_whose_sides_go_on_below_the_floor_is_no_level(
    make_scene, ring, fill, camera_height
):
    """An empty glass with one line around it, whose floor is deeper than the fill height."""
    scene = make_scene(camera_height=camera_height)
    camera = scene.calibration().view.camera
    image = scene.with_rings(scene.with_sides(scene.empty()), (ring,))
    assert "sides go on below" in refusal(image, camera, Cup(scene.radius, fill))


def test_a_click_must_be_in_the_image_and_on_the_container(make_scene):
    image, truth, cup = drawn(make_scene(camera_height=0.05))
    for pixel, words in (((700.0, 20.0), "outside the image"), ((20.0, 20.0), "--level")):
        with pytest.raises(SloshCameraError, match=words):
            calibrate_by_edges(image, truth.camera, cup, level=pixel)
