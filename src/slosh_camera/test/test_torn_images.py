"""Tests the detection of images whose upper and lower part are of different times."""

import cv2
import numpy as np
import pytest

from slosh_camera.cylinder.detector import FreeSurfaceDetector
from slosh_camera.images.seams import RepeatedFrames
from slosh_camera.measurement import Flag
from slosh_camera.rectangle.detector import SideViewDetector
from slosh_testing.side_view_scene import Liquid, Look, Setup, draw, still

WRONG = 1e-3


def exposed(image, seed):
    """Adds the blur of a lens and the noise of a camera to an image."""
    random = np.random.default_rng(seed)
    soft = cv2.GaussianBlur(image.astype(np.float32), (0, 0), 0.7)
    return np.clip(soft + 2.0 * random.standard_normal(image.shape), 0, 255).astype(np.uint8)


@pytest.mark.first(1)
@pytest.mark.parametrize(("height", "azimuth"), [(0.015, 0.3), (0.02, -1.4), (0.012, 2.0)])
def test_no_torn_image_is_measured_wrong_without_a_flag(make_scene, height, azimuth):
    """The liquid in the older image part is 12 mm lower."""
    scene = make_scene(camera_height=0.12)
    detector = FreeSurfaceDetector(scene.calibration())
    detector.learn_still(exposed(scene.draw(), 1))
    new = exposed(scene.draw(height, azimuth), 2)
    old = exposed(scene.draw(height - 0.012, azimuth), 3)
    assert detector.measure(0, new).flags == Flag.NONE
    rows = np.flatnonzero(np.any(np.abs(new.astype(int) - old) > 30, axis=1))
    wrong = flagged = 0
    for row in np.linspace(rows[0] + 3, rows[-1] - 3, 12).astype(int).tolist():
        for upper, lower in ((new, old), (old, new)):
            found = detector.measure(0, np.vstack((upper[:row], lower[row:])))
            if abs(found.msh - height) > WRONG:
                wrong += 1
                flagged += found.flags != Flag.NONE
    assert wrong > 3
    assert flagged == wrong


@pytest.mark.first(1)
@pytest.mark.parametrize("order", ["ab", "abc"])
def test_old_pictures_in_turn_are_told_under_fresh_noise(make_scene, order):
    scene = make_scene(camera_height=0.12)
    detector = FreeSurfaceDetector(scene.calibration())
    detector.learn_still(exposed(scene.draw(), 1))
    heights = {"a": 0.014, "b": 0.011, "c": 0.009}
    pictures = {name: scene.draw(heights[name], 0.4) for name in order}
    flags = [
        detector.update(33_000_000 * k, exposed(pictures[order[k % len(order)]], 9 + k)).flags
        for k in range(14)
    ]
    assert not any(flags[:2])
    assert all(Flag.AMBIGUOUS in one for one in flags[3 * len(order) :])


def test_torn_side_views_are_flagged_and_whole_ones_are_not():
    setup, look = Setup(columns=240, rows=200, focal=800.0), Look(surface=100.0, noise=2.0)
    detector = SideViewDetector(setup.calibration())
    detector.learn_still(still(setup, look))
    wrong = unflagged = 0
    for size in (0.008, -0.013):
        liquid, old = Liquid(modes=(size, 0.002)), Liquid(modes=(-0.4 * size, -0.001))
        new = draw(setup, liquid, look, 2)
        assert detector.measure(0, new).flags == Flag.NONE
        before = draw(setup, old, look, 3)
        rows = np.flatnonzero(np.any(np.abs(new.astype(int) - before) > 30, axis=1))
        for row in np.linspace(rows[0] + 5, rows[-1] - 5, 5).astype(int).tolist():
            for upper, lower in ((new, before), (before, new)):
                found = detector.measure(0, np.vstack((upper[:row], lower[row:])))
                if abs(found.msh - liquid.highest(setup.width)) > WRONG:
                    wrong += 1
                    unflagged += found.flags == Flag.NONE
    assert wrong > 8
    assert unflagged <= 0.5 * wrong, (wrong, unflagged)


# A frozen camera is told by its images alone, in whatever memory they lie.


FIRST = np.random.default_rng(4).integers(0, 256, (30, 40, 3), dtype=np.uint8)


def changed(image, place):
    other = image.copy()
    other[place] ^= 1
    return other


@pytest.mark.parametrize("place", [(0, 0), (29, 39), (15, 20, 2)])
def test_one_grey_level_of_one_pixel_is_a_new_image(place):
    frames = RepeatedFrames()
    assert not frames.is_repeat(FIRST)
    assert not frames.is_repeat(changed(FIRST, place))


@pytest.mark.parametrize("order", ["abab", "abcabc", "abcacb"])
def test_a_driver_that_hands_out_old_images_in_turn_is_frozen(order):
    frames = RepeatedFrames()
    images = {name: changed(FIRST, (k, k)) for k, name in enumerate("abc")}
    answers = [frames.is_repeat(images[name]) for name in order]
    fresh = len(set(order))
    assert answers == [False] * (fresh + 1) + [True] * (len(order) - fresh - 1)
    # An image of its own ends it.
    assert not frames.is_repeat(changed(FIRST, (9, 9)))
    assert not frames.is_repeat(images["a"])


def of_camera(count, shape=(64, 40)):
    """Returns images of one scene with camera noise."""
    random = np.random.default_rng(7)
    return [random.integers(90, 110, shape, dtype=np.uint8) for _ in range(count)]


@pytest.mark.parametrize("cut", [12, 32, 50])
@pytest.mark.parametrize("lower", [True, False])
@pytest.mark.parametrize("age", [1, 5])
def test_a_part_that_is_of_an_old_image_is_frozen(cut, lower, age):
    frames, images = RepeatedFrames(), of_camera(20)
    assert not any(frames.is_repeat(image) for image in images)
    old, new = images[-age], of_camera(21)[-1]
    torn = np.vstack([new[:cut], old[cut:]] if lower else [old[:cut], new[cut:]])
    assert frames.is_repeat(torn)
    # As long as it stays there, though all that is remembered shows it.
    for image in of_camera(40)[21:]:
        part = slice(cut, None) if lower else slice(0, cut)
        image[part] = old[part]
        assert frames.is_repeat(image)
    assert not frames.is_repeat(of_camera(41)[-1])


def test_a_picture_without_noise_may_stand_still_in_parts():
    frames = RepeatedFrames()
    for k, image in enumerate(of_camera(60)):
        image[:24] = 200  # what is drawn, or coded as unchanged
        if k % 20 > 12:
            image[24:40] = 200
        assert not frames.is_repeat(image)
