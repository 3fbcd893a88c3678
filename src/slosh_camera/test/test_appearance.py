import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slosh_camera.cylinder.appearance import Backdrop, Tone, find_tone, median, percentile

ROWS, LINES = 160, 90
BODY = slice(100, 150)
ABOVE = 30
INSIDE = np.ones((ROWS, LINES), np.bool_)
FRONT = 90 + np.rint(6.0 * np.sin(np.arange(LINES) / 14.0)).astype(int)
REAR = 60 + np.rint(6.0 * np.cos(np.arange(LINES) / 14.0)).astype(int)


def wall(liquid, background, surface=None, noise=0.0, seed=1):
    """Returns an unrolled wall with background, free surface and liquid, in grey or colour."""
    row = np.arange(ROWS)[:, np.newaxis]
    picture = np.empty((ROWS, LINES, np.size(liquid)))
    picture[:] = background
    picture[row >= REAR] = (
        np.add(0.5 * np.array(liquid), 0.5 * np.array(background)) if surface is None else surface
    )
    picture[row >= FRONT] = liquid
    picture += np.random.default_rng(seed).normal(0.0, noise, picture.shape)
    picture = np.clip(np.rint(picture), 0, 255).astype(np.uint8)
    return picture[..., 0].copy() if np.size(liquid) == 1 else picture


def reduced(picture, inside=INSIDE):
    tone = find_tone(picture, inside, BODY, ABOVE)
    return tone, tone.reduce(picture)


PAIRS = {
    "darker": (45, 210),
    "lighter": (220, 60),
    "faint": (120, 150),
    "colour": ((40, 60, 190), (215, 210, 205)),
    "hue alone": ((52, 143, 178), (180, 137, 136)),
    "one channel": ((100, 100, 60), (100, 100, 190)),
}


@pytest.mark.parametrize("name", PAIRS)
def test_liquid_is_0_and_background_1(name):
    liquid, background = PAIRS[name]
    tone, level = reduced(wall(liquid, background, noise=1.0))
    np.testing.assert_allclose(tone.liquid, np.atleast_1d(liquid), atol=1.0)
    np.testing.assert_allclose(tone.background, np.atleast_1d(background), atol=1.0)
    assert tone.axis @ (tone.background - tone.liquid) == pytest.approx(1.0)
    assert tone.contrast == pytest.approx(np.max(np.abs(np.subtract(liquid, background))), abs=2.0)
    assert level.dtype == np.float32
    assert level.shape == (ROWS, LINES)
    assert np.median(level[120:]) == pytest.approx(0.0, abs=0.03)
    assert np.median(level[:50]) == pytest.approx(1.0, abs=0.03)
    # The free surface, a mixture of both here, lies in between.
    assert np.median(level[72:80]) == pytest.approx(0.5, abs=0.06)


def test_specks_are_taken_away():
    picture = wall(45, 210)
    picture[20, 40], picture[140, 40] = 0, 255
    _, level = reduced(picture)
    assert level[20, 40] == pytest.approx(1.0, abs=1e-3)
    assert level[140, 40] == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("surface", [45, 90, 150, 205])
def test_the_background_is_what_is_above_not_the_free_surface(surface):
    picture = wall(45, 210, surface=surface)
    picture[31:60] = surface  # more of it than of the background
    tone, _ = reduced(picture)
    assert tone.background[0] == 210
    assert tone.liquid[0] == 45


@pytest.mark.parametrize("shape", [(), (3,)])
def test_nothing_that_differs_is_no_tone(shape):
    for grey in (0, 128, 255):
        picture = np.full((ROWS, LINES, *shape), grey, np.uint8)
        assert find_tone(picture, INSIDE, BODY, ABOVE) is None


def test_hardly_anything_inside_is_no_tone():
    inside = np.zeros_like(INSIDE)
    inside[100:103, :9] = True
    assert find_tone(wall(45, 210), inside, BODY, ABOVE) is None
    assert find_tone(wall(45, 210), np.zeros_like(INSIDE), BODY, ABOVE) is None


@settings(deadline=None, derandomize=True)
@given(
    seed=st.integers(0, 10**6),
    size=st.integers(1, 500),
    percent=st.integers(1, 99),
    channels=st.integers(1, 3),
)
def test_percentiles_are_those_of_sorted_samples(seed, size, percent, channels):
    samples = np.random.default_rng(seed).integers(0, 256, (size, channels), dtype=np.uint8)
    found = percentile(samples, float(percent))
    assert found.shape == (channels,)
    for channel in range(channels):
        # So many are not above it, and with the next lower level there would be fewer.
        rank = 0.01 * percent * size
        assert np.count_nonzero(samples[:, channel] <= found[channel]) >= rank - 1e-6
        assert np.count_nonzero(samples[:, channel] < found[channel]) <= rank + 1e-6


# What is beside the container, and so behind it.


WIDE, HIGH, EDGE = 300, 240, 120
TONE = Tone(np.array([30.0]), np.array([200.0]), np.array([1.0 / 170.0]), 0.01)


def grid(left=100.0, right=200.0):
    """Returns vertical scan lines of a container over the whole image height."""
    rows, lines = np.mgrid[0.0:HIGH, 0:50]
    return np.stack([left + (right - left) * lines / 49.0, rows], axis=-1)


def room(table=47):
    """Returns an image of a light wall above a dark table."""
    image = np.full((HIGH, WIDE), 200, np.uint8)
    image[EDGE:] = table
    return image


def test_a_dark_table_beside_the_container_is_expected_behind_it():
    found = Backdrop(grid(), (WIDE, HIGH)).reduced(room(), TONE)
    assert found.shape == (HIGH, 50)
    assert found[: EDGE - 10] == pytest.approx(1.0)
    assert found[EDGE + 10 :] == pytest.approx(0.1, abs=0.01)


# Medians of few numbers against NumPy's.


def test_medians_have_the_bits_of_numpys():
    random = np.random.default_rng(1)
    for count in range(1, 40):
        values = random.normal(size=count).round(1)
        assert median(values) == np.median(values)
        assert median(values[::2]) == np.median(values[::2])
    values[3] = np.nan
    assert np.isnan(median(values))
    assert np.isnan(median(np.empty(0)))
