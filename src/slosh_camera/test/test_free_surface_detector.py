import pickle
import subprocess
import sys
from dataclasses import replace

import cv2
import numpy as np
import pytest

from slosh_camera.cylinder.detector import FreeSurfaceDetector
from slosh_camera.errors import SloshCameraError
from slosh_camera.measurement import Flag, PeakSide
from slosh_camera.optics.cup import Wall
from slosh_camera.settings import DetectionSettings, LiquidContrast, RegionOfInterest

MM = 1e-3
PITCHED = {"camera_height": 0.45 * np.tan(np.radians(10.0))}


def measure(scene, image, settings=None, region=None):
    return FreeSurfaceDetector(scene.calibration(settings, region)).update(7, image)


def angle(a, b):
    return abs(np.degrees(np.angle(np.exp(1j * (a - b)))))


@pytest.mark.first(12)
@pytest.mark.parametrize("azimuth_deg", range(-180, 180, 30))
@pytest.mark.parametrize("camera", [{}, PITCHED], ids=["level", "pitched"])
def test_tilted_plane_all_around(make_scene, camera, azimuth_deg):
    scene = make_scene(noise=2.0, **camera)
    azimuth = np.radians(azimuth_deg)
    result = measure(scene, scene.draw(0.02, azimuth))
    assert result.flags == Flag.NONE
    assert result.stamp_ns == 7
    assert result.msh == pytest.approx(0.02, abs=0.4 * MM)
    assert angle(result.azimuth, azimuth) < 12.0
    towards_camera = np.cos(azimuth - scene.camera_azimuth)
    if abs(towards_camera) > 0.3:
        assert result.peak_side is (PeakSide.FRONT if towards_camera > 0 else PeakSide.REAR)
    for height, edge in (
        (result.sh_left, result.azimuth_left),
        (result.sh_right, result.azimuth_right),
    ):
        assert height == pytest.approx(0.02 * np.cos(edge - azimuth), abs=0.9 * MM)


@pytest.mark.parametrize("camera", [{}, PITCHED], ids=["level", "pitched"])
def test_profile_lies_on_the_plane(make_scene, camera):
    scene = make_scene(**camera)
    result = measure(scene, scene.draw(0.015, 2.0))
    assert result.profile_azimuth.size == result.profile_height.size > 200
    assert result.edge_pixels.shape == (result.profile_azimuth.size, 2)
    error = result.profile_height - 0.015 * np.cos(result.profile_azimuth - 2.0)
    assert np.median(np.abs(error)) < 0.1 * MM
    assert np.percentile(np.abs(error), 95) < 0.6 * MM


@pytest.mark.long
def test_sub_pixel_resolution(make_scene):
    # One pixel row is 0.4 mm on the front wall; the level is moved in steps of a tenth of it.
    scene = make_scene(oversampling=16)
    detector = FreeSurfaceDetector(scene.calibration())
    levels = np.arange(-12, 13) * 0.04 * MM
    found = [
        np.median(detector.update(index, scene.draw(level=level)).profile_height)
        for index, level in enumerate(levels)
    ]
    assert np.max(np.abs(found - levels)) < 0.07 * MM
    assert np.mean(np.abs(found - levels)) < 0.03 * MM


def test_stddev_covers_the_error_and_grows_with_blur(make_scene):
    scene = make_scene(noise=2.0)
    image = scene.draw(0.02, -1.3)
    sharp = measure(scene, image)
    soft = measure(scene, cv2.GaussianBlur(image, (0, 0), 2.5))
    assert abs(sharp.msh - 0.02) < 3.0 * sharp.msh_stddev
    assert sharp.msh_stddev < 0.5 * MM
    assert soft.msh_stddev > 1.5 * sharp.msh_stddev


@pytest.mark.parametrize("amplitude_mm", np.arange(5.0, 10.0, 0.5))
def test_a_thin_strip_of_surface_behind_the_front_line(make_scene, amplitude_mm):
    # Seen at 10 degrees, a surface that leans towards the camera by 6 to 11 degrees is a strip
    # of a few rows or none at all.
    scene = make_scene(noise=2.0, **PITCHED)
    result = measure(scene, scene.draw(amplitude_mm * MM, scene.camera_azimuth))
    assert result.msh == pytest.approx(amplitude_mm * MM, abs=0.4 * MM)


@pytest.mark.parametrize("roll_deg", [-3.0, 3.0])
def test_rolled_camera(make_scene, roll_deg):
    scene = make_scene(roll=np.radians(roll_deg))
    result = measure(scene, scene.draw(0.015, -1.0))
    assert result.msh == pytest.approx(0.015, abs=0.3 * MM)


LENSES = {
    "plumb_bob": (-0.3, 0.1, 0.002, -0.001, 0.0),
    "rational_polynomial": (0.4, -0.6, 0.001, -0.001, 0.05, 0.7, -0.55, 0.02),
    "thin_prism": (-0.3, 0.1, 0.002, -0.001, 0.0, 0.0, 0.0, 0.0, 0.01, -0.02, -0.01, 0.01),
    "equidistant": (0.05, -0.02, 0.01, -0.003),
}


@pytest.mark.parametrize("model", LENSES)
def test_lens_distortion(make_scene, model):
    scene = make_scene(distortion=LENSES[model], distortion_model=model, focal=700.0, distance=0.3)
    result = measure(scene, scene.draw(0.02, -1.6))
    assert result.msh == pytest.approx(0.02, abs=0.3 * MM)


def test_a_fisheye_camera_near_the_cup(make_scene):
    scene = make_scene(
        distortion=LENSES["equidistant"], distortion_model="equidistant", focal=300.0,
        distance=0.13, camera_height=0.02, aim=-0.05,
    )  # fmt: skip
    result = measure(scene, scene.draw(0.02, -1.6))
    assert result.msh == pytest.approx(0.02, abs=0.4 * MM)
    wrong = replace(scene, distortion=(0.0,) * 5, distortion_model="plumb_bob")
    assert abs(measure(wrong, scene.draw(0.02, -1.6)).msh - 0.02) > 1.0 * MM


def test_liquid_lighter_than_its_background(make_scene):
    scene = make_scene(liquid=220, surface=150, background=40, **PITCHED)
    image = scene.draw(0.02, 1.4)
    result = measure(scene, image)
    assert result.msh == pytest.approx(0.02, abs=0.3 * MM)
    assert result.peak_side is PeakSide.REAR
    told = measure(scene, image, DetectionSettings(liquid=LiquidContrast.LIGHTER))
    assert told.msh == result.msh


def test_liquid_that_should_be_darker_is_not_lighter(make_scene):
    scene = make_scene(liquid=220, surface=150, background=40, **PITCHED)
    settings = DetectionSettings(liquid=LiquidContrast.DARKER)
    assert measure(scene, scene.draw(0.02, 1.4), settings).flags == Flag.NOT_FOUND


def test_coloured_liquid_as_bright_as_its_background(make_scene):
    scene = make_scene(noise=2.0)
    # Grey level 140 of liquid and of background; only the colours differ.
    liquid, surface, background = (52, 143, 178), (100, 145, 155), (180, 137, 136)
    channels = [
        replace(scene, liquid=a, surface=b, background=c, seed=a).draw(0.015, -1.0)
        for a, b, c in zip(liquid, surface, background, strict=True)
    ]
    image = np.dstack(channels)
    grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    assert abs(np.median(grey[300:380, 300:340]) - np.median(grey[:60])) < 4
    assert measure(scene, grey).flags == Flag.NOT_FOUND
    assert measure(scene, image).msh == pytest.approx(0.015, abs=0.3 * MM)


@pytest.mark.parametrize("gain", [0.4, 0.7, 1.15])
def test_brightness_moves_nothing(make_scene, gain):
    scene = make_scene()
    image = scene.draw(0.02, -1.6)
    clean = measure(scene, image)
    other = measure(scene, cv2.convertScaleAbs(image, alpha=gain))
    assert other.flags == Flag.NONE
    assert other.fitted_msh == pytest.approx(clean.fitted_msh, abs=0.05 * MM)


def test_specks_and_drops_are_not_the_line(make_scene):
    scene = make_scene()
    image = scene.draw(0.01, -1.6)
    cv2.circle(image, (300, 150), 4, 40, -1)  # a drop on the wall
    cv2.circle(image, (340, 170), 1, 40, -1)  # dirt
    image[320:323, 310:312] = 250  # a glint in the liquid
    image[:, 250] = image[:, 380] = 30  # scratches
    result = measure(scene, image)
    assert result.msh == pytest.approx(0.01, abs=0.2 * MM)
    assert result.flags == Flag.NONE


def test_a_dark_reflection_in_the_surface_is_not_the_front_line(make_scene):
    scene = make_scene(camera_height=0.15)
    azimuth = scene.camera_azimuth + np.pi + 0.3
    image = scene.draw(0.008, azimuth)
    clean = measure(scene, image)
    front = clean.edge_pixels[clean.edge_pixels[:, 1] > 240]
    for u, v in front[(front[:, 0] > 340) & (front[:, 0] < 370)]:
        image[round(v) - 60 : round(v) + 1, round(u)] = scene.liquid
    result = measure(scene, image)
    assert result.msh == pytest.approx(0.008, abs=0.3 * MM)
    assert result.peak_side is PeakSide.REAR
    assert np.max(result.profile_height) < 0.0085


def test_line_above_the_region_is_a_lower_bound(make_scene):
    scene = make_scene()
    image = scene.draw(0.03, -1.6)
    given = RegionOfInterest(x_offset=0, y_offset=200, width=640, height=280)
    result = measure(scene, image, region=given)
    assert Flag.SATURATED in result.flags
    assert result.msh < 0.03
    assert measure(scene, image).flags == Flag.NONE


def test_an_edge_above_the_frame_is_a_lower_bound_and_not_continued(make_scene):
    scene = make_scene(aim=-0.08, rim_height=None)
    azimuth_left = scene.calibration().view.tangent_azimuths()[0]
    result = measure(scene, scene.draw(0.04, azimuth_left + 0.5))
    assert Flag.SATURATED in result.flags
    border = scene.calibration().view.on_wall([[result.peak_pixel[0], 0.0]], Wall.FRONT)[1][0]
    assert result.msh == pytest.approx(border, abs=0.5 * MM)
    assert result.msh < 0.04


@pytest.mark.parametrize(
    ("grey", "flags"),
    [
        (0, Flag.TOO_DARK | Flag.NOT_FOUND),
        (255, Flag.TOO_BRIGHT | Flag.NOT_FOUND),
        (128, Flag.NOT_FOUND),
    ],
)
def test_uniform_images_hold_no_liquid(make_scene, grey, flags):
    scene = make_scene()
    result = measure(scene, np.full((480, 640), grey, np.uint8))
    assert result.flags == flags
    assert np.isnan([result.msh, result.msh_stddev, result.azimuth, result.sh_left]).all()
    assert result.profile_height.size == 0
    assert result.peak_side is PeakSide.UNKNOWN


def test_empty_background_is_not_liquid(make_scene):
    scene = make_scene(noise=6.0)
    assert measure(scene, scene.empty()).flags == Flag.NOT_FOUND
    # A dark thing behind the upper half of an empty cup does not make liquid either.
    image = scene.empty()
    image[100:200] //= 4
    assert measure(scene, image).flags == Flag.NOT_FOUND


def test_too_faint_a_liquid_is_not_guessed_at(make_scene):
    scene = make_scene(liquid=206, surface=210)
    assert measure(scene, scene.draw(0.01)).flags == Flag.NOT_FOUND


def test_a_detector_that_starts_to_work_has_compiled_all_that_it_needs(make_scene, tmp_path):
    scene = make_scene()
    image = scene.draw(0.01)
    (tmp_path / "given").write_bytes(pickle.dumps((scene.calibration(), image)))
    program = """
import pickle, sys
from slosh_camera.detection.detectors import learnt_detector
from slosh_base.compiled.compilation import EntryPoint, entry_points
calibration, image = pickle.load(sys.stdin.buffer)
detector = learnt_detector(calibration)
def fail(self): raise AssertionError(self.name + " is compiled while an image waits")
EntryPoint._compile = fail
print(detector.measure(0, image).msh)
print([one.name for one in entry_points() if one.loaded and "slosh_camera" not in one.name])
"""
    command = [sys.executable, "-c", program]
    with (tmp_path / "given").open("rb") as given:
        done = subprocess.run(command, stdin=given, check=True, capture_output=True, text=True)
    height, others = done.stdout.splitlines()
    assert float(height) == measure(scene, image).msh
    assert others == "[]"


def test_still_image_sets_the_zero(make_scene):
    scene = make_scene(**PITCHED)
    detector = FreeSurfaceDetector(scene.calibration())
    offset = detector.learn_still(scene.draw(level=1.5 * MM))
    assert offset == pytest.approx(1.5 * MM, abs=0.1 * MM)
    result = detector.update(0, scene.draw(0.01, -1.6, level=1.5 * MM))
    assert result.msh == pytest.approx(0.01, abs=0.2 * MM)
    # Learning the same again changes nothing.
    assert detector.learn_still(scene.draw(level=1.5 * MM)) == pytest.approx(offset, abs=1e-6)


def test_still_image_without_liquid_is_refused(make_scene):
    scene = make_scene()
    detector = FreeSurfaceDetector(scene.calibration())
    with pytest.raises(SloshCameraError, match="still image"):
        detector.learn_still(scene.empty())


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((1, 1), np.uint8),
        np.zeros((0, 0), np.uint8),
        np.zeros((480, 641), np.uint8),
        np.zeros((480, 640, 4), np.uint8),
        np.zeros((480, 640), np.float64),
    ],
)
def test_images_of_another_camera_are_refused(make_scene, image):
    detector = FreeSurfaceDetector(make_scene().calibration())
    with pytest.raises(SloshCameraError, match="calibration is for 640 x 480"):
        detector.update(0, image)


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"aim": 0.3}, "still level"),
        ({"aim": -0.3}, "still level"),
        ({"roll": 1.6}, "rolled"),
        ({"distance": 30.0}, "lines"),
    ],
)
def test_a_view_in_which_nothing_can_be_measured_is_refused(make_scene, changes, word):
    with pytest.raises(SloshCameraError, match=word):
        FreeSurfaceDetector(make_scene(**changes).calibration())


def test_part_of_the_cup_is_enough(make_scene):
    # The region shows the left half only; the right edge is unknown, not guessed.
    scene = make_scene()
    region = RegionOfInterest(0, 0, 300, 480)
    result = measure(scene, scene.draw(0.02, -1.6), region=region)
    assert np.isfinite(result.sh_left)
    assert np.isnan(result.sh_right)


@pytest.mark.parametrize(
    "changes",
    [
        {"blur": -1.0},
        {"min_contrast": np.nan},
        {"max_blur": 0.0},
        {"max_dark": 300.0},
        {"min_bright": -1.0},
        {"liquid": "darker"},
    ],
)
def test_settings_out_of_bounds_are_refused(changes):
    name = next(iter(changes))
    with pytest.raises(SloshCameraError, match=name):
        DetectionSettings(**changes)
