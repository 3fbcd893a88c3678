"""Tests messages filled by field names, times, images and QoS."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rclpy.qos import QoSCompatibility, qos_check_compatible

from slosh_base.files.nanoseconds import SECOND
from slosh_msgs.msg import FreeSurface, LimitEvent
from slosh_msgs_py import images, qos, stamps
from slosh_msgs_py.conversions import filled
from slosh_msgs_py.errors import SloshMessageError


def test_fields_are_filled_by_name_and_numbers_not_given_are_unknown():
    message = filled(
        LimitEvent,
        stamp_ns=1_500_000_000,
        frame_id="cup",
        id=3,
        kind=1,
        limit=0.02,
        peak_stamp_ns=2_000_000_001,
        duration_ns=5,
        description="too high",
    )
    assert stamps.to_nanoseconds(message.header.stamp) == 1_500_000_000
    assert message.header.frame_id == "cup"
    assert (message.id, message.kind, message.limit) == (3, 1, 0.02)
    assert stamps.to_nanoseconds(message.peak_stamp) == 2_000_000_001
    assert stamps.to_nanoseconds(message.duration) == 5
    assert message.description == "too high"
    assert math.isnan(message.peak)


@pytest.mark.parametrize("number", [1e39, -1e39, float(np.finfo(np.float32).max)])
@pytest.mark.parametrize("field", ["peak_u", "profile_height"])
def test_a_number_too_great_for_its_field_is_refused_not_sent_as_infinity(field, number):
    content = number if field == "peak_u" else np.array([0.0, number])
    with pytest.raises(SloshMessageError, match=rf"FreeSurface\.{field} = .*range of float32"):
        filled(FreeSurface, **{field: content})


def test_a_value_that_does_not_fit_is_named():
    with pytest.raises(SloshMessageError, match=r"FreeSurface\.peak_side = -1"):
        filled(FreeSurface, peak_side=-1)
    with pytest.raises(SloshMessageError, match=r"FreeSurface\.msh = 'high'"):
        filled(FreeSurface, msh="high")
    with pytest.raises(SloshMessageError, match="FreeSurface has no field height"):
        filled(FreeSurface, height=5)


@given(st.integers(0, stamps.MAXIMUM))
def test_times_keep_every_nanosecond(nanoseconds):
    assert stamps.to_nanoseconds(stamps.to_time(nanoseconds)) == nanoseconds


@pytest.mark.parametrize("nanoseconds", [-1, stamps.MAXIMUM + SECOND])
def test_impossible_times_are_refused(nanoseconds):
    with pytest.raises(SloshMessageError, match="stamp"):
        stamps.to_time(nanoseconds)


@pytest.mark.parametrize(
    ("encoding", "shape"), [("mono8", (4, 6)), ("bgr8", (4, 6, 3)), ("rgb8", (2, 5, 3))]
)
def test_images_keep_every_pixel(encoding, shape):
    pixels = np.arange(math.prod(shape), dtype=np.uint8).reshape(shape)
    message = images.image_message(pixels, encoding, 5, "camera_optical")
    assert np.array_equal(images.image_bytes(message), pixels.ravel())
    assert (message.height, message.width, message.step) == (*shape[:2], math.prod(shape[1:]))


@pytest.mark.parametrize(
    ("pixels", "encoding"),
    [
        (np.zeros((2, 2), np.uint8), "bgr8"),
        (np.zeros((2, 2, 3), np.uint8), "mono8"),
        (np.zeros((2, 2), np.float32), "mono8"),
        (np.zeros((2, 2), np.uint8), "16UC1"),
        (np.zeros(4, np.uint8), "mono8"),
    ],
)
def test_pixels_that_do_not_fit_the_encoding_are_refused(pixels, encoding):
    with pytest.raises(SloshMessageError):
        images.image_message(pixels, encoding, 0, "c")


@pytest.mark.parametrize(
    ("out", "into"),
    [
        (qos.STREAM_OUT, qos.STREAM_IN),
        (qos.IMAGE_OUT, qos.IMAGE_IN),
        (qos.EVENT, qos.EVENT),
        (qos.STREAM_OUT, qos.IMAGE_IN),
    ],
)
def test_readers_match_their_writers(out, into):
    assert qos_check_compatible(out, into)[0] == QoSCompatibility.OK
