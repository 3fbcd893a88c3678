import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.special import erf

from slosh_camera.cylinder import edge_search
from slosh_camera.cylinder.front_line import no_edges

ROWS = 80
FIRST = np.zeros(100, np.int64)
LAST = np.full(100, ROWS - 1, np.int64)
# A row and every hundredth of it.
PLACES = 40.0 + np.arange(100) / 100.0


def soft_edges(place, width, *, sign=1, light=0.0, noise=0.0):
    """Returns an image with a blurred edge between background and liquid; sign -1 swaps them."""
    row = np.arange(ROWS)[:, np.newaxis]
    picture = 0.5 - 0.5 * sign * erf((row - place) / (np.sqrt(2.0) * width))
    picture += light * (row - 40.0)
    picture += np.random.default_rng(1).normal(0.0, noise, picture.shape)
    return picture.astype(np.float32)


def refined(picture, place, off=0):
    row = np.ceil(place).astype(np.int64) + off
    return edge_search.refine_edges(picture, row, FIRST[: row.size], LAST[: row.size])


# Edges to a fraction of a row.


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("width", [0.7, 1.0, 1.5, 2.0, 3.0, 4.0])
def test_edges_of_any_width_are_found_to_a_fraction_of_a_row(width, sign):
    place, _ = refined(soft_edges(PLACES, width, sign=sign), PLACES)
    assert np.max(np.abs(place - PLACES)) < 0.08
    assert abs(np.mean(place - PLACES)) < 0.02


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("width", [0.7, 1.0, 2.0, 3.0, 4.0])
def test_noise_moves_an_edge_little(width, sign):
    place, _ = refined(soft_edges(PLACES, width, sign=sign, noise=0.01), PLACES)
    error = place - PLACES
    assert np.sqrt(np.mean(error**2)) < 0.07 * max(width, 1.0)
    assert np.max(np.abs(error)) < 0.25 * max(width, 1.0)
    assert abs(np.mean(error)) < 0.02 * max(width, 1.0)


def test_there_is_no_edge_in_nothing_and_none_at_the_border():
    flat = np.zeros((ROWS, 100), np.float32)
    place, width = refined(flat, PLACES)
    assert np.all(np.isnan(place))
    assert np.all(np.isnan(width))
    picture = soft_edges(PLACES, 1.0)
    row = np.ceil(PLACES).astype(np.int64)
    for first, last in ((row - 2, LAST), (FIRST, row + 1)):
        place, width = edge_search.refine_edges(picture, row, first, last)
        assert np.all(np.isnan(place))
        assert np.all(np.isnan(width))


# The liquid's level and its upper end.


def test_levels_are_medians_of_what_is_near_the_most_frequent_level():
    rng = np.random.default_rng(2)
    picture = rng.normal(0.08, 0.02, (200, 30)).astype(np.float32)
    picture[:, 3] += 0.1
    picture[80:105] = rng.normal(-0.22, 0.01, (25, 30))  # something darker
    picture[40:70] = 1.0  # background in a deep trough
    # The floor shines through.
    picture[150:190] = rng.normal(0.4, 0.04, (40, 30))
    found = edge_search.liquid_levels(picture, 20, 200, 0.25)
    part = picture[20:200]
    expected = [np.median(line[np.abs(line - 0.08) < 0.25]) for line in part.T]
    np.testing.assert_allclose(found, expected, atol=0.002)


def tops(picture, inside=None, level=None):
    lines = picture.shape[1]
    return edge_search.liquid_tops(
        picture,
        np.ones(picture.shape, np.float32) if inside is None else inside,
        np.zeros(lines) if level is None else level,
        0.1,
    )


def walls(row):
    return (np.arange(ROWS)[:, np.newaxis] < row).astype(np.float32)


def test_the_liquids_end_against_trying_every_row():
    rng = np.random.default_rng(5)
    picture = walls(np.full(50, 40)) * 0.4 + rng.normal(0.0, 0.25, (ROWS, 50))
    picture = picture.astype(np.float32)
    level = rng.normal(0.0, 0.05, 50)
    found = tops(picture, level=level)
    against = np.clip((picture - level) / 0.1 - 1.0, -1.0, 1.0)
    for i in range(50):
        cost = [np.sum(against[j:, i]) - np.sum(against[:j, i]) for j in range(ROWS + 1)]
        assert cost[found[i]] == pytest.approx(min(cost), abs=1e-3)


def test_no_liquid_and_nothing_but_liquid():
    np.testing.assert_array_equal(tops(np.ones((ROWS, 5), np.float32)), ROWS)
    np.testing.assert_array_equal(tops(np.zeros((ROWS, 5), np.float32)), 0)


# A continuous edge near a curve.


def planted(curve, step=0.5, background=1.0):
    row = np.arange(ROWS)[:, np.newaxis]
    return np.where(row < curve, background, background - step).astype(np.float32)


def follow(picture, guess, reach=10, floor=None, first=None, reversed_weight=0.3):
    lines = picture.shape[1]
    return edge_search.follow_edge(
        picture,
        no_edges(picture.shape),
        np.asarray(guess, np.float64),
        reach,
        np.full(lines, ROWS - 1.0) if floor is None else floor,
        np.zeros(lines, np.int64) if first is None else first,
        np.full(lines, reversed_weight),
    )


CURVE = 40 + np.rint(12.0 * np.sin(np.arange(100) / 15.0)).astype(np.int64)


def test_a_planted_edge_is_followed_from_a_guess_beside_it():
    guess = CURVE + 6.0 * np.cos(np.arange(100) / 40.0)
    picture = planted(CURVE) + np.random.default_rng(6).normal(0.0, 0.05, (ROWS, 100))
    row, slope = follow(picture.astype(np.float32), guess)
    np.testing.assert_array_equal(row, CURVE)
    np.testing.assert_allclose(slope, 0.5, atol=0.2)


def test_an_edge_the_other_way_round_counts_by_its_weight():
    up = planted(np.full(100, 36), -0.5, 0.0)
    picture = up + planted(np.full(100, 44), 0.25)
    guess = np.full(100, 40.0)
    assert np.all(follow(picture, guess, reversed_weight=0.3)[0] == 44)
    row, slope = follow(picture, guess, reversed_weight=1.0)
    assert np.all(row == 36)
    np.testing.assert_allclose(slope, 0.5, atol=1e-6)


# Tables.


@settings(deadline=None, derandomize=True)
@given(
    steps=arrays(np.float64, (12, 6), elements=st.floats(1e-4, 2e-3)),
    parts=arrays(np.float64, 6, elements=st.floats(0.0, 1.0)),
    missing=st.integers(0, 4),
)
def test_rows_of_heights_are_the_inverse_of_heights_of_rows(steps, parts, missing):
    table = 0.02 - np.cumsum(steps, axis=0)
    table[:missing, ::2] = np.nan
    row = missing + parts * (11 - missing)
    level = np.array([np.interp(row[i], np.arange(12), table[:, i]) for i in range(6)])
    found = edge_search.rows_of_heights(table, level)
    np.testing.assert_allclose(found, row, atol=1e-7)


def test_a_table_is_linear_between_its_rows():
    rng = np.random.default_rng(7)
    table = rng.normal(size=(10, 40, 3))
    rows = rng.uniform(0.0, 9.0, 40)
    rows[3], rows[4], rows[5] = 0.0, 9.0, np.nan
    found = edge_search.table_at(table, rows)
    assert np.all(np.isnan(found[5]))
    for i in np.delete(np.arange(40), 5):
        expected = [np.interp(rows[i], np.arange(10), table[:, i, k]) for k in range(3)]
        np.testing.assert_allclose(found[i], expected, atol=1e-12)


# Agreement of a surface with a picture.


def score(picture, front, upper, surface=np.nan, backdrop=None, hidden=np.inf):
    lines = picture.shape[1]
    backdrop = np.ones_like(picture) if backdrop is None else backdrop
    first, last = np.zeros(lines, np.int64), np.full(lines, ROWS - 1, np.int64)
    return edge_search.surface_score(
        picture, backdrop, no_edges(picture.shape), surface, hidden,
        np.asarray(front, np.float64), np.asarray(upper, np.float64), first, last,
    )  # fmt: skip


def two_lines(front, upper, surface=0.5):
    row = np.arange(ROWS)[:, np.newaxis]
    picture = np.where(row < front, surface, 0.0)
    return np.where(row < upper, 1.0, picture).astype(np.float32)


@pytest.mark.parametrize(
    ("surface", "known"), [(0.1, 0.1), (0.3, np.nan), (0.5, 0.5), (0.5, np.nan), (0.8, 0.8)]
)
def test_the_true_lines_agree_best(surface, known):
    front, upper = CURVE + 10, CURVE - 8
    picture = two_lines(front, upper, surface)
    true = score(picture, front - 0.5, upper - 0.5, known)
    for i, j in ((12, 0), (-12, 0), (0, 12), (0, -12), (15, 15), (-15, -15), (-18, 18)):
        assert score(picture, front + i, upper + j, known) < true - 0.05


def test_a_picture_without_a_surface_agrees_with_none():
    rng = np.random.default_rng(8)
    for picture in (rng.uniform(0.0, 1.0, (ROWS, 100)), np.full((ROWS, 100), 0.6)):
        found = [
            score(
                picture.astype(np.float32),
                np.full(100, row),
                np.full(100, row - gap),
                hidden=hidden,
            )
            for hidden in (0.6, np.inf)
            for row in range(10, 70, 5)
            for gap in (0.0, 5.0, 20.0)
        ]
        assert max(found) < 0.0
