"""The size that a file claims is read from its head, in every format and on every way in."""

import struct

import cv2
import numpy as np
import pytest

from slosh_camera.errors import SloshCameraError
from slosh_camera.images import image_size
from slosh_camera.images.decoding import decode_compressed, read_image

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
    monkeypatch.setattr(image_size, "MOST_PIXELS", pixels)
    assert read_image(path).shape == shape
    monkeypatch.setattr(image_size, "MOST_PIXELS", pixels - 1)
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
