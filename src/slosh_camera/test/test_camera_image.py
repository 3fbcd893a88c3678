import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slosh_camera.errors import SloshCameraError
from slosh_camera.image import decode_compressed, to_gray

GRAY = np.random.default_rng(0).integers(0, 256, (12, 20), dtype=np.uint8)
SMOOTH = np.tile(np.linspace(0, 255, 64).astype(np.uint8), (48, 1))


def test_mono8_is_read_without_copying():
    data = bytearray(GRAY.tobytes())
    image = to_gray("mono8", 12, 20, 20, data)
    data[0] ^= 255
    assert image[0, 0] == data[0]
    assert image.shape == (12, 20)
    with pytest.raises(ValueError, match="read-only"):
        image[0, 0] = 1


@pytest.mark.parametrize("padding", [1, 7])
def test_padding_of_the_rows_is_left_out(padding):
    padded = np.pad(GRAY, ((0, 0), (0, padding)), constant_values=99)
    np.testing.assert_array_equal(to_gray("mono8", 12, 20, 20 + padding, padded.tobytes()), GRAY)


@pytest.mark.parametrize(("encoding", "red"), [("bgr8", 2), ("rgb8", 0)])
def test_colours_are_weighted_by_their_place(encoding, red):
    colour = np.zeros((4, 5, 3), np.uint8)
    colour[..., red] = 200
    padded = np.pad(colour.reshape(4, 15), ((0, 0), (0, 3)))
    gray = to_gray(encoding, 4, 5, 18, padded.tobytes())
    assert gray.shape == (4, 5)
    assert np.all(gray == 60)  # 0.299 * 200


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("bayer_rggb8", 12, 20, 20, GRAY.tobytes()), "bayer_rggb8"),
        (("", 12, 20, 20, GRAY.tobytes()), "encoding"),
        (("mono8", 0, 0, 0, b""), "empty"),
        (("mono8", 12, 0, 0, b""), "empty"),
        (("mono8", 12, 20, 19, GRAY.tobytes()), "step"),
        (("bgr8", 4, 20, 20, GRAY.tobytes()), "step"),
        (("mono8", 12, 20, 20, GRAY.tobytes()[:-1]), "bytes"),
        (("mono8", 12, 20, 20, GRAY.tobytes() + b"0"), "bytes"),
        (("mono8", 12, 20, 20, b""), "bytes"),
        (("mono8", 12, 20, 20, "text"), "buffer"),
        (("mono8", 12, 20, 20, None), "buffer"),
    ],
)
def test_images_that_cannot_be(arguments, word):
    with pytest.raises(SloshCameraError, match=word) as caught:
        to_gray(*arguments)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("suffix", "name", "tolerance"),
    [
        (".jpg", "jpeg", 6),
        (".jpg", "bgr8; jpeg compressed bgr8", 6),
        (".png", "png", 0),
        (".png", "mono8; png compressed", 0),
    ],
)
def test_compressed_images(suffix, name, tolerance):
    data = cv2.imencode(suffix, SMOOTH)[1].tobytes()
    gray = decode_compressed(name, data)
    assert np.max(np.abs(gray.astype(int) - SMOOTH)) <= tolerance


def test_compressed_colour_becomes_grey():
    data = cv2.imencode(".png", np.dstack([SMOOTH] * 3))[1].tobytes()
    np.testing.assert_array_equal(decode_compressed("png", data), SMOOTH)


@pytest.mark.parametrize("suffix", [".jpg", ".png"])
@given(fraction=st.floats(0.0, 0.99))
def test_a_cut_file_is_refused(suffix, fraction):
    data = cv2.imencode(suffix, SMOOTH)[1].tobytes()
    with pytest.raises(SloshCameraError):
        decode_compressed("jpeg", data[: int(fraction * len(data))])


@pytest.mark.parametrize("missing", [3, 100, 1000])
def test_a_jpeg_without_its_end_is_refused(missing):
    # OpenCV alone would fill the missing part with grey.
    noise = np.random.default_rng(1).integers(0, 256, (120, 160), dtype=np.uint8)
    data = cv2.imencode(".jpg", noise)[1].tobytes()
    with pytest.raises(SloshCameraError, match="complete"):
        decode_compressed("jpeg", data[:-missing])


@given(st.binary(max_size=200))
def test_noise_is_refused(data):
    with pytest.raises(SloshCameraError):
        decode_compressed("jpeg", data)


def test_other_formats_are_refused():
    with pytest.raises(SloshCameraError, match="rvl"):
        decode_compressed("16UC1; rvl", b"abc")


def test_a_damaged_header_is_refused():
    data = bytearray(cv2.imencode(".png", SMOOTH)[1].tobytes())
    data[16:24] = b"\x00" * 8
    with pytest.raises(SloshCameraError):
        decode_compressed("png", bytes(data))
