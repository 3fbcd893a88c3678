import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from slosh_camera.cylinder.wall_geometry import build_scan_grid
from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.camera import PinholeCamera, look_at
from slosh_camera.optics.cup import Cup, CupView, Wall
from slosh_camera.settings import RegionOfInterest

WIDTH, HEIGHT = 640, 480


def view(*, aim=0.0, above=0.08, distance=0.45, focal=1000.0, distortion=(0.0,) * 5, rim=0.13):
    """Returns the view of a cup with a thick glass wall, from the side and slightly above."""
    camera = PinholeCamera(WIDTH, HEIGHT, focal, focal, 320.0, 240.0, distortion)
    pose = look_at((0.3 * distance, -distance, above), (0.0, 0.0, aim))
    return CupView(camera, pose, Cup(0.05, 0.07, 0.004, rim, 1.49))


VIEWS = {
    "pitched": view(),
    "level": view(above=0.0),
    "steep": view(above=0.25),
    "distorted": view(distortion=(-0.2, 0.05, 0.002, -0.001, 0.0)),
    "near": view(distance=0.25, focal=500.0),
    "magnified": view(focal=1900.0, rim=None),
}


@pytest.fixture(params=VIEWS, scope="module")
def seen(request):
    chosen = VIEWS[request.param]
    return chosen, build_scan_grid(chosen, None)


# Where the samples are.


def test_points_of_the_front_wall_are_seen_at_the_samples(seen):
    chosen, grid = seen
    azimuth = np.arctan2(grid.front[..., 1], grid.front[..., 0])
    rows = np.linspace(0, grid.shape[0] - 1, 12).astype(int)
    rim = np.inf if chosen.cup.rim_level is None else chosen.cup.rim_level
    known = grid.front[rows][..., 2] < rim  # above it there is no front wall
    assert np.mean(known) > 0.6
    again = chosen.project_wall(azimuth[rows][known], grid.front[rows][known][:, 2], Wall.FRONT)
    np.testing.assert_allclose(again, grid.pixels[rows][known], atol=1e-4)
    np.testing.assert_allclose(np.hypot(*grid.front[rows][known][:, :2].T), 0.05, atol=1e-9)


def test_points_of_the_rear_wall_are_seen_at_the_samples(seen):
    chosen, grid = seen
    rows = np.linspace(0, grid.shape[0] - 1, 12).astype(int)
    rear = grid.rear[rows]
    known = np.isfinite(rear).all(axis=2)
    azimuth = np.arctan2(rear[known][:, 1], rear[known][:, 0])
    again = chosen.project_wall(azimuth, rear[known][:, 2], Wall.REAR)
    error = np.max(np.abs(again - grid.pixels[rows][known]), axis=1)
    # Next to the front wall's rim a place is seen twice: over the rim and through the wall.
    assert np.mean(error < 1e-3) > 0.93
    assert np.max(error) < 4.0
    assert np.mean(known) > 0.7
    away = np.cos(azimuth - chosen.camera_azimuth)
    assert np.all(away < 0.75)


# What is inside.


# The wall unrolled.


def textured(channels=None):
    rng = np.random.default_rng(1)
    shape = (HEIGHT, WIDTH) if channels is None else (HEIGHT, WIDTH, channels)
    return rng.integers(0, 256, shape, dtype=np.uint8)


def sampled(image, grid):
    """Samples an image bilinearly with another library."""
    at = grid.pixels[..., 1], grid.pixels[..., 0]
    return map_coordinates(image.astype(np.float64), at, order=1, mode="constant")


@pytest.mark.parametrize("region", [None, RegionOfInterest(200, 120, 200, 300)])
@pytest.mark.parametrize("name", VIEWS)
def test_unrolled_is_the_image_at_the_samples(name, region):
    grid = build_scan_grid(VIEWS[name], region)
    image = textured()
    unrolled = grid.unroll(image)
    assert unrolled.dtype == np.uint8
    assert unrolled.shape == grid.shape
    error = np.abs(unrolled - sampled(image, grid))[grid.inside]
    # OpenCV rounds places to a 32nd of a pixel; a wrong pixel would be off by 85 on average.
    assert np.max(error) < 255.0 / 32.0 + 1.0
    assert np.mean(error) < 2.0


@pytest.mark.parametrize("channels", [None, 3])
def test_views_of_any_strides_are_unrolled_alike(channels):
    grid = build_scan_grid(VIEWS["pitched"], None)
    image = textured(channels)
    expected = grid.unroll(image)
    padded = np.zeros((HEIGHT + 3, WIDTH + 9, *image.shape[2:]), np.uint8)
    padded[2:-1, 4:-5] = image
    upside_down = image[::-1].copy()
    mirrored = image[:, ::-1].copy()
    fat = np.repeat(image, 2, axis=1)
    for same in (
        padded[2:-1, 4:-5], upside_down[::-1], mirrored[:, ::-1], fat[:, ::2],
        np.asfortranarray(image),
    ):  # fmt: skip
        np.testing.assert_array_equal(same, image)
        np.testing.assert_array_equal(grid.unroll(same), expected)


# Refusals.


@pytest.mark.parametrize(
    ("chosen", "region", "text"),
    [
        (view(aim=0.35), None, r"pose: only 0 of 1\d\d lines up the container's wall show the "
         "still level and liquid below it inside the image or the region of interest, needs 12"),
        (view(aim=-0.35), None, r"pose: only 0 of 1\d\d lines"),
        (view(focal=40.0), None, r"pose: only 0 of \d lines .* needs 12"),
        (view(), RegionOfInterest(0, 0, 150, 480), r"pose: only 0 of 1\d\d lines"),
        (view(), RegionOfInterest(200, 0, 200, 245), r"pose: only 0 of 1\d\d lines"),
        (view(), RegionOfInterest(300, 0, 10, 480), r"pose: only [5-9] of 1\d\d lines"),
    ],
)  # fmt: skip
def test_too_little_of_the_container_is_refused_in_one_line(chosen, region, text):
    with pytest.raises(SloshCameraError, match=text) as refusal:
        build_scan_grid(chosen, region)
    assert "\n" not in str(refusal.value)
