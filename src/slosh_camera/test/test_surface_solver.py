import numpy as np
import pytest

from slosh_base.compiled.compilation import uncompiled
from slosh_camera.cylinder import silhouette, surface_solver
from slosh_camera.cylinder.surface import SHAPES, Shape, shapes_at, wall_shapes
from slosh_camera.cylinder.surface_choice import first_mode_candidates
from slosh_camera.cylinder.tuning import TUNING
from slosh_camera.cylinder.wall_geometry import WallGeometry, build_scan_grid

touch = uncompiled(silhouette.touch)

RADIUS = 0.05
MM = 1e-3
# An edge that does not fade: the bare silhouette.
NO_FADE = 1e-9
PITCHED = {"camera_height": 0.45 * np.tan(np.radians(10.0))}
# The front line alone cannot tell a first from a second mode, so something must be known.
WEAK = np.diag(np.array([1.0, 30.0, 30.0, 2.0, 2.0, 2.0, 2.0, 2.0]) * MM) ** 2
WEAK[np.diag_indices(SHAPES)] **= -1.0


def random_surface(rng, first=0.4):
    """Returns random mode amplitudes with a first mode up to a fraction of the radius."""
    size, azimuth = rng.uniform(0.3, 1.0) * first * RADIUS, rng.uniform(-np.pi, np.pi)
    square = size**2 / RADIUS
    heights = np.zeros(SHAPES)
    heights[Shape.LEVEL] = rng.normal(0.0, 0.3 * MM)
    heights[[Shape.FIRST_X, Shape.FIRST_Y]] = size * np.cos(azimuth), size * np.sin(azimuth)
    heights[[Shape.SECOND_X, Shape.SECOND_Y]] = rng.normal(0.0, 0.05 * size, 2)
    heights[Shape.MEAN] = rng.normal(0.0, 0.1 * square)
    heights[[Shape.DOUBLE_X, Shape.DOUBLE_Y]] = rng.normal(0.0, 0.1 * square, 2)
    return heights


def highest_above(near, far, heights, places=4001):
    """Finds where, and how high, the surface rises most above a ray by exhaustive search."""
    part = np.linspace(0.0, 1.0, places)[:, np.newaxis]
    points = near + part * (far - near)
    above = shapes_at(points[:, 0], points[:, 1]) @ heights - points[:, 2]
    highest = int(np.argmax(above))
    return part[highest, 0], above[highest]


def touching_rays(heights, count, rng):
    """Returns rays from a camera slightly above that touch the surface in its rear half."""
    start = rng.uniform(-0.8, 0.8, count) - 0.5 * np.pi
    turn = np.pi + rng.uniform(-0.6, 0.6, count)
    near = np.column_stack((np.cos(start), np.sin(start), np.zeros(count)))
    far = np.column_stack((np.cos(start + turn), np.sin(start + turn), np.zeros(count)))
    length = RADIUS * np.hypot(far[:, 0] - near[:, 0], far[:, 1] - near[:, 1])
    above = np.empty(count)
    for i in range(count):
        for slope in (0.1, 0.2, 0.4, 0.8, 1.6):
            far[i, 2] = -slope * length[i]
            part, above[i] = highest_above(near[i], far[i], heights)
            if part > 0.4:
                break
    near[:, 2] += above
    far[:, 2] += above
    return near, far


def front_points(heights, count=120):
    azimuth = np.linspace(-np.pi, 0.0, count)
    shapes = wall_shapes(azimuth)
    return shapes, shapes @ heights


def no_rays():
    return np.full((0, 3), np.nan), np.full((0, 3), np.nan), np.zeros(0)


def solve(
    front=None, rays=None, centre=None, precision=WEAK, bound=None, start=None,
    scale=0.2 * MM, fade=NO_FADE, share=1.0, share_spread=1e-6, coarse=TUNING.coarse,
):  # fmt: skip
    found, covariance, *rest = solve_with_share(
        front, rays, centre, precision, bound, start, scale, fade, share, share_spread, coarse
    )
    return found[:SHAPES], covariance[:SHAPES, :SHAPES], *rest


def solve_with_share(
    front, rays, centre, precision, bound, start, scale, fade, share, share_spread, coarse
):
    shapes, height = front or (np.zeros((0, SHAPES)), np.zeros(0))
    near, far = rays or no_rays()[:2]
    centre = np.zeros(SHAPES) if centre is None else centre
    return surface_solver.solve(
        shapes, height, np.full(height.size, scale),
        np.zeros(height.size, np.bool_) if bound is None else bound,
        near, far, np.full(len(near), scale), RADIUS, fade,
        centre.copy() if start is None else start, centre, precision, share, share_spread, coarse,
    )  # fmt: skip


# The place of touch.


def test_a_ray_over_a_crest_touches_it_there():
    # The mean shape's negative is a hill in the middle of the container.
    heights = np.zeros(SHAPES)
    heights[Shape.MEAN] = -2.0 * MM
    top = shapes_at(0.0, 0.0)[0] @ heights
    near, far = np.array([0.0, -1.0, top + MM]), np.array([0.0, 1.0, top + MM])
    part, above, hidden = touch(near, far, RADIUS, 0.5 * MM, heights)
    assert part == pytest.approx(0.5, abs=1e-6)
    assert above == pytest.approx(-1.0 * MM, abs=1e-6)
    # A crest fades in over its whole fade, and a wider one where the picture is softer.
    assert hidden == pytest.approx(0.5 * MM, rel=1e-6)
    assert touch(near, far, RADIUS, MM, heights)[2] == pytest.approx(MM, rel=1e-6)


def test_touch_against_looking_everywhere():
    rng = np.random.default_rng(3)
    errors = []
    for _ in range(60):
        heights = random_surface(rng, 0.3)
        near, far = touching_rays(heights, 2, rng)
        for i in range(2):
            part, above, hidden = touch(near[i], far[i], RADIUS, 0.5 * MM, heights)
            errors.append(above)
            assert 0.0 <= part <= 1.0
            assert 0.0 <= hidden <= 0.5 * MM * (1.0 + 1e-9)
    # Nothing is higher than the highest place; what nine samples and a parabola miss is little.
    assert np.max(errors) < 1e-6
    assert np.min(errors) > -0.15 * MM
    assert np.median(errors) > -0.001 * MM


# The silhouette.


@pytest.mark.parametrize("camera", [{}, PITCHED], ids=["level", "pitched"])
def test_silhouette_against_looking_everywhere(make_scene, camera):
    wall = WallGeometry(build_scan_grid(make_scene(**camera).calibration().view, None), RADIUS)
    near = np.ascontiguousarray(wall.near[:, ::4])
    far = np.ascontiguousarray(wall.far[:, ::4])
    last = wall.last_row[::4].copy()
    rng = np.random.default_rng(5)
    errors = []
    for _ in range(5):
        heights = random_surface(rng, 0.3)
        rows = silhouette.silhouette_rows(near, far, last, RADIUS, NO_FADE, heights)
        for i in np.flatnonzero((rows > 2.0) & (rows < wall.rows - 5)):
            # The surface is above the ray of the row below the silhouette, not of that above.
            around = range(int(rows[i]) - 2, int(rows[i]) + 4)
            above = np.array(
                [highest_above(near[j, i], far[j, i], heights, 401)[1] for j in around]
            )
            below = int(np.argmax(above > 0.0))
            exact = around[below] - above[below] / (above[below] - above[below - 1])
            errors.append(rows[i] - exact)
    assert len(errors) > 100
    assert np.max(np.abs(errors)) < 0.2
    assert np.percentile(np.abs(errors), 90) < 0.08


# The fit.


def test_noiseless_points_and_rays_give_the_surface_back():
    around = wall_shapes(np.arange(0.0, 6.3, 0.1))
    errors = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        heights = random_surface(rng, 0.25)
        rays = touching_rays(heights, 40, rng)
        start = heights + rng.normal(0.0, 0.3 * MM, SHAPES)
        result = solve(front_points(heights), rays, start=start)
        found, _, front_error, front_weight, ray_error, ray_weight, part = result
        errors.append(np.max(np.abs(around @ (found - heights))))
        assert np.max(np.abs(front_error)) < 0.01 * MM
        assert np.median(np.abs(ray_error)) < 0.03 * MM
        assert np.min(front_weight) > 0.99
        assert np.median(ray_weight) > 0.99
        assert np.all((part >= 0.0) & (part <= 1.0))
    # Where a crest is flat, the place of touch is known less exactly.
    assert np.max(errors) < 0.02 * MM
    assert np.median(errors) < 0.001 * MM


@pytest.mark.parametrize("seed", range(5))
def test_a_fifth_of_outliers_moves_nothing(seed):
    rng = np.random.default_rng(seed)
    heights = random_surface(rng, 0.25)
    shapes, height = front_points(heights)
    near, far = touching_rays(heights, 40, rng)
    bad = rng.choice(height.size, height.size // 5, replace=False)
    height[bad] += rng.choice([-1.0, 1.0], bad.size) * rng.uniform(3.0 * MM, 20.0 * MM, bad.size)
    bad_ray = rng.choice(40, 8, replace=False)
    near[bad_ray, 2] += 5.0 * MM
    far[bad_ray, 2] += 5.0 * MM
    start = heights + rng.normal(0.0, 0.3 * MM, SHAPES)
    found, _, _, weight, _, ray_weight, _ = solve((shapes, height), (near, far), start=start)
    around = wall_shapes(np.arange(0.0, 6.3, 0.1))
    assert np.max(np.abs(around @ (found - heights))) < 0.05 * MM
    assert np.all(weight[bad] == 0.0)
    assert np.min(np.delete(weight, bad)) > 0.5
    assert np.all(ray_weight[bad_ray] == 0.0)


def test_a_rough_start_needs_the_coarse_way():
    # Nine deviations off: nothing counts in a fine fit, and what is started from is left.
    shapes = wall_shapes(np.linspace(-np.pi, np.pi, 120))
    front = shapes, np.full(120, 1.8 * MM)
    precision = np.diag(np.full(SHAPES, (30.0 * MM) ** -2.0))
    fine, coarse = (
        shapes @ solve(front, coarse=coarse, precision=precision)[0]
        for coarse in (TUNING.fine, TUNING.coarse)
    )
    np.testing.assert_allclose(coarse, 1.8 * MM, atol=1e-6)
    np.testing.assert_allclose(fine, 0.0, atol=1e-6)


def test_without_data_the_prior_is_left():
    centre = np.arange(1.0, SHAPES + 1.0) * MM
    precision = np.diag(np.arange(1.0, SHAPES + 1.0) * 1e6)
    found, covariance, *_ = solve(centre=centre, precision=precision, start=np.zeros(SHAPES))
    np.testing.assert_allclose(found, centre, atol=1e-12)
    np.testing.assert_allclose(covariance, np.linalg.inv(precision), rtol=1e-9)


def test_covariance_is_the_inverse_of_the_normal_matrix():
    rng = np.random.default_rng(10)
    heights = random_surface(rng, 0.25)
    shapes, height = front_points(heights)
    near, far = touching_rays(heights, 40, rng)
    precision = np.diag(np.full(SHAPES, (3.0 * MM) ** -2.0))
    precision[6, 7] = precision[7, 6] = 0.3 * precision[6, 6]
    result = solve((shapes, height), (near, far), heights, precision)
    _, covariance, _, front_weight, _, ray_weight, part = result
    place = near + part[:, np.newaxis] * (far - near)
    at_rays = shapes_at(place[:, 0], place[:, 1])
    normal = (
        precision
        + (
            shapes.T @ (front_weight[:, np.newaxis] * shapes)
            + at_rays.T @ (ray_weight[:, np.newaxis] * at_rays)
        )
        / (0.2 * MM) ** 2
    )
    np.testing.assert_allclose(covariance @ normal, np.eye(SHAPES), atol=2e-3)
    assert np.all(np.linalg.eigvalsh(covariance) > 0.0)


def test_the_share_of_the_fade_is_what_the_edges_show_and_within_none_and_all():
    heights = np.zeros(SHAPES)
    heights[Shape.MEAN] = -2.0 * MM
    near, far = touching_rays(heights, 60, np.random.default_rng(11))
    # The front line and the other shapes are known: the rays alone tell how much is hidden.
    known = {"centre": heights, "precision": 1e4 * WEAK, "fade": 0.8 * MM, "start": heights}
    for shown, found in ((0.0, 0.0), (0.5, 0.5), (1.0, 1.0), (-0.5, 0.0), (1.5, 1.0)):
        lower = np.array([0.0, 0.0, 0.8 * MM * shown])
        share = solve_with_share(
            front_points(heights), (near - lower, far - lower), bound=None, scale=0.2 * MM,
            share=0.6, share_spread=1.0, coarse=TUNING.coarse, **known,
        )[0][SHAPES]  # fmt: skip
        assert share == pytest.approx(found, abs=0.1)


# First guesses.


def pairs_of(count):
    some = range(0, count, 6)
    return np.array([(i, j) for i in some for j in some if j > i])


def candidates(azimuth, height, count=5, highest=0.9 * RADIUS):
    return first_mode_candidates(azimuth, height, 2.0 * MM, pairs_of(azimuth.size), count, highest)


def test_most_points_agree_with_the_first_guess():
    rng = np.random.default_rng(12)
    azimuth = np.linspace(-np.pi, 0.0, 108)
    height = 12.0 * MM * np.cos(azimuth) - 20.0 * MM * np.sin(azimuth)
    wrong = rng.permutation(108)[:45]
    height[wrong] = rng.uniform(-40.0 * MM, 40.0 * MM, 45)
    height[rng.permutation(108)[:10]] = np.nan
    found, share = candidates(azimuth, height)
    assert found[0] == pytest.approx((12.0 * MM, -20.0 * MM), abs=0.5 * MM)
    assert 0.4 < share[0] < 0.8
    assert np.all(np.diff(share) <= 0.0)
    # All of them differ.
    apart = np.linalg.norm(found[:, np.newaxis] - found, axis=2) + np.eye(len(found))
    assert np.min(apart) >= 2.0 * MM


# Around the wall.
