"""Tests the side-view detector against ray-traced images with known lines."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from slosh_camera.detection.detectors import detector_for
from slosh_camera.errors import SloshCameraError
from slosh_camera.measurement import Flag, PeakSide
from slosh_camera.rectangle.detector import SideMeasurement, SideViewDetector
from slosh_camera.settings import DetectionSettings, RegionOfInterest
from slosh_testing.side_view_scene import Liquid, Look, Patch, Setup, draw, still

# The camera looks up at the surface by 3 degrees: of two lines it sees only the one on the face.
SETUP = Setup(columns=360, rows=300, focal=1200.0, elevation=-0.05)
CLEAR = Look()
PIXEL = 1.0 / 3.0 * 1e-3
WAVE = Liquid(0.001, 0.0, (-0.010, 0.003, 0.001))
PLANE = Liquid(slope=0.25)
ABOVE = replace(SETUP, elevation=0.06)


def measured(setup=SETUP, liquid=WAVE, look=CLEAR, *, learn=True):
    detector = SideViewDetector(setup.calibration())
    if learn:
        detector.learn_still(still(setup, look))
    return detector.measure(7, draw(setup, liquid, look))


def profile_rms(measurement, setup=SETUP, liquid=WAVE):
    """Returns the RMS error of a measured profile [px]."""
    truth = liquid.at(measurement.profile_x, setup.width)
    return np.sqrt(np.nanmean((measurement.profile_height - truth) ** 2)) / PIXEL


@pytest.mark.parametrize("learn", [False, True])
@pytest.mark.parametrize(
    "liquid", [WAVE, PLANE, Liquid(level=-0.004)], ids=["wave", "plane", "low"]
)
def test_a_clean_line_is_measured_to_a_tenth_of_a_pixel(liquid, learn):
    result = measured(liquid=liquid, learn=learn)
    assert result.flags == Flag.NONE
    assert np.isfinite(result.profile_height).all()
    assert profile_rms(result, liquid=liquid) < 0.1
    assert result.slope_angle == pytest.approx(liquid.angle(SETUP.width), abs=np.radians(0.02))
    truth = liquid.highest(SETUP.width)
    assert result.msh == pytest.approx(truth, abs=0.15 * PIXEL)
    assert result.fitted_msh == pytest.approx(truth, abs=0.15 * PIXEL)
    ends = liquid.at(np.array([-0.04, 0.04]), SETUP.width)
    assert_allclose([result.sh_left, result.sh_right], ends, atol=0.2 * PIXEL)
    assert 0.0 < result.slope_stddev < np.radians(0.05)


@pytest.mark.first(4)
@pytest.mark.parametrize(
    ("look", "limit"),
    [
        (Look(noise=8.0), 0.12),
        (Look(blur=2.0, noise=2.0), 0.12),
        (Look(gradient=1.0, noise=3.0), 0.12),
        (Look(jpeg=40, noise=3.0), 0.15),
        (Look(motion=9), 0.12),
        (Look(brightness=0.3, noise=2.0), 0.12),
        (Look(liquid=200.0, background=70.0), 0.1),
        (Look(liquid=(160.0, 90.0, 40.0), background=(110.0, 95.0, 130.0), noise=3.0), 0.15),
    ],
    ids=["noise", "blur", "gradient", "jpeg", "motion", "dim", "lighter", "colour"],
)
def test_light_and_camera_cost_little(look, limit):
    result = measured(look=look)
    assert result.flags == Flag.NONE
    assert profile_rms(result) < limit
    assert result.slope_angle == pytest.approx(WAVE.angle(SETUP.width), abs=np.radians(0.05))


@pytest.mark.first(2)
@pytest.mark.parametrize(
    "setup",
    [
        replace(SETUP, distortion=(-0.25, 0.08, 0.001, -0.002, 0.0)),
        replace(SETUP, roll=0.06),
        replace(SETUP, yaw=0.2),
        replace(SETUP, wall_thickness=0.01, yaw=0.15),
        replace(SETUP, rim_height=None),
    ],
    ids=["distorted", "rolled", "oblique", "thick wall", "no rim"],
)
def test_where_the_camera_stands_does_not_matter(setup):
    result = measured(setup, learn=False)
    assert result.flags == Flag.NONE
    assert profile_rms(result, setup) < 0.2
    assert result.slope_angle == pytest.approx(WAVE.angle(SETUP.width), abs=np.radians(0.05))


@pytest.mark.parametrize("grey", [90.0, 110.0, 170.0])
def test_from_above_the_line_on_the_face_is_told_from_that_on_the_rear_wall(grey):
    result = measured(ABOVE, WAVE, Look(surface=grey, noise=2.0), learn=False)
    # The two lines are 2.4 mm apart, 7 rows.
    assert profile_rms(result, ABOVE) < 0.2


def test_a_surface_that_cannot_be_told_from_the_liquid_makes_the_slope_uncertain():
    setup = replace(SETUP, elevation=0.0)
    result = measured(setup, WAVE, Look(surface=60.0), learn=False)
    error = result.slope_angle - WAVE.angle(SETUP.width)
    assert abs(error) > np.radians(0.3)
    assert abs(error) < 3.0 * result.slope_stddev


@pytest.mark.parametrize("grey", [235.0, 150.0, 60.0])
def test_stickers_hide_no_more_than_their_own_columns(grey):
    label = Patch((-0.010, -0.02), (0.006, 0.02), grey)
    result = measured(look=Look(patches=(label,), noise=2.0))
    assert Flag.OCCLUDED in result.flags
    assert profile_rms(result) < 0.1
    hidden = result.profile_x[np.isnan(result.profile_height)]
    assert hidden.min() == pytest.approx(-0.010, abs=0.003)
    assert hidden.max() == pytest.approx(0.006, abs=0.003)
    assert result.slope_angle == pytest.approx(WAVE.angle(SETUP.width), abs=np.radians(0.1))


def test_droplets_on_the_wall_are_no_crests():
    drops = tuple(
        Patch((x - 0.002, 0.021), (x + 0.002, 0.026), 60.0, round=True)
        for x in np.linspace(-0.03, 0.03, 6)
    )
    result = measured(look=Look(patches=drops))
    assert result.flags == Flag.NONE
    assert profile_rms(result) < 0.1
    assert result.msh == pytest.approx(WAVE.highest(SETUP.width), abs=0.15 * PIXEL)


def test_a_fifth_of_the_line_may_be_hidden_at_a_wall():
    hand = Patch((0.024, -0.03), (0.05, 0.06), 150.0)
    result = measured(look=Look(patches=(hand,), noise=2.0), learn=False)
    assert Flag.OCCLUDED in result.flags
    assert np.isnan(result.sh_right)
    error = result.slope_angle - WAVE.angle(SETUP.width)
    assert abs(error) < np.radians(1.0)


@pytest.mark.parametrize("setup", [SETUP, replace(SETUP, rim_height=0.08)], ids=["image", "rim"])
def test_a_crest_beyond_the_view_is_a_lower_bound(setup):
    liquid = Liquid(level=0.02 if setup is SETUP else 0.0, slope=0.8)
    result = measured(setup, liquid)
    assert Flag.SATURATED in result.flags
    truth = liquid.highest(SETUP.width)
    assert 0.015 < result.msh < truth
    assert np.isnan(result.sh_right)
    assert result.sh_left == pytest.approx(liquid.level - 0.032, abs=0.3 * PIXEL)
    assert result.azimuth == 0.0


@pytest.mark.parametrize(
    ("look", "flag"),
    [
        (Look(brightness=0.08), Flag.TOO_DARK),
        (Look(brightness=6.0), Flag.TOO_BRIGHT),
        (Look(liquid=190.0, surface=190.0), Flag.NOT_FOUND),
        (Look(liquid=(100.0, 120.0, 90.0), background=(100.0, 120.0, 91.0)), Flag.NOT_FOUND),
    ],
)
def test_an_image_without_a_line_is_refused(look, flag):
    result = measured(look=look, learn=False)
    assert flag in result.flags
    assert Flag.NOT_FOUND in result.flags
    assert np.isnan([result.msh, result.slope_angle, result.slope_stddev]).all()
    assert result.profile_x.size == 0
    assert result.edge_pixels.shape == (0, 2)


def test_noise_alone_is_refused():
    detector = SideViewDetector(SETUP.calibration())
    detector.learn_still(still(SETUP))
    for seed in range(5):
        noise = np.random.default_rng(seed).integers(0, 255, (SETUP.rows, SETUP.columns), np.uint8)
        assert Flag.NOT_FOUND in detector.measure(0, noise).flags


def test_an_empty_container_is_not_found():
    assert Flag.NOT_FOUND in measured(liquid=Liquid(level=-0.07)).flags


def test_a_soft_line_is_flagged_as_blurred():
    result = measured(look=Look(blur=5.0), learn=False)
    assert Flag.BLURRED in result.flags
    assert Flag.BLURRED not in measured(look=Look(blur=1.5), learn=False).flags


def test_the_stated_deviation_is_that_of_the_error():
    generator = np.random.default_rng(5)
    look = Look(noise=4.0, gradient=0.3, jpeg=70)
    detector = SideViewDetector(SETUP.calibration())
    detector.learn_still(still(SETUP, look))
    ratios = []
    for seed in range(12):
        modes = tuple(generator.normal(0.0, (0.006, 0.002, 0.001)))
        liquid = Liquid(generator.normal(0.0, 5e-4), generator.normal(0.0, 0.1), modes)
        result = detector.measure(0, draw(SETUP, liquid, look, seed))
        truth = liquid.highest(SETUP.width)
        ratios.append(
            (
                (result.msh - truth) / result.msh_stddev,
                (result.fitted_msh - truth) / result.fitted_msh_stddev,
                (result.slope_angle - liquid.angle(SETUP.width)) / result.slope_stddev,
            )
        )
        assert result.msh_stddev < 0.2 * PIXEL
    spread = np.sqrt(np.mean(np.square(ratios), axis=0))
    assert np.all(spread < 1.6)
    assert np.all(spread[:2] > 0.2)


def test_what_the_liquid_at_rest_teaches():
    setup = replace(SETUP, roll=0.01)
    # The images come from a camera that is rolled and 1 mm lower than the calibration says.
    detector = SideViewDetector(replace(SETUP, aim=0.001).calibration())
    offset = detector.learn_still(still(setup))
    assert abs(offset) == pytest.approx(0.001, abs=1e-4)
    assert detector.still_offset == offset
    rest = detector.measure(0, still(setup))
    assert rest.msh == pytest.approx(0.0, abs=0.1 * PIXEL)
    assert rest.slope_angle == pytest.approx(0.0, abs=np.radians(0.01))
    result = detector.measure(0, draw(setup, WAVE))
    assert profile_rms(result) < 0.3


def test_a_still_image_that_teaches_nothing_changes_nothing():
    detector = SideViewDetector(SETUP.calibration())
    detector.learn_still(still(SETUP))
    image = draw(SETUP, WAVE)
    before = detector.measure(0, image).msh
    for wrong, word in ((draw(SETUP, PLANE), "inclined"), (np.zeros_like(image), "no complete")):
        with pytest.raises(SloshCameraError, match=word) as caught:
            detector.learn_still(wrong)
        assert "\n" not in str(caught.value)
    assert detector.measure(0, image).msh == before


def test_measure_leaves_no_trace_and_update_flags_repeats():
    detector = SideViewDetector(SETUP.calibration())
    first, second = draw(SETUP, WAVE), draw(SETUP, PLANE)
    alone = detector.measure(1, first)
    detector.measure(2, second)
    again = detector.measure(3, first)
    assert (alone.msh, alone.slope_angle) == (again.msh, again.slope_angle)
    assert_array_equal(alone.profile_height, again.profile_height)
    flags = [detector.update(4, image).flags for image in (first, first, second, first)]
    assert [Flag.FROZEN in flag for flag in flags] == [False, True, False, False]
    assert isinstance(detector.update(5, first), SideMeasurement)


def test_the_measurement_says_where_everything_is():
    result = measured()
    assert isinstance(result, SideMeasurement)
    assert (result.stamp_ns, result.peak_side) == (7, PeakSide.FRONT)
    assert_allclose(result.profile_x, np.linspace(-0.04, 0.04, result.profile_x.size))
    assert result.profile_azimuth.size == 0
    assert (result.azimuth_left, result.azimuth_right) == (np.pi, 0.0)
    # The wave is high at the right wall.
    assert (result.azimuth, result.fitted_azimuth) == (0.0, 0.0)
    view = SETUP.calibration().view
    truth = WAVE.highest(SETUP.width)
    assert_allclose(result.peak_pixel, view.project_face(0.04, truth)[0], atol=1.0)
    x, z = view.on_face(result.edge_pixels)
    assert np.sqrt(np.mean((z - WAVE.at(x, SETUP.width)) ** 2)) < 0.15 * PIXEL
    assert np.all(np.diff(x) > 0.0)
    copy = pickle.loads(pickle.dumps(result))
    assert copy.slope_stddev == result.slope_stddev


def test_colour_and_grey_images_of_one_scene_agree():
    detector = SideViewDetector(SETUP.calibration())
    grey = draw(SETUP, WAVE)
    colour = np.repeat(grey[..., np.newaxis], 3, axis=2)
    results = [detector.measure(0, image) for image in (grey, colour, colour[..., ::-1])]
    assert_allclose([r.msh for r in results], results[0].msh, atol=0.05 * PIXEL)
    assert_allclose([r.slope_angle for r in results], results[0].slope_angle, atol=1e-4)


@pytest.mark.parametrize(
    ("region", "word"),
    [
        (RegionOfInterest(0, 0, 360, 60), "still level"),
        (RegionOfInterest(0, 250, 360, 50), "still level"),
        (RegionOfInterest(0, 0, 20, 300), "columns"),
    ],
)
def test_a_region_without_the_line_is_refused(region, word):
    with pytest.raises(SloshCameraError, match=word):
        SideViewDetector(SETUP.calibration(region))


def test_a_region_of_interest_cuts_the_view():
    whole = SETUP.calibration()
    detector = SideViewDetector(replace(whole, region=RegionOfInterest(150, 40, 120, 220)))
    result = detector.measure(0, draw(SETUP, WAVE))
    assert result.edge_pixels[:, 0].min() >= 150
    assert result.edge_pixels[:, 0].max() < 270
    assert np.isnan(result.sh_left)


def test_the_detector_fits_the_calibration(make_scene):
    assert isinstance(detector_for(SETUP.calibration()), SideViewDetector)
    cylinder = detector_for(make_scene().calibration())
    assert not isinstance(cylinder, SideViewDetector)
    strict = detector_for(SETUP.calibration(), DetectionSettings(min_contrast=200.0))
    assert Flag.NOT_FOUND in strict.measure(0, draw(SETUP, WAVE)).flags
    with pytest.raises(SloshCameraError, match="calibration: NoneType"):
        detector_for(None)
