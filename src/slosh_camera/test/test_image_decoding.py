"""Tests which images in messages and files are decoded, shared in memory or rejected."""

import cv2
import numpy as np
import pytest

from slosh_camera.errors import SloshCameraError
from slosh_camera.images.colour import to_gray
from slosh_camera.images.decoding import decode_compressed, read_image, to_image

GRAY = np.random.default_rng(0).integers(0, 256, (12, 20), dtype=np.uint8)
COLOUR = np.random.default_rng(2).integers(0, 256, (12, 20, 3), dtype=np.uint8)
SMOOTH = np.tile(np.linspace(0, 255, 64).astype(np.uint8), (48, 1))
WIDE = np.dstack([GRAY ^ 85, GRAY])  # 16 bits, little end first
# What a message holds, and the pixels that it stands for.
STORED = {
    "mono8": (GRAY[..., None], GRAY),
    "8UC1": (GRAY[..., None], GRAY),
    "bgr8": (COLOUR, COLOUR),
    "8UC3": (COLOUR, COLOUR),
    "rgb8": (COLOUR, COLOUR[..., ::-1]),
    "bgra8": (np.dstack([COLOUR, GRAY]), COLOUR),
    "rgba8": (np.dstack([COLOUR, GRAY]), COLOUR[..., ::-1]),
    "8UC4": (np.dstack([COLOUR, GRAY]), COLOUR),
}


@pytest.mark.parametrize("padding", [0, 1, 7])
@pytest.mark.parametrize("encoding", STORED)
def test_pixels_are_seen_where_the_message_has_them(encoding, padding):
    stored, wanted = STORED[encoding]
    rows = stored.reshape(12, -1)
    data = bytearray(np.pad(rows, ((0, 0), (0, padding)), constant_values=99).tobytes())
    image = to_image(encoding, 12, 20, rows.shape[1] + padding, data)
    np.testing.assert_array_equal(image, wanted)
    before = image.copy()
    for place in range(len(data)):
        data[place] ^= 255
    np.testing.assert_array_equal(image, before ^ 255)  # the very bytes, not a copy
    with pytest.raises(ValueError, match="read-only"):
        image[0, 0] = 1


def test_the_upper_byte_counts_whatever_the_byte_order():
    data = np.ascontiguousarray(WIDE[..., ::-1]).tobytes()
    np.testing.assert_array_equal(to_image("mono16", 12, 20, 40, data, big_endian=True), GRAY)
    np.testing.assert_array_equal(to_image("mono16", 12, 20, 40, WIDE.tobytes()), GRAY)


@pytest.mark.parametrize("bits", [8, 10, 12, 14, 16])
@pytest.mark.parametrize(
    "encoding",
    ["mono16", "16UC1", "Mono12", "bgr16", "16UC3", "rgb16", "bgra16", "16UC4", "rgba16"],
)
def test_of_16_bits_those_count_that_the_camera_fills(encoding, bits):
    wanted = GRAY if encoding in ("mono16", "16UC1", "Mono12") else COLOUR
    stored = wanted.astype("<u2") << (bits - 8)
    if encoding.startswith("rgb"):
        stored = stored[..., ::-1]
    if encoding in ("bgra16", "16UC4", "rgba16"):
        stored = np.dstack([stored, stored[..., 0]])
    stored = np.ascontiguousarray(stored)
    image = to_image(encoding, 12, 20, stored.nbytes // 12, stored.tobytes())
    np.testing.assert_array_equal(image, wanted)


YUV_COLOUR = np.array([30, 90, 200])  # blue, green, red
YUV = {
    # One brightness for each pixel, the colour differences where the encoding has them.
    "yuv422": "uyvy", "uyvy": "uyvy", "yuv422_yuy2": "yuyv", "yuyv": "yuyv",
    "nv12": "uv", "nv21": "vu", "i420": "uv", "yuv420": "uv", "yv12": "vu", "NV12": "uv",
}  # fmt: skip


@pytest.mark.parametrize("padding", [0, 6])
@pytest.mark.parametrize("encoding", YUV)
def test_brightness_and_colour_differences_become_colours(encoding, padding):
    blue, green, red = YUV_COLOUR / 255.0
    # ITU-R BT.601, limited range.
    brightness = 16.0 + 65.481 * red + 128.553 * green + 24.966 * blue
    parts = {
        "y": round(brightness),
        "u": round(128.0 - 37.797 * red - 74.203 * green + 112.0 * blue),
        "v": round(128.0 + 112.0 * red - 93.786 * green - 18.214 * blue),
    }
    order = YUV[encoding]
    if encoding in ("i420", "yuv420", "yv12"):
        padding = 0
        rows = [[parts["y"]] * 20] * 12 + [[parts[name]] * 20 for name in order for _ in range(3)]
    elif encoding.lower().startswith("nv"):
        rows = [[parts["y"]] * 20] * 12 + [[parts[name] for name in order] * 10] * 6
    else:
        rows = [[parts[name] for name in order] * 10] * 12
    stored = np.pad(np.array(rows, np.uint8), ((0, 0), (0, padding)))
    image = to_image(encoding, 12, 20, stored.shape[1], stored.tobytes())
    assert image.shape == (12, 20, 3)
    assert np.abs(image.astype(int) - YUV_COLOUR).max() <= 2


def test_distances_are_no_picture():
    with pytest.raises(SloshCameraError, match="holds distances"):
        to_image("32FC1", 12, 20, 80, bytes(960))
    with pytest.raises(SloshCameraError, match="which value is white"):
        to_image("32FC3", 12, 20, 240, bytes(2880))
    with pytest.raises(SloshCameraError, match="holds distances"):
        decode_compressed("16UC1; compressedDepth png", b"0" * 40)


@pytest.mark.parametrize(
    ("other", "name"),
    [("Mono8", "mono8"), ("BGR8", "bgr8"), ("RGB8", "rgb8"), ("8uc3", "8UC3"),
     ("BayerRG8", "bayer_rggb8"), ("BayerGB12", "bayer_gbrg16"), ("YUYV", "yuyv")],
)  # fmt: skip
def test_other_spellings_of_an_encoding(other, name):
    step = 60 if "8" in name and name.lower() in ("bgr8", "rgb8", "8uc3") else 20
    step = 40 if name in ("bayer_gbrg16", "yuyv") else step
    data = np.random.default_rng(1).integers(0, 256, 12 * step, dtype=np.uint8).tobytes()
    np.testing.assert_array_equal(
        to_image(other, 12, 20, step, data), to_image(name, 12, 20, step, data)
    )


@pytest.mark.parametrize("pattern", ["rggb", "bggr", "gbrg", "grbg"])
@pytest.mark.parametrize("bits", [8, 16])
def test_a_bayer_pattern_becomes_colour(pattern, bits):
    colour = {"r": 200, "g": 120, "b": 40}
    cell = np.array([[colour[pattern[0]], colour[pattern[1]]],
                     [colour[pattern[2]], colour[pattern[3]]]], np.uint8)  # fmt: skip
    padded = np.pad(np.tile(cell, (6, 10)), ((0, 0), (0, 3)))
    if bits == 16:
        padded = padded.astype("<u2") << 4  # a camera of 12 bits
    stored = padded.tobytes()
    image = to_image(f"bayer_{pattern}{bits}", 12, 20, len(stored) // 12, stored)
    assert image.shape == (12, 20, 3)
    assert np.all(image[2:-2, 2:-2] == [40, 120, 200])


@pytest.mark.parametrize("order", [1, -1])
def test_colours_are_weighted_by_their_place(order):
    stored = np.zeros((4, 5, 3), np.uint8)
    stored[..., 2 if order == 1 else 0] = 200
    gray = to_gray(stored[..., ::order])
    assert gray.shape == (4, 5)
    assert np.all(gray == 60)  # 0.299 * 200
    assert to_gray(gray) is gray


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("yuv422", 12, 20, 20, GRAY.tobytes()), "step"),
        (("yuv422", 12, 19, 40, bytes(480)), "even"),
        (("nv12", 12, 20, 20, GRAY.tobytes()), "18 rows"),
        (("yuv420_planar", 12, 20, 20, GRAY.tobytes()), "not supported"),
        (("", 12, 20, 20, GRAY.tobytes()), "driver must fill it"),
        (("i420", 12, 20, 24, bytes(18 * 24)), "padded planes"),
        (("i420", 12, 19, 19, bytes(18 * 19)), "even"),
        (("mono8", 0, 0, 0, b""), "empty"),
        (("mono8", 12, 0, 0, b""), "empty"),
        (("mono8", 12, 20, 19, GRAY.tobytes()), "step"),
        (("bgr8", 4, 20, 20, GRAY.tobytes()), "step"),
        (("mono16", 12, 20, 39, GRAY.tobytes()), "step"),
        (("mono8", 12, 20, 20, GRAY.tobytes()[:-1]), "bytes"),
        (("mono8", 12, 20, 20, GRAY.tobytes() + b"0"), "bytes"),
        (("mono8", 12, 20, 20, b""), "bytes"),
        (("mono8", 2**32 - 1, 20, 20, GRAY.tobytes()), "bytes"),
        (("mono8", 12, 20, 20, "text"), "buffer"),
        (("mono8", 12, 20, 20, None), "buffer"),
        (("bayer_rggb8", 1, 1, 1, b"0"), "too few"),
    ],
)
def test_images_that_cannot_be(arguments, word):
    with pytest.raises(SloshCameraError, match=word) as caught:
        to_image(*arguments)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("suffix", "name", "tolerance"),
    [
        (".jpg", "jpeg", 6),
        (".jpg", "bgr8; jpeg compressed bgr8", 6),
        (".png", "png", 0),
        (".png", "mono8; png compressed", 0),
        (".webp", "webp", 6),
        (".webp", "bgr8; webp compressed bgr8", 6),
    ],
)
def test_compressed_images(suffix, name, tolerance):
    data = cv2.imencode(suffix, SMOOTH)[1].tobytes()
    gray = to_gray(decode_compressed(name, data))
    assert np.max(np.abs(gray.astype(int) - SMOOTH)) <= tolerance


@pytest.mark.parametrize(
    ("stored", "wanted"),
    [
        (COLOUR, COLOUR),
        (GRAY, GRAY),
        (np.dstack([COLOUR, GRAY]), COLOUR),
        (GRAY.astype(np.uint16) * 256 + 85, GRAY),
        (COLOUR.astype(np.uint16) * 256 + 85, COLOUR),
    ],
    ids=["colour", "grey", "transparent", "grey, 16 bits", "colour, 16 bits"],
)
def test_colour_stays_and_all_else_is_left_out(stored, wanted):
    data = cv2.imencode(".png", stored)[1].tobytes()
    np.testing.assert_array_equal(decode_compressed("png", data), wanted)


@pytest.mark.parametrize("content", [None, b"", b"no image"])
def test_a_file_that_is_no_image_is_named(tmp_path, content):
    path = tmp_path / "broken.png"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(SloshCameraError, match=r"broken\.png: ") as caught:
        read_image(path)
    assert "\n" not in str(caught.value)


def test_other_formats_are_refused():
    with pytest.raises(SloshCameraError, match="rvl"):
        decode_compressed("16UC1; rvl", b"abc")


WEBP = cv2.imencode(".webp", np.dstack([SMOOTH] * 3))[1].tobytes()
LOSSLESS = cv2.imencode(".webp", np.dstack([SMOOTH] * 4), [cv2.IMWRITE_WEBP_QUALITY, 101])[1]


@pytest.mark.parametrize("data", [WEBP, LOSSLESS.tobytes()], ids=["lossy", "lossless"])
def test_a_webp_file_is_read_whole_or_not_at_all(data):
    assert decode_compressed("webp", data).shape == (48, 64, 3)
    for length in range(1, len(data), 7):
        with pytest.raises(SloshCameraError, match=r"not a complete|could not be decoded"):
            decode_compressed("webp", data[:length])


def test_a_webp_file_of_too_many_pixels_is_not_decoded():
    wide = b"RIFF" + (22).to_bytes(4, "little") + b"WEBPVP8X" + (10).to_bytes(4, "little")
    with pytest.raises(SloshCameraError, match="16384 x 16384 pixels, more than"):
        decode_compressed("webp", wide + bytes(4) + b"\xff\x3f\0" * 2)
    film = wide + b"\x02" + bytes(3) + b"\x3f\0\0" * 2
    with pytest.raises(SloshCameraError, match="holds a film"):
        decode_compressed("webp", film)
