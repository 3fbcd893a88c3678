"""Tests the detector with difficult images and with images that show no surface."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slosh_camera.cylinder.detector import FreeSurfaceDetector
from slosh_camera.cylinder.still_reference import StillReferenceFinder
from slosh_camera.cylinder.surface import SHAPES, Prior
from slosh_camera.cylinder.surface_choice import SurfaceChooser
from slosh_camera.cylinder.wall_geometry import WallGeometry, build_scan_grid
from slosh_camera.errors import SloshCameraError
from slosh_camera.measurement import Flag, Measurement, PeakSide

MM = 1e-3
PITCHED = {"camera_height": 0.45 * np.tan(np.radians(10.0))}
CAMERAS = pytest.mark.parametrize("camera", [{}, PITCHED], ids=["level", "pitched"])
FIELDS = tuple(Measurement.__dataclass_fields__)


def turn(a, b):
    return abs(np.degrees(np.angle(np.exp(1j * (a - b)))))


def same(first, second):
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name), name)


# Surfaces of second order.


@pytest.mark.first(4)
@CAMERAS
@pytest.mark.parametrize("azimuth_deg", range(-165, 180, 60))
@pytest.mark.parametrize("size_mm", [10.0, 20.0, 30.0])
def test_sharp_crests_and_flat_troughs(make_scene, make_wave, camera, azimuth_deg, size_mm):
    scene = make_scene(noise=2.0, **camera)
    size = size_mm * MM
    square = size**2 / scene.radius
    rng = np.random.default_rng(azimuth_deg + 200)
    wave = make_wave(
        amplitude=size,
        azimuth=np.radians(azimuth_deg),
        second=rng.uniform(-0.04, 0.04) * size,
        mean=0.1 * square,
        double=rng.uniform(0.05, 0.25) * square,
    )
    height, azimuth = wave.highest
    # Not the first mode alone would do: it is lower by this and more.
    assert height - size > 0.04 * square
    result = FreeSurfaceDetector(scene.calibration()).measure(0, scene.draw_wave(wave))
    assert result.flags == Flag.NONE
    assert result.msh == pytest.approx(height, abs=0.6 * MM)
    assert result.fitted_msh == pytest.approx(height, abs=0.6 * MM)
    assert turn(result.fitted_azimuth, azimuth) < 3.0


@CAMERAS
def test_a_line_that_no_surface_has_is_flagged(make_scene, camera):
    """The line is either half hidden by another object, or has an impossible shape."""
    scene = make_scene(noise=2.0, **camera)
    image = scene.draw(0.012, scene.camera_azimuth + 1.4)
    rows, columns = np.mgrid[: image.shape[0], : image.shape[1]].astype(np.float32)
    detector = FreeSurfaceDetector(scene.calibration())
    claimed = []
    for size in (0.0, 8.0):
        wavy = rows + np.float32(size) * np.sin(columns / 18.0)
        result = detector.measure(0, cv2.remap(image, columns, wavy, cv2.INTER_LINEAR))
        assert bool(result.flags) == bool(size)
        claimed.append(result.msh_stddev)
    assert not claimed[1] < 5e-4 > claimed[0]


@CAMERAS
def test_a_local_bump_is_seen_and_not_fitted(make_scene, camera):
    # The line rises by a millimetre over a few: part of the raw height, not of the modes.
    scene = make_scene(**camera)
    image = scene.draw(0.015, scene.camera_azimuth)
    detector = FreeSurfaceDetector(scene.calibration())
    clean = detector.measure(0, image)
    u, v = (round(value) for value in clean.peak_pixel)
    cv2.ellipse(image, (u, v + 6), (22, 10), 0.0, 180.0, 360.0, scene.liquid, -1)
    bumped = detector.measure(0, image)
    assert bumped.msh > clean.msh + 0.15 * MM
    assert bumped.msh - clean.msh > 1.5 * (bumped.fitted_msh - clean.fitted_msh)
    assert bumped.msh_stddev > clean.msh_stddev


# What is hidden.


@CAMERAS
@pytest.mark.parametrize("grey", [20, 128, 240])
def test_a_front_peak_behind_a_thing_is_fitted_and_flagged(make_scene, camera, grey):
    scene = make_scene(noise=2.0, **camera)
    image = scene.draw(0.02, -1.6)
    detector = FreeSurfaceDetector(scene.calibration())
    u, v = (round(value) for value in detector.measure(0, image).peak_pixel)
    image[v - 30 : v + 60, u - 40 : u + 40] = grey
    result = detector.measure(1, image)
    assert result.flags == Flag.OCCLUDED
    assert result.fitted_msh == pytest.approx(0.02, abs=0.4 * MM)
    assert result.peak_side is PeakSide.FRONT


@CAMERAS
@pytest.mark.parametrize("half", [40, 60])
def test_a_peak_at_the_side_that_is_hidden_is_that_of_the_fit(make_scene, camera, half):
    scene = make_scene(noise=2.0, **camera)
    image = scene.draw(0.02, 0.0)
    detector = FreeSurfaceDetector(scene.calibration())
    u, v = (round(value) for value in detector.measure(0, image).peak_pixel)
    image[v - 30 : v + 60, u - half : u + half] = 128
    result = detector.measure(1, image)
    assert Flag.OCCLUDED in result.flags
    # What is seen is lower; the fit knows better, though less surely than of what is seen.
    assert np.nanmax(result.profile_height) < 0.018
    assert result.msh == result.fitted_msh == pytest.approx(0.02, abs=1.0 * MM)
    assert result.azimuth == result.fitted_azimuth
    assert result.msh_stddev > 1.5 * detector.measure(2, scene.draw(0.02, 0.0)).msh_stddev


@pytest.mark.first(4)
@CAMERAS
@pytest.mark.parametrize("azimuth", [0.0, 1.5, 2.5])
@pytest.mark.parametrize("half", [20, 40, 60])
@pytest.mark.parametrize("grey", [128, 240])
def test_a_rear_peak_that_is_partly_hidden_is_flagged_or_less_sure(
    make_scene, camera, azimuth, half, grey
):
    scene = make_scene(noise=2.0, **camera)
    image = scene.draw(0.02, azimuth)
    detector = FreeSurfaceDetector(scene.calibration())
    u, v = (round(value) for value in detector.measure(0, image).peak_pixel)
    image[v - 30 : v + 60, max(u - half, 0) : u + half] = grey
    # As a lens shows it: edges from one row to the next are those of a torn image.
    image = cv2.GaussianBlur(image, (5, 5), 0.7)
    result = detector.measure(1, image)
    assert not result.flags & ~(Flag.OCCLUDED | Flag.AMBIGUOUS)
    assert Flag.AMBIGUOUS not in result.flags or result.msh_stddev > 0.33 * MM
    assert result.fitted_msh == pytest.approx(0.02, abs=0.8 * MM)
    if result.flags == Flag.NONE:
        assert abs(result.msh - 0.02) < 4.0 * result.msh_stddev


# Light and blur.


@pytest.mark.parametrize("azimuth", [-1.6, 1.5])
@pytest.mark.parametrize(("background", "flag"), [(240, Flag.NONE), (255, Flag.TOO_BRIGHT)])
def test_an_over_exposed_background_is_flagged_and_still_measured(
    make_scene, background, flag, azimuth
):
    scene = make_scene(background=background, **PITCHED)
    result = FreeSurfaceDetector(scene.calibration()).measure(0, scene.draw(0.02, azimuth))
    assert result.flags == flag
    assert result.msh == pytest.approx(0.02, abs=0.4 * MM)


# Pictures without a surface.


def texture(seed):
    """Returns an image of noise, stripes, squares, objects or a ramp, without a container."""
    rng = np.random.default_rng(seed)
    v, u = np.mgrid[:480, :640].astype(np.float32)
    angle = rng.uniform(0.0, 2.0 * np.pi)
    noise = rng.normal(0.0, 1.0, (480, 640)).astype(np.float32)
    kind = seed % 6
    if kind == 0:
        image = cv2.GaussianBlur(noise, (0, 0), float(np.exp(rng.uniform(0.0, 4.4))))
    elif kind == 1:
        along = u * np.cos(angle) + v * np.sin(angle)
        image = np.sin(2.0 * np.pi * along / rng.uniform(8.0, 80.0))
    elif kind == 2:
        size = int(rng.integers(6, 60))
        image = (u // size + v // size) % 2
    elif kind == 3:
        image = np.full((480, 640), rng.uniform(), np.float32)
        for _ in range(40):
            x, y, width, height = rng.integers((0, 0, 10, 10), (640, 480, 200, 200))
            image[y : y + height, x : x + width] = rng.uniform()
    elif kind == 4:
        image = np.full((480, 640), 0.8, np.float32)
        for x, y, radius in rng.integers((0, 0, 5), (640, 480, 80), (30, 3)):
            cv2.circle(image, (int(x), int(y)), int(radius), float(rng.uniform()), -1)
    else:
        image = u * np.cos(angle) + v * np.sin(angle) + 20.0 * noise
    low, high = np.percentile(image, [1, 99])
    scaled = np.clip((image - low) / (high - low + 1e-9), 0.0, 1.0)
    return (scaled * rng.uniform(60.0, 250.0)).astype(np.uint8)


@pytest.fixture(scope="module", params=[{}, PITCHED], ids=["level", "pitched"])
def detectors(request, make_scene):
    """Detectors with and without data from an image of the liquid at rest."""
    scene = make_scene(**request.param)
    plain, learnt = (FreeSurfaceDetector(scene.calibration()) for _ in range(2))
    learnt.learn_still(scene.draw())
    return plain, learnt


@pytest.mark.first(5)
@pytest.mark.parametrize("seed", range(24))
def test_no_surface_is_read_from_a_texture(detectors, seed):
    image = texture(seed)
    for detector in detectors:
        result = detector.measure(0, image)
        assert Flag.NOT_FOUND in result.flags
        assert np.isnan([result.msh, result.fitted_msh, result.azimuth, result.sh_left]).all()
        assert result.profile_height.size == 0


@pytest.mark.first(1)
@settings(deadline=None, derandomize=True, max_examples=25)
@given(seed=st.integers(0, 10**6), grain=st.floats(0.5, 40.0), low=st.integers(0, 100))
def test_no_surface_is_read_from_noise(detectors, seed, grain, low):
    noise = np.random.default_rng(seed).normal(0.0, 1.0, (480, 640)).astype(np.float32)
    smooth = cv2.GaussianBlur(noise, (0, 0), grain)
    image = cv2.normalize(smooth, None, low, low + 150, cv2.NORM_MINMAX).astype(np.uint8)
    for detector in detectors:
        assert Flag.NOT_FOUND in detector.measure(0, image).flags


@pytest.mark.parametrize(("inclined_mm", "doubted"), [(0.4, False), (1.0, True), (1.5, True)])
def test_one_edge_that_is_inclined_at_rest_may_be_on_either_wall(make_scene, inclined_mm, doubted):
    # From the height of the still level both lines are one.
    scene = make_scene(camera_height=0.0)
    detector = FreeSurfaceDetector(scene.calibration())
    detector.learn_still(scene.draw(1e-3 * inclined_mm, -np.pi / 2))
    assert bool(detector.doubt) == doubted


def test_a_doubted_liquid_that_hardly_agrees_with_the_image_is_refused(make_scene, monkeypatch):
    scene, specks = make_scene(camera_height=0.0), np.random.default_rng(3)
    plain, spotted = scene.draw(), scene.draw()
    for _ in range(260):
        u, v = specks.integers((215, 262), (420, 395))
        spotted[v : v + 14, u : u + 10] = 200
    FreeSurfaceDetector(scene.calibration()).learn_still(spotted)
    monkeypatch.setattr(StillReferenceFinder, "_leans", lambda self, still: True)
    doubted = FreeSurfaceDetector(scene.calibration())
    doubted.learn_still(plain)
    assert doubted.doubt
    with pytest.raises(SloshCameraError, match="hidden or faint") as refusal:
        doubted.learn_still(spotted)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("height", [-0.03, 0.0])
def test_a_front_line_alone_does_not_tell_how_liquid_at_rest_leans(make_scene, make_wave, height):
    # An uneven wall: the line is 0.3 mm too high in its middle, and as much too low at its ends.
    scene = make_scene(camera_height=height)
    detector = FreeSurfaceDetector(scene.calibration())
    detector.learn_still(scene.draw_wave(make_wave(azimuth=-np.pi / 2, double=0.3 * MM)))
    for azimuth in (-np.pi / 2, np.pi / 2):
        result = detector.measure(0, scene.draw(0.01, azimuth))
        assert result.msh == pytest.approx(0.01, abs=0.25 * MM)


def test_a_label_that_ends_near_the_line_is_not_in_the_zero(make_scene):
    scene = make_scene(camera_height=0.12)
    still, wave = scene.draw(), scene.draw(0.01, np.pi / 2)
    line = int(scene.project(np.array([[0.0, -0.05, 0.0]]))[0, 1])
    for image in (still, wave):
        image[line - 5 : line + 60, 270:370] = 200
    detector = FreeSurfaceDetector(scene.calibration())
    detector.learn_still(still)
    assert abs(detector.still_offset) < 0.12 * MM
    assert detector.measure(0, still).msh < 0.15 * MM
    assert detector.measure(1, wave).msh == pytest.approx(0.01, abs=0.2 * MM)


@pytest.mark.parametrize("seed", range(6))
def test_a_texture_is_no_liquid_at_rest(make_scene, seed):
    detector = FreeSurfaceDetector(make_scene().calibration())
    with pytest.raises(SloshCameraError, match="still image: ") as refusal:
        detector.learn_still(texture(seed))
    assert "\n" not in str(refusal.value)
    assert detector.still_offset == 0.0


# No memory.


def frames(scene):
    return [
        scene.draw(0.02, -1.6),
        scene.empty(),
        scene.draw(0.015, 1.0),
        np.zeros((480, 640), np.uint8),
        scene.draw(0.005, 2.8),
        texture(3),
        scene.draw(),
    ]


@pytest.mark.parametrize("learns", [False, True])
def test_what_was_measured_before_does_not_matter(make_scene, learns):
    scene = make_scene(noise=2.0, **PITCHED)
    images = frames(scene)
    detector = FreeSurfaceDetector(scene.calibration())
    if learns:
        detector.learn_still(scene.draw(level=0.5 * MM))
    forwards = [detector.measure(i, image) for i, image in enumerate(images)]
    backwards = [detector.measure(i, images[i]) for i in reversed(range(len(images)))]
    for first, second in zip(forwards, reversed(backwards), strict=True):
        same(first, second)
    # The same again, and again by another detector, is no frozen image.
    fresh = FreeSurfaceDetector(scene.calibration())
    if learns:
        fresh.learn_still(scene.draw(level=0.5 * MM))
    same(fresh.measure(0, images[0]), forwards[0])
    same(fresh.measure(0, images[0]), forwards[0])
    assert Flag.FROZEN not in fresh.update(0, images[0]).flags
    assert Flag.FROZEN in fresh.update(1, images[0]).flags
    same(fresh.measure(0, images[0]), forwards[0])


def test_an_image_is_left_as_it_is(make_scene):
    scene = make_scene(noise=2.0)
    image = scene.draw(0.02, -1.6)
    image.setflags(write=False)
    before = image.copy()
    detector = FreeSurfaceDetector(scene.calibration())
    detector.learn_still(scene.draw())
    detector.update(0, image)
    np.testing.assert_array_equal(image, before)


def test_colour_and_its_mirror_image_are_measured_alike(make_scene):
    scene = make_scene(noise=1.0, **PITCHED)
    channels = [
        replace(scene, liquid=liquid, surface=surface, seed=liquid).draw(0.02, 1.2)
        for liquid, surface in ((40, 90), (60, 110), (150, 170))
    ]
    image = np.dstack(channels)
    detector = FreeSurfaceDetector(scene.calibration())
    forwards, backwards = detector.measure(0, image), detector.measure(0, image[..., ::-1])
    assert forwards.msh == pytest.approx(0.02, abs=0.4 * MM)
    assert backwards.msh == pytest.approx(forwards.msh, abs=0.02 * MM)
    padded = np.zeros((500, 700, 3), np.uint8)
    padded[10:490, 20:660] = image
    same(detector.measure(0, padded[10:490, 20:660]), forwards)


# Lower bounds.


@pytest.mark.first(5)
@pytest.mark.parametrize("azimuth", [-1.6, -0.6, 0.3, 1.5, 2.9])
@pytest.mark.parametrize("size_mm", [28.0, 35.0, 42.0])
def test_a_cut_off_height_is_at_most_the_true_one(make_scene, size_mm, azimuth):
    scene = make_scene(noise=2.0, aim=-0.085, rim_height=None)
    result = FreeSurfaceDetector(scene.calibration()).measure(0, scene.draw(size_mm * MM, azimuth))
    assert Flag.SATURATED in result.flags
    assert Flag.NOT_FOUND not in result.flags
    assert 0.0 < result.msh < size_mm * MM + 0.5 * MM
    assert result.peak_pixel[1] > -1.0


@pytest.mark.parametrize("azimuth", [-1.6, 0.3, 1.5])
def test_a_surface_that_is_not_cut_off_is_not_said_to_be(make_scene, azimuth):
    scene = make_scene(noise=2.0, aim=-0.09, rim_height=None)
    result = FreeSurfaceDetector(scene.calibration()).measure(0, scene.draw(0.008, azimuth))
    assert result.flags == Flag.NONE
    assert result.msh == pytest.approx(0.008, abs=0.4 * MM)


# What is no surface.


def test_liquid_above_the_rim_would_have_spilt(make_scene):
    scene = make_scene(camera_height=0.1)
    calibration = scene.calibration()
    wave = np.zeros(SHAPES)
    wave[2] = 0.045
    walls = WallGeometry(build_scan_grid(calibration.view, None), scene.radius)
    image = scene.draw(0.01, 1.5)
    (view, _), *_ = FreeSurfaceDetector(calibration).look(image).seen
    prior = Prior(np.zeros(SHAPES), first=0.025)
    for rim, possible in ((0.03, False), (0.043, True), (np.inf, True)):
        chooser = SurfaceChooser(walls, rim)
        assert np.isfinite(chooser.plausible_heights(view, wave, prior)) == possible
