"""Messages to values and back; times; images; QoS."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rclpy.qos import QoSCompatibility, qos_check_compatible

from slosh_base.files.nanoseconds import SECOND
from slosh_msgs import msg as messages
from slosh_msgs_py import conversions, images, qos, stamps, values
from slosh_msgs_py.errors import SloshMessageError

KINDS = [
    values.FreeSurface,
    values.ModelEstimate,
    values.SloshEstimate,
    values.ExpectedReading,
    values.SloshComparison,
    values.MotionPrediction,
    values.PredictionOutcome,
    values.LimitEvent,
]
FLOAT32 = 3.402823466e38  # what ROS's own check admits; the greatest of all is a little more
floats = st.floats(width=32).filter(lambda number: not FLOAT32 < abs(number) < math.inf)
arrays = st.lists(floats, max_size=5).map(lambda numbers: np.array(numbers, dtype=np.float64))


def field_strategy(kind, item):
    default = getattr(kind(0), item.name) if kind is not values.ModelEstimate else None
    if kind is values.ModelEstimate:
        default = getattr(kind(), item.name)
    if item.name.endswith("_ns"):
        return st.integers(0, stamps.MAXIMUM)
    if isinstance(default, bool):
        return st.booleans()
    if isinstance(default, float):
        return floats
    if isinstance(default, int):
        return st.integers(0, 200)
    if isinstance(default, str):
        return st.text("abc äµ", max_size=8)
    if isinstance(default, values.ModelEstimate):
        return value_strategy(values.ModelEstimate)
    if item.name == "acceleration":
        return st.lists(floats, min_size=3, max_size=3).map(np.array)
    return arrays


def value_strategy(kind):
    return st.builds(
        kind, **{item.name: field_strategy(kind, item) for item in dataclasses.fields(kind)}
    )


def same(one, other):
    if dataclasses.is_dataclass(one):
        return all(
            same(getattr(one, item.name), getattr(other, item.name))
            for item in dataclasses.fields(one)
        )
    if isinstance(one, np.ndarray | float):
        return np.array_equal(one, other, equal_nan=True)
    return one == other


@pytest.mark.parametrize("kind", KINDS)
def test_every_field_of_the_message_is_in_the_value(kind):
    fields = set(getattr(messages, kind.__name__).get_fields_and_field_types())
    named = {item.name.removesuffix("_ns") for item in dataclasses.fields(kind)}
    if "header" in fields:
        fields = fields - {"header"} | {"stamp", "frame_id"}
    assert named == fields


@given(st.one_of([value_strategy(kind) for kind in KINDS]))
def test_round_trip(value):
    assert same(conversions.from_message(conversions.to_message(value)), value)


@pytest.mark.parametrize("number", [np.float32(1.5), np.int64(2), 3])
def test_numbers_of_other_types_arrive_as_they_are(number):
    """rclpy would send an int or a NumPy float in a float64 field as garbage."""
    message = conversions.to_message(values.FreeSurface(0, msh=number))
    assert type(message.msh) is float
    assert message.msh == number


@pytest.mark.parametrize("number", [1e39, -1e39, float(np.finfo(np.float32).max)])
@pytest.mark.parametrize("field", ["peak_u", "profile_height"])
def test_a_number_too_great_for_its_field_is_refused_not_sent_as_infinity(field, number):
    content = number if field == "peak_u" else np.array([0.0, number])
    with pytest.raises(SloshMessageError, match=rf"FreeSurface\.{field} = .*range of float32"):
        conversions.to_message(values.FreeSurface(0, **{field: content}))


def test_a_value_that_does_not_fit_is_named():
    with pytest.raises(SloshMessageError, match=r"FreeSurface\.peak_side = -1"):
        conversions.to_message(values.FreeSurface(0, peak_side=-1))
    with pytest.raises(SloshMessageError, match=r"FreeSurface\.msh = 'high'"):
        conversions.to_message(values.FreeSurface(0, msh="high"))
    with pytest.raises(SloshMessageError, match="there is no message for int"):
        conversions.to_message(5)


def test_values_arrays_cannot_be_changed():
    message = messages.FreeSurface(profile_height=[1.0, 2.0])
    value = conversions.from_message(message)
    with pytest.raises(ValueError, match="read-only"):
        value.profile_height[0] = 5.0


@given(st.integers(0, stamps.MAXIMUM))
def test_times_keep_every_nanosecond(nanoseconds):
    assert stamps.to_nanoseconds(stamps.to_time(nanoseconds)) == nanoseconds


@given(st.integers(-stamps.MAXIMUM, stamps.MAXIMUM))
def test_durations_keep_every_nanosecond(nanoseconds):
    assert stamps.to_nanoseconds(stamps.to_duration(nanoseconds)) == nanoseconds


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


def test_reading_an_image_shares_its_memory():
    message = images.image_message(np.zeros((2, 2), np.uint8), "mono8", 0, "c")
    view = images.image_bytes(message)
    message.data[0] = 7
    assert view[0] == 7


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


def test_drivers_that_only_offer_best_effort_are_heard():
    from rclpy.qos import qos_profile_sensor_data

    for profile in (qos.STREAM_IN, qos.IMAGE_IN):
        compatibility, _ = qos_check_compatible(qos_profile_sensor_data, profile)
        assert compatibility != QoSCompatibility.ERROR
