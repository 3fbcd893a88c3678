"""Tests that incomplete or damaged image files are rejected, and complete ones are not."""

import struct

import cv2
import numpy as np
import pytest

from slosh_camera.errors import SloshCameraError
from slosh_camera.images import headers
from slosh_camera.images.decoding import decode_compressed, png_damage, read_image
from slosh_camera.images.jpeg_file import jpeg_damage

END = b"\xff\xd9"
KINDS = ("plain", "grey", "optimised", "fine", "coarse", "every third unit", "full colour")
OPTIONS = {
    "optimised": (cv2.IMWRITE_JPEG_OPTIMIZE, 1),
    "fine": (cv2.IMWRITE_JPEG_QUALITY, 100),
    "coarse": (cv2.IMWRITE_JPEG_QUALITY, 10),
    "every third unit": (cv2.IMWRITE_JPEG_RST_INTERVAL, 3),
    "full colour": (cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444),
}


def picture(seed=0):
    """Draws a simple cup in front of a wall, with shading and noise."""
    image = np.full((150, 203, 3), 180, np.uint8)
    cv2.rectangle(image, (60, 60), (140, 130), (90, 60, 40), -1)
    image[:20] = np.linspace(20, 240, 203, dtype=np.uint8)[None, :, None]
    noise = np.random.default_rng(seed).normal(0.0, 6.0, image.shape)
    return np.clip(image + noise, 0, 255).astype(np.uint8)


def jpeg_of(kind="plain", seed=0):
    image = picture(seed)
    image = image[..., 0] if kind == "grey" else image
    return cv2.imencode(".jpg", image, OPTIONS.get(kind, ()))[1].tobytes()


def damage_of(data):
    return jpeg_damage(np.frombuffer(data, np.uint8))


def scan_start(data):
    return data.index(b"\xff\xda") + 14


@pytest.mark.parametrize("kind", KINDS)
def test_a_whole_jpeg_is_decoded(kind):
    data = jpeg_of(kind)
    expected = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_ANYCOLOR)
    np.testing.assert_array_equal(decode_compressed("jpeg", data), expected)


def test_motion_jpeg_leaves_its_code_tables_out():
    data = jpeg_of()
    first = data.index(b"\xff\xc4")
    assert damage_of(data[:first] + data[data.index(b"\xff\xda") :]) == ""


@pytest.mark.parametrize("percent", range(0, 95, 7))
@pytest.mark.parametrize("kind", KINDS)
def test_a_cut_jpeg_is_refused_whatever_closes_it(kind, percent):
    data = jpeg_of(kind)
    part = data[: max(2, len(data) * percent // 100)]
    for closed in (part, part + END, part.ljust(len(data), b"\0") + END, part + bytes(500)):
        with pytest.raises(SloshCameraError, match=r"not a complete image file: .") as caught:
            decode_compressed("jpeg", closed)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("kind", KINDS)
def test_a_jpeg_without_a_part_is_refused(kind):
    data, random = jpeg_of(kind), np.random.default_rng(5)
    refused = 0
    for first in random.integers(scan_start(data), len(data) - 600, 40):
        refused += bool(damage_of(data[:first] + data[first + int(random.integers(64, 512)) :]))
    assert refused >= 32


def test_most_wrong_bits_are_seen():
    """Undetected bit errors are in coefficient values whose codes remain valid."""
    data, random = jpeg_of("grey"), np.random.default_rng(7)
    noticed = 0
    for place in random.integers(scan_start(data), len(data) - 2, 300):
        broken = bytearray(data)
        broken[place] ^= 1 << random.integers(8)
        noticed += bool(damage_of(bytes(broken)))
    assert noticed > 120


@pytest.mark.parametrize("place", range(2, 600, 13))
def test_a_damaged_header_ends_in_an_image_or_a_refusal(place):
    for value in (0, 1, 0xC4, 0xFF):
        data = bytearray(jpeg_of())
        data[place] = value
        try:
            decode_compressed("jpeg", bytes(data))
        except SloshCameraError as error:
            assert "\n" not in str(error)


def test_a_jpeg_that_cannot_be_checked_is_refused_with_a_way_out():
    option = (cv2.IMWRITE_JPEG_PROGRESSIVE, 1)
    data = cv2.imencode(".jpg", picture(), option)[1].tobytes()
    with pytest.raises(SloshCameraError, match=r"progressive.*baseline or PNG"):
        decode_compressed("jpeg", data)


def test_every_wrong_byte_of_a_png_is_seen():
    data = cv2.imencode(".png", picture()[:20, :20])[1].tobytes()
    assert png_damage(np.frombuffer(data + b"behind", np.uint8)) == ""
    for place in range(4, len(data)):
        broken = bytearray(data)
        broken[place] ^= 0x10
        assert png_damage(np.frombuffer(bytes(broken), np.uint8))
    for end in range(4, len(data)):
        assert png_damage(np.frombuffer(data[:end], np.uint8))


def test_a_damaged_png_is_refused_and_named():
    data = bytearray(cv2.imencode(".png", picture())[1].tobytes())
    data[len(data) // 2] ^= 4
    with pytest.raises(SloshCameraError, match="complete image file: its chunk 'IDAT' at byte"):
        decode_compressed("png", bytes(data))


# The size that a file claims is read from its head, in every format and on every way in.


ENDINGS = (".png", ".jpg", ".bmp", ".tif")


def file_of(ending, shape, options=()):
    noise = np.random.default_rng(1).integers(0, 256, shape).astype(np.uint8)
    return cv2.imencode(ending, noise, options)[1].tobytes()


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("shape", [(30, 50), (31, 50, 3)])
def test_an_image_is_read_up_to_the_bound(monkeypatch, tmp_path, ending, shape):
    path = tmp_path / f"a{ending}"
    path.write_bytes(file_of(ending, shape))
    pixels = shape[0] * shape[1]
    monkeypatch.setattr(headers, "MOST_PIXELS", pixels)
    assert read_image(path).shape == shape
    monkeypatch.setattr(headers, "MOST_PIXELS", pixels - 1)
    with pytest.raises(SloshCameraError, match=f"{path.name}: image: claims 50 x {shape[0]} pix"):
        read_image(path)


def test_a_jpeg_whose_claim_was_changed_is_refused_before_it_is_decoded(monkeypatch):
    data = bytearray(file_of(".jpg", (48, 64, 3)))
    frame = data.index(b"\xff\xc0")
    data[frame + 5 : frame + 9] = struct.pack(">HH", 30_000, 40_000)
    monkeypatch.setattr(cv2, "imdecode", None)
    with pytest.raises(SloshCameraError, match="claims 40000 x 30000 pixels"):
        decode_compressed("jpeg", bytes(data))


def test_a_jpeg_of_very_many_scans_is_refused():
    data = file_of(".jpg", (48, 64, 3), [cv2.IMWRITE_JPEG_PROGRESSIVE, 1])
    many = data[:-2] + b"\xff\xda" * 200_000 + data[-2:]
    with pytest.raises(SloshCameraError, match="scans"):
        decode_compressed("jpeg", many)


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_head_that_is_cut_is_no_image(tmp_path, ending):
    path = tmp_path / f"a{ending}"
    for length in range(1, 40):
        path.write_bytes(file_of(ending, (30, 50))[:length])
        with pytest.raises(SloshCameraError, match="image: "):
            read_image(path)
