import numpy as np

from slosh_camera.detector import FreeSurfaceDetector
from slosh_camera.drawing import draw_measurement
from slosh_camera.measurement import Flag, bad_image


def test_line_and_peak_are_drawn_where_they_are(make_scene):
    scene = make_scene()
    calibration = scene.calibration()
    image = scene.draw(0.02, -1.6)
    before = image.copy()
    result = FreeSurfaceDetector(calibration).update(0, image)
    picture = draw_measurement(image, calibration, result)
    np.testing.assert_array_equal(image, before)
    assert picture.shape == (480, 640, 3)
    u, v = (round(value) for value in result.edge_pixels[60])
    blue, green, red = (int(value) for value in picture[v, u])
    assert green > blue + 50
    assert green > red + 50
    u, v = (round(value) for value in result.peak_pixel)
    assert np.any(picture[v - 9 : v - 4, u - 2 : u + 3, 2].astype(int) > 200)


def test_flags_are_written(make_scene):
    scene = make_scene()
    calibration = scene.calibration()
    dark = np.zeros((480, 640, 3), np.uint8)
    empty = draw_measurement(dark, calibration, bad_image(0))
    result = FreeSurfaceDetector(calibration).update(0, dark[..., 0])
    assert Flag.TOO_DARK in result.flags
    flagged = draw_measurement(dark, calibration, result)
    assert np.any(empty[:30, :200] == 255)
    assert np.any(empty[:30, :200] != flagged[:30, :200])
    assert not np.any(dark)
