"""A frozen camera is told by its images alone, in whatever memory they lie."""

import numpy as np
import pytest

from slosh_camera.images.repeats import RepeatedFrames

FIRST = np.random.default_rng(4).integers(0, 256, (30, 40, 3), dtype=np.uint8)


def changed(image, place):
    other = image.copy()
    other[place] ^= 1
    return other


@pytest.mark.parametrize("image", [FIRST, FIRST[..., 0], FIRST[..., ::-1], FIRST[3:, 5:]])
def test_only_the_image_before_counts(image):
    frames = RepeatedFrames()
    other = changed(image, (7, 9))
    answers = [frames.is_repeat(each) for each in (image, image, other, image, image)]
    assert answers == [False, True, False, False, True]


@pytest.mark.parametrize("place", [(0, 0), (29, 39), (15, 20, 2)])
def test_one_grey_level_of_one_pixel_is_a_new_image(place):
    frames = RepeatedFrames()
    assert not frames.is_repeat(FIRST)
    assert not frames.is_repeat(changed(FIRST, place))


def test_a_buffer_that_is_used_again_is_no_repeat():
    frames, buffer = RepeatedFrames(), FIRST.copy()
    assert not frames.is_repeat(buffer)
    buffer[:] = FIRST[::-1]
    assert not frames.is_repeat(buffer)


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
    """Images of one scene with the noise of a camera."""
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
