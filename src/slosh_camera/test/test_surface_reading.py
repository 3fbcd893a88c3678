from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from slosh_camera.cylinder.surface import (
    SHAPES,
    USUAL_FADE,
    Shape,
    SurfaceFit,
    WallPoints,
    wall_shapes,
)
from slosh_camera.cylinder.surface_reading import SurfaceReading, errors_together

MM = 1e-3
LINES = 120
FOOTPRINT = 0.5 * MM
ZERO = np.zeros(SHAPES)
# A camera at -y: the front wall from left to right, the rear wall behind the same lines.
FRONT = np.radians(np.linspace(-175.0, -5.0, LINES))
REAR = -FRONT


def slosh(size, azimuth, level=0.0):
    heights = np.zeros(SHAPES)
    heights[Shape.LEVEL] = level
    heights[[Shape.FIRST_X, Shape.FIRST_Y]] = size * np.cos(azimuth), size * np.sin(azimuth)
    return heights


def fit_of(
    heights, *, front=True, rear=True, bump=None, width=2.0, covariance=1e-10, by_fade=None
):
    """Returns a fit whose edges all agree, except for a bump (LINES,) [m] on the contact line."""
    bump = np.zeros(LINES) if bump is None else bump
    shapes = wall_shapes(FRONT)
    points = WallPoints(
        place=np.full(LINES, 100.0),
        azimuth=FRONT,
        height=shapes @ heights + bump,
        shapes=shapes,
        bound=np.zeros(LINES, np.bool_),
        width=np.full(LINES, width),
        scale=np.full(LINES, 0.2 * MM),
    )
    return SurfaceFit(
        points=points,
        heights=heights,
        covariance=covariance * np.eye(SHAPES),
        fade=USUAL_FADE,
        by_fade=np.zeros(SHAPES) if by_fade is None else by_fade,
        front_error=-bump,
        front_weight=np.full(LINES, 1.0 if front else 0.0),
        upper_place=np.full(LINES, 60.0),
        upper_azimuth=REAR,
        upper_error=np.zeros(LINES),
        upper_weight=np.full(LINES, 1.0 if rear else 0.0),
        upper_scale=0.2 * MM,
        upper_part=np.ones(LINES),
    )


def read(fit, *, zero=ZERO, cut_off=False, shaded=False):
    return SurfaceReading(fit, zero, FOOTPRINT, cut_off=cut_off, shaded=shaded)


def highest(reading):
    return reading.highest(reading.fitted(), reading.seen())


def turned(a, b):
    return np.angle(np.exp(1j * (a - b)))


# The highest points.


@settings(deadline=None, derandomize=True)
@example(10.0 * MM, -0.03, 0.0)  # in the last bin of the closed curve
@given(st.floats(0.5 * MM, 40.0 * MM), st.floats(-np.pi, np.pi), st.floats(-1.0 * MM, 1.0 * MM))
def test_the_fitted_surfaces_highest_point(size, azimuth, level):
    found = read(fit_of(slosh(size, azimuth, level))).fitted()
    assert found.height == pytest.approx(size + level, abs=1e-7)
    assert turned(found.azimuth, azimuth) == pytest.approx(0.0, abs=1e-4)
    assert -np.pi <= found.azimuth <= np.pi


def test_points_above_the_fit_raise_the_highest_seen_point_and_not_the_fitted_one():
    azimuth = -1.3
    # A third mode, which is none of the fitted shapes.
    bump = 1.0 * MM * np.cos(3.0 * (FRONT - azimuth))
    flat = read(fit_of(slosh(10.0 * MM, azimuth)))
    raised = read(fit_of(slosh(10.0 * MM, azimuth), bump=bump))
    assert raised.fitted().height == flat.fitted().height
    gain = raised.seen().height - flat.seen().height
    # The fit has its say as well, and neighbours' points.
    assert 0.4 * MM < gain < 0.9 * MM
    assert raised.seen().azimuth == pytest.approx(azimuth, abs=np.radians(3.0))
    assert raised.at(azimuth) == pytest.approx(raised.seen().height, abs=0.05 * MM)


# What is seen.


def test_a_peak_that_is_not_seen_is_fitted_and_not_seen():
    reading = read(fit_of(slosh(10.0 * MM, 1.5), rear=False))
    assert reading.fitted().height == pytest.approx(10.0 * MM, abs=1e-6)
    seen = reading.seen()
    # The front line's ends are the highest places near which a point is.
    assert 0.0 < seen.height < 6.0 * MM
    assert np.isnan(reading.at(1.5))
    assert reading.at(-1.5) == pytest.approx(10.0 * MM * np.cos(3.0), abs=0.1 * MM)
    assert highest(reading) == reading.fitted()
    both = read(fit_of(slosh(10.0 * MM, 1.5)))
    assert both.seen().height == pytest.approx(10.0 * MM, abs=1e-6)
    assert both.at(1.5) == pytest.approx(10.0 * MM, abs=0.01 * MM)


def test_of_what_is_seen_and_what_is_fitted_the_surer_is_the_highest():
    # Of what is towards the hidden wall little is known.
    towards = np.diag(np.where(np.arange(SHAPES) == Shape.FIRST_Y, (2.0 * MM) ** 2, 1e-12))
    unsure = read(replace(fit_of(slosh(1.0 * MM, 1.5), rear=False), covariance=towards))
    assert unsure.fitted().stddev > 1.9 * MM
    assert highest(unsure).height == unsure.seen().height
    # It is off by what it misses.
    missed = unsure.fitted().height - unsure.seen().height
    assert highest(unsure).stddev == pytest.approx(np.hypot(unsure.seen().stddev, missed))
    # Where points are seen they have their say, however sure the fit is.
    bump = np.full(LINES, -0.5 * MM)
    lower = read(fit_of(slosh(10.0 * MM, -1.5), bump=bump))
    assert highest(lower).height == lower.seen().height < lower.fitted().height
    cut_off = read(fit_of(slosh(10.0 * MM, 1.5), rear=False), cut_off=True)
    assert highest(cut_off).height == cut_off.seen().height


def test_nothing_seen_is_nan_and_the_fit_is_left():
    reading = read(fit_of(slosh(10.0 * MM, 1.5), front=False, rear=False))
    seen = reading.seen()
    assert np.isnan([seen.height, seen.azimuth, seen.stddev]).all()
    assert reading.height.size == reading.azimuth.size == 0
    assert np.isfinite(reading.fitted().stddev)


# Lower bounds.


# Edges that contradict the fit.


@pytest.mark.parametrize("size", [0.5, 1.0, 2.0])
def test_edges_that_err_by_themselves_tell_as_much_as_they_claim(size):
    random = np.random.default_rng(2)
    errors = size * random.normal(size=(300, LINES))
    edges = random.random((300, LINES)) > 0.2
    found = [errors_together(row, kept) for row, kept in zip(errors, edges, strict=True)]
    # A chance correlation of neighbours is taken for one, up to the first that is none.
    assert np.mean(found) == pytest.approx(size**2, rel=0.2)


@pytest.mark.parametrize("together", [5, 10])
def test_edges_that_err_together_tell_as_much_as_one_of_them(together):
    random = np.random.default_rng(3)
    blocks = random.normal(size=(300, LINES // together))
    edges = np.ones(LINES, np.bool_)
    found = [errors_together(np.repeat(row, together), edges) for row in blocks]
    assert together < np.mean(found) < 1.4 * together  # as above


def test_a_line_that_is_of_no_surface_leaves_it_uncertain():
    """A third-order wave along the line looks like the edge of another object."""
    bump = 0.6 * MM * np.cos(3.0 * FRONT)
    scattered = np.random.default_rng(4).permutation(bump)
    fits = [fit_of(slosh(10.0 * MM, -1.2), covariance=1e-9, bump=one) for one in (bump, scattered)]
    together, alone = (read(fit) for fit in fits)
    assert together.contradiction > 10.0 > alone.contradiction
    assert together.fitted().stddev > 1.5 * alone.fitted().stddev


# The standard deviation.


def stddev(**changes):
    return read(fit_of(slosh(changes.pop("size", 10.0 * MM), -1.2), **changes)).seen().stddev


def test_stddev_grows_with_everything_that_makes_a_height_doubtful():
    usual = stddev()
    assert 0.01 * MM < usual < 0.2 * MM
    widths = [stddev(width=width) for width in (1.0, 2.0, 4.0, 8.0)]
    assert np.all(np.diff(widths) > 0.0)
    assert widths[3] > 3.0 * widths[0]
    assert stddev(covariance=1e-7) > 2.0 * usual
    assert stddev(by_fade=np.full(SHAPES, 0.5 * MM)) > 2.0 * usual
    assert stddev(size=40.0 * MM) > 1.3 * usual
    scattered = np.random.default_rng(1).normal(0.0, 0.4 * MM, LINES)
    assert stddev(bump=scattered) > 1.5 * usual
    # Edges that have no width are wide ones.
    assert stddev(width=np.nan) > widths[2]
