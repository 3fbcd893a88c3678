"""Compiled search for the places where rays to inner points of a transparent cone enter it."""

from __future__ import annotations

import math

from numba.types import boolean, float64, void

from slosh_base.compiled.compilation import CHANGED_2, GIVEN_1, GIVEN_2, compiled, entry_point

STEPS, HALVINGS = 30, 6
DIFFERENCE = 1e-7
EXACT = 1e-12  # m, of a ray's place


@compiled
def _hit(x, y, z, dx, dy, dz, radius, taper, far):  # type: ignore[no-untyped-def]
    """Returns the distance along a ray to a wall face; see `GlassWall._hit`."""
    here, rise = radius + taper * z, taper * dz
    a = dx * dx + dy * dy - rise * rise
    half_b = dx * x + dy * y - here * rise
    c = x * x + y * y - here * here
    discriminant = half_b * half_b - a * c
    if not (discriminant >= 0.0 and a > 0.0):
        return math.nan
    ahead = (-half_b + math.sqrt(discriminant)) / a
    scale = ahead if far else c / (a * ahead)
    # Beyond the cone's tip is its mirror image.
    return scale if scale >= 0.0 and here + scale * rise >= 0.0 else math.nan


@compiled
def _refracted(x, y, dx, dy, dz, taper, ratio):  # type: ignore[no-untyped-def]
    """Returns a unit direction after refraction at a face; NaN for total reflection."""
    across = math.sqrt(x * x + y * y)
    size = across * math.sqrt(1.0 + taper * taper)
    nx, ny, nz = x / size, y / size, -taper * across / size
    cosine = -(dx * nx + dy * ny + dz * nz)
    square = 1.0 - ratio * ratio * (1.0 - cosine * cosine)
    bend = ratio * cosine - (math.sqrt(square) if square >= 0.0 else math.nan)
    return ratio * dx + bend * nx, ratio * dy + bend * ny, ratio * dz + bend * nz


@compiled
def _error(azimuth, level, origin, point, wall, far):  # type: ignore[no-untyped-def]
    """Returns by how much a ray misses its point, along the circumference and upwards [m].

    Args:
        azimuth, level: where it enters the wall [rad, m].
        origin, point: where it comes from and should arrive, x, y, z [m].
        wall: inner and outer radius [m], taper, refractive index.
        far: whether it should arrive on the rear wall.
    """
    radius, outer, taper, index = wall
    reach = outer + taper * level
    x, y, z = reach * math.cos(azimuth), reach * math.sin(azimuth), level
    dx, dy, dz = x - origin[0], y - origin[1], z - origin[2]
    size = math.sqrt(dx * dx + dy * dy + dz * dz)
    dx, dy, dz = dx / size, dy / size, dz / size
    dx, dy, dz = _refracted(x, y, dx, dy, dz, taper, 1.0 / index)
    along = _hit(x, y, z, dx, dy, dz, radius, taper, False)
    x, y, z = x + along * dx, y + along * dy, z + along * dz
    if far:
        dx, dy, dz = _refracted(x, y, dx, dy, dz, taper, index)
        along = _hit(x, y, z, dx, dy, dz, radius, taper, True)
        x, y, z = x + along * dx, y + along * dy, z + along * dz
    around = math.atan2(y, x) - math.atan2(point[1], point[0])
    around = math.atan2(math.sin(around), math.cos(around))
    return radius * around, z - point[2]


@entry_point(
    void(GIVEN_1, GIVEN_2, float64, float64, float64, float64, boolean, CHANGED_2, CHANGED_2)
)
def find_entries(  # type: ignore[no-untyped-def]
    origin, points, radius, outer, taper, index, far, entries, errors
):
    """Finds where rays enter a cone by Newton's method.

    A step that leaves the wall, or does not help, is halved; what no step brings nearer stays
    where it is.

    Args:
        origin: (3,) camera's centre [m].
        points: (N, 3) on the inner wall, where the rays should arrive [m].
        radius, outer: of the inner and the outer face at z = 0 [m].
        taper: growth of the radius per height.
        index: the wall's refractive index.
        far: whether the points are on the rear wall.
        entries: (N, 2) azimuth and height where to begin [rad, m]; receives where they enter.
        errors: (N, 2) receives by how much they miss their points [m].
    """
    wall, start = (radius, outer, taper, index), (origin[0], origin[1], origin[2])
    for i in range(points.shape[0]):
        point = (points[i, 0], points[i, 1], points[i, 2])
        azimuth, level = entries[i, 0], entries[i, 1]
        e, f = _error(azimuth, level, start, point, wall, far)
        for _ in range(STEPS):
            if not max(abs(e), abs(f)) > EXACT:
                break
            e1, f1 = _error(azimuth - DIFFERENCE, level, start, point, wall, far)
            e2, f2 = _error(azimuth, level - DIFFERENCE, start, point, wall, far)
            a, c = (e - e1) / DIFFERENCE, (f - f1) / DIFFERENCE
            b, d = (e - e2) / DIFFERENCE, (f - f2) / DIFFERENCE
            whole = a * d - b * c
            by, up, share = (d * e - b * f) / whole, (a * f - c * e) / whole, 1.0
            better, g, h = False, e, f
            for _ in range(HALVINGS):
                g, h = _error(azimuth - share * by, level - share * up, start, point, wall, far)
                better = abs(g) + abs(h) < abs(e) + abs(f)
                if better:
                    break
                share *= 0.5
            if not better:
                break
            azimuth, level, e, f = azimuth - share * by, level - share * up, g, h
        entries[i, 0], entries[i, 1] = azimuth, level
        errors[i, 0], errors[i, 1] = e, f
