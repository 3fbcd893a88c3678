"""Tests prisms over outlines of any form and direction."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from slosh_model import (
    Inputs,
    Model,
    SloshModelError,
    measured_heights,
    simulate,
    wall_heights,
)
from slosh_model.constants import GRAVITY
from slosh_model.mode_table import mode_table
from slosh_model.model_text import format_model, parse_model
from slosh_model.outline_wall import MOST_CORNERS, few_corners
from slosh_model.shapes import Prism, Rectangle, Tray
from slosh_model.shapes.contour import line
from slosh_model.shapes.table_text import points_of
from slosh_model.standing import Standing
from slosh_model.standing_use import StandingMasses, standing_use
from slosh_shapes import finite_elements, solver
from slosh_shapes.directed import modes_without_symmetry
from slosh_shapes.plane import prism_modes

pytestmark = pytest.mark.skipif(
    not finite_elements.available(), reason="no scikit-fem (requirements/modes.txt)"
)
SIDE = 0.1
HALF_EQUILATERAL = ((0.0, 0.0), (SIDE / 2, 0.0), (0.0, SIDE * math.sqrt(0.75)))
SCALENE = ((0.0, 0.0), (0.1, 0.0), (0.04, 0.07))
TRAPEZIUM = ((0.0, 0.0), (0.1, 0.0), (0.06, 0.05), (0.0, 0.05))
ANGLE = ((0.0, 0.0), (0.12, 0.0), (0.12, 0.04), (0.05, 0.04), (0.05, 0.09), (0.0, 0.09))
BOX = ((0.0, 0.0), (0.12, 0.0), (0.12, 0.07), (0.0, 0.07))
ISOSCELES = ((0.0, 0.0), (0.1, 0.0), (0.05, 0.09))
HEXAGON = tuple((0.05 * math.cos(k * math.pi / 3), 0.05 * math.sin(k * math.pi / 3))
                for k in range(6))  # fmt: skip
QUICK = {"scalene": SCALENE, "isosceles": ISOSCELES}
OUTLINES = {
    **QUICK, "trapezium": TRAPEZIUM, "L": ANGLE, "box": BOX, "hexagon": HEXAGON,
    "half equilateral": HALF_EQUILATERAL,
}  # fmt: skip


def turned(points, angle):
    c, s = math.cos(angle), math.sin(angle)
    return tuple((c * x - s * y, s * x + c * y) for x, y in points)


def jar(points, fill_height=0.05):
    return Prism(outline=points, fill_height=fill_height)


def shaken(angle=0.0):
    t = np.arange(0.0, 1.5, 0.004)
    x, y = 1.5 * np.sin(9.0 * t), np.cos(14.0 * t) - 1.0
    c, s = math.cos(angle), math.sin(angle)
    return Inputs(t, np.column_stack([c * x - s * y, s * x + c * y, 0.5 * np.sin(5.0 * t)]))


def heights(points, angle, modes=1):
    model = Model(jar(turned(points, angle)), modes=modes).spatial()
    return simulate(model, shaken(angle))[0].msh


# ---- eigenvalues


def wave_numbers(container, count):
    """Returns k of the first modes from ω² = gk tanh kh of a deep container, in order."""
    count = 2 * count if container.one_directional else count
    axes = (0,) if container.one_directional else (0, 1)
    omegas = [container.natural_frequency(n + 1, axis) for axis in axes for n in range(count)]
    return np.sort(np.square(omegas) / GRAVITY)


def test_half_an_equilateral_triangle_is_exact():
    """Tests Lamé's k² = (4π/3a)² (m² + mn + n²) in a triangle without symmetry."""
    container = jar(HALF_EQUILATERAL, 1.0)
    assert container.one_directional
    unit = (4.0 * math.pi / (3.0 * SIDE)) ** 2
    exact = unit * np.array([m * m + m * n + n * n for m in range(16) for n in range(m + 1)])
    found = wave_numbers(container, 2) ** 2
    away = np.abs(found[:, None] / exact[exact > 0.0] - 1.0).min(axis=1)
    assert away.max() < 1e-5
    assert found[:2] == pytest.approx([unit, 3.0 * unit], rel=1e-6)


@pytest.mark.long
def test_the_l_of_three_squares():
    """Tests Dauge's Neumann eigenvalues (1.47562182, 3.53403137) of three unit squares."""
    a = 0.05
    points = ((0, 0), (2 * a, 0), (2 * a, a), (a, a), (a, 2 * a), (0, 2 * a))
    container = jar(points, 1.0)
    assert math.degrees(container.axes(1)) % 90.0 == pytest.approx(45.0)
    found = wave_numbers(container, 1) ** 2 * a * a
    assert found == pytest.approx([1.47562182, 3.53403137], rel=2e-5)


@pytest.mark.long
def test_an_l_with_unequal_arms_by_finite_differences():
    container = jar(ANGLE, 1.0)
    found = wave_numbers(container, 1)[:2] ** 2
    coarse, middle, fine = (eigenvalues_on_a_grid(0.01 / n) for n in (2, 4, 8))
    # At the notch the error falls by 2^(4/3) from grid to grid, elsewhere by 4.
    notch = fine + (fine - middle) / (2.0 ** (4.0 / 3.0) - 1.0)
    before = middle + (middle - coarse) / (2.0 ** (4.0 / 3.0) - 1.0)
    assert found == pytest.approx(notch + (notch - before) / 3.0, rel=3e-4)


def eigenvalues_on_a_grid(step):
    """Returns the first two k² over ANGLE by finite differences of cells of size `step`."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.linalg import eigsh

    x = np.arange(0.5 * step, 0.12, step)
    y = np.arange(0.5 * step, 0.09, step)
    inside = (x[:, None] < 0.05) | (y[None] < 0.04)
    number = np.where(inside, np.cumsum(inside.ravel()).reshape(inside.shape) - 1, -1)
    pairs = [
        np.stack([number[1:], number[:-1]], -1),
        np.stack([number[:, 1:], number[:, :-1]], -1),
    ]
    a, b = np.vstack([pair.reshape(-1, 2) for pair in pairs]).T
    a, b = a[(a >= 0) & (b >= 0)], b[(a >= 0) & (b >= 0)]
    one = np.ones(len(a)) / step**2
    rows, columns = np.concatenate([a, b, a, b]), np.concatenate([b, a, a, b])
    matrix = coo_matrix((np.concatenate([-one, -one, one, one]), (rows, columns))).tocsc()
    return np.sort(eigsh(matrix, 3, sigma=-1.0, v0=np.ones(matrix.shape[0]))[0])[1:]


@pytest.mark.long
def test_a_box_without_its_symmetry_is_the_box():
    a, b, h = 0.06, 0.035, 0.05
    corners = [turned(((x, y),), 0.4)[0] for x, y in ((-a, -b), (a, -b), (a, b), (-a, b))]
    sides = [line(one, other) for one, other in zip(corners, [*corners[1:], corners[0]])]  # noqa: B905
    rows = prism_modes(modes_without_symmetry(sides, 1.0, 3), h)
    exact = Rectangle(2 * a, 2 * b, h)
    for axis, count in ((0, 3), (1, 2)):
        for n in range(count):
            row = rows[3 * axis + n]
            assert row.natural_frequency == pytest.approx(
                exact.natural_frequency(n + 1, axis), rel=1e-6
            )
            assert row.mass_ratio == pytest.approx(exact.mass_ratio(n + 1, axis), rel=1e-5)
            assert row.turn == pytest.approx(0.4, abs=1e-6)


def regular(corners, radius, angle, centre, digits):
    """Returns a regular polygon as a table of rounded numbers has it."""
    azimuths = angle + math.tau * np.arange(corners) / corners
    places = np.column_stack((np.cos(azimuths), np.sin(azimuths))) * radius + centre
    return tuple(map(tuple, places.round(digits).tolist()))


@pytest.mark.parametrize(
    ("corners", "radius", "frequency"),
    [(6, 0.0404145, 3.5072), (8, 0.04, 3.4573), (64, 0.035, 3.6104)],
    ids=["hexagon", "octagon", "nearly a circle"],
)
@pytest.mark.parametrize(
    ("angle", "centre", "digits"),
    [
        (0.0, (0.0, 0.0), 6),
        (math.pi / 6, (0.0, 0.0), 7),
        (math.pi / 6, (0.0137, -0.0212), 6),
        (math.pi / 6, (0.3, -0.1), 7),
        (0.3, (-0.05, 0.02), 6),
        (2.510897508238838, (0.0, 0.0), 7),
    ],
)
def test_rounded_corners_beside_an_axis_of_symmetry(
    corners, radius, frequency, angle, centre, digits
):
    prism = Prism(outline=regular(corners, radius, angle, centre, digits), fill_height=0.06)
    assert prism.natural_frequency(1) / math.tau == pytest.approx(frequency, rel=2e-4)


def test_a_regular_polygon_by_its_symmetry_is_that_computed_as_a_whole():
    prism = Prism(outline=regular(6, 0.0404145, 0.0, (0.01, 0.02), 6), fill_height=0.06)
    plane = modes_without_symmetry(prism.contour, 1.0, 3)
    (whole, *_) = prism_modes(plane, prism.fill_height)
    assert prism.natural_frequency(1) == pytest.approx(whole.natural_frequency, rel=1e-4)


def test_an_octagon_whose_corner_lies_beside_its_axis_is_that_computed_as_a_whole():
    prism = Prism(outline=regular(8, 0.04, 2.510897508238838, (0.0, 0.0), 7), fill_height=0.06)
    plane = modes_without_symmetry(prism.contour, 1.0, 3)
    (whole, *_) = prism_modes(plane, prism.fill_height)
    assert prism.natural_frequency(1) == pytest.approx(whole.natural_frequency, rel=1e-4)


NOTCH = (
    (0.0, 0.0), (0.06, 0.0), (0.06, 0.03), (1e-4, 0.0300001), (0.06, 0.0300002), (0.06, 0.06),
    (0.0, 0.06),
)  # fmt: skip


@pytest.mark.parametrize(
    ("points", "refusal"),
    [
        (((0.0, 0.0), (0.0, 0.1), (0.0, 0.05)), "no width: all points lie on one upright line"),
        (((1e6, 0.0), (1e6 + 0.1, 0.0), (1e6, 0.1)), r"more than 10000 m from its origin"),
        (((0.0, 0.0), (0.1, 0.0), (0.1, 0.004), (0.0, 0.004)), "25 times as long as wide"),
        (NOTCH, "parts too narrow to compute"),
    ],
    ids=["upright", "far away", "slot", "notch"],
)
def test_an_outline_beyond_what_is_computed_is_refused(points, refusal):
    with pytest.raises(SloshModelError, match=refusal):
        Prism(outline=points, fill_height=0.06).natural_frequency(1)


def test_an_unknown_height_on_a_wall_with_corners_stays_unknown():
    container = jar(((0.0, 0.0), (0.1, 0.0), (0.03, 0.08)))
    heights = np.array([math.nan, 0.001, math.nan]), np.array([0.001, math.nan, math.nan])
    assert np.isnan(container.msh(*heights)).all()
    assert np.isnan(container.azimuth(*heights)).all()


# ---- relations


@pytest.mark.parametrize("name", [*QUICK, *(pytest.param(one, marks=pytest.mark.long)
                                            for one in OUTLINES if one not in QUICK)])  # fmt: skip
@pytest.mark.parametrize("modes", [1, 2])
def test_a_constant_acceleration_tilts_the_surface_as_gravity_does(name, modes):
    """Tests η = -(x a_x + y a_y)/g at the highest place and at the wall by azimuth."""
    container = jar(turned(OUTLINES[name], 0.3))
    model = Model(container, damping_ratio=0.2, modes=modes)
    t = np.linspace(0.0, 30.0, 1501)
    azimuths = np.array([0.0, 1.0, 2.5, -2.0])
    for direction in (0.0, 1.1, 2.5):
        pull = np.array([math.cos(direction), math.sin(direction), 0.0])
        response, _ = simulate(model, Inputs(t, np.outer(np.minimum(t / 5.0, 1.0), pull)))
        exact = -(container.places @ pull[:2]) / GRAVITY
        assert response.msh[-1] == pytest.approx(exact.max(), rel=1e-9)
        highest = container.places[np.argmax(exact)]
        ties = np.isclose(exact, exact.max(), rtol=1e-9).sum()
        if ties == 1:
            assert response.azimuth[-1] == pytest.approx(math.atan2(*highest[::-1]), abs=1e-9)
        read = measured_heights(model, response, azimuths)[-1]
        around = np.arctan2(*container.places.T[::-1])
        for azimuth, height in zip(azimuths, read, strict=True):
            near = np.argmin(np.abs(np.angle(np.exp(1j * (around - azimuth)))))
            assert height == pytest.approx(exact[near], abs=4e-5)


@pytest.mark.parametrize("angle", [0.4, math.pi / 2])
def test_a_turned_triangle_has_the_same_heights(angle):
    base = heights(SCALENE, 0.0)
    assert heights(SCALENE, angle) == pytest.approx(base, abs=1e-5 * base.max())


@pytest.mark.long
@settings(max_examples=12, deadline=None)
@given(
    st.sampled_from(sorted(OUTLINES)), st.floats(-math.pi, math.pi), st.sampled_from([1, 2])
)  # fmt: skip
def test_turned_outlines_have_the_same_heights(name, angle, modes):
    base = heights(OUTLINES[name], 0.0, modes)
    found = heights(OUTLINES[name], angle, modes)
    assert found == pytest.approx(base, abs=2e-4 * base.max())


def test_yaw_turns_the_outline_with_the_container():
    model, motion = Model(jar(SCALENE)), shaken()
    attitude = np.tile([0.0, 0.0, math.sin(0.35), math.cos(0.35)], (len(motion.t), 1))
    c, s = math.cos(0.7), math.sin(0.7)
    world = motion.acceleration @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    expected, _ = simulate(model, motion)
    found, _ = simulate(model, Inputs(motion.t, world, attitude))
    np.testing.assert_allclose(found.msh, expected.msh, atol=1e-12)
    np.testing.assert_allclose(found.sh_x, expected.sh_x, atol=1e-12)


def test_the_modes_add_up_to_the_second_moments():
    """Tests Σ m g/ω² d dᵀ = ρ∫(x, y)(x, y)ᵀdS up to the modes left out."""
    container = jar(SCALENE)
    total = np.zeros((2, 2))
    for n in range(1, 7):
        d = np.array([math.cos(container.direction(n)), math.sin(container.direction(n))])
        omega = container.natural_frequency(n)
        total += container.mass_ratio(n) * container.volume * GRAVITY / omega**2 * np.outer(d, d)
    corners = np.array(SCALENE) - np.mean(SCALENE, axis=0)
    area = container.volume / container.fill_height
    exact = area / 12.0 * (corners.T @ corners)  # of a triangle about its centre
    np.testing.assert_allclose(total, exact, atol=0.03 * np.trace(exact))
    assert np.linalg.eigvalsh(exact - total).min() > 0.0


def test_heights_along_y_by_a_push_along_x_are_those_along_x_by_one_along_y():
    model = Model(jar(SCALENE), modes=2)
    t = np.arange(0.0, 3.0, 0.004)
    push = np.sin(8.0 * t) * (t < 0.5)
    responses = []
    for axis in (0, 1):
        acceleration = np.zeros((len(t), 3))
        acceleration[:, axis] = push
        responses.append(simulate(model, Inputs(t, acceleration))[0])
    across = responses[0].sh_y
    assert np.abs(across).max() > 1e-4  # the outline couples x and y
    np.testing.assert_allclose(across, responses[1].sh_x, atol=1e-12)


def test_the_motion_is_that_of_the_modal_equations():
    """Tests each mode's q̈ + 2ζωq̇ + ω²q = -a·d, and the sum of their heights along d."""
    container = jar(SCALENE)
    model, motion = Model(container), shaken()
    motion = Inputs(np.linspace(0.0, 1.0, 4001), Inputs(motion.t, motion.acceleration).resampled(
        np.linspace(0.0, 1.0, 4001)).acceleration)  # fmt: skip
    response, _ = simulate(model, motion)
    height, reach = np.zeros((len(motion.t), 2)), container.reaches[0]
    left = reach / GRAVITY * np.eye(2)
    for n in (1, 2):
        omega, zeta = container.natural_frequency(n), container.mode_damping(1e-6, n)
        d = np.array([math.cos(container.direction(n)), math.sin(container.direction(n))])

        def rate(at, q, omega=omega, zeta=zeta, d=d):
            pull = [np.interp(at, motion.t, motion.acceleration[:, k]) for k in (0, 1)]
            return [q[1], -(omega**2) * q[0] - 2.0 * zeta * omega * q[1] - float(d @ pull)]

        q = solve_ivp(rate, (0.0, 1.0), [0.0, 0.0], "DOP853", motion.t, rtol=1e-9, atol=1e-12).y[0]
        gain = container.numbers(n).height_per_displacement * reach / container.numbers(n).reach
        height += gain * np.outer(q, d)
        left -= gain / omega**2 * np.outer(d, d)
    height -= motion.acceleration[:, :2] @ left
    found = np.column_stack([response.sh_x, response.sh_y])
    assert np.abs(found - height).max() < 2e-6 * np.abs(height).max()


def test_free_waves_keep_their_energy_and_their_direction():
    container = jar(SCALENE)
    t = np.arange(0.0, 4.0, 0.002)
    push = np.where(t < 0.2, 3.0, 0.0)
    motion = Inputs(t, np.column_stack([push, 0.5 * push, np.zeros_like(t)]))
    model = Model(container, damping_ratio=0.0)
    response, _ = simulate(model, motion, max_step=0.0005)
    for n in (0, 1):
        place, speed = response.modal[200:, n, :2], response.modal[200:, n, 2:]
        omega = container.natural_frequency(n + 1)
        energy = (speed**2).sum(axis=1) + omega**2 * (place**2).sum(axis=1)
        assert np.ptp(energy) < 1e-6 * energy.mean()
        angle = container.direction(n + 1) - container.axes(2)
        across = place @ [-math.sin(angle), math.cos(angle)]
        assert np.abs(across).max() < 1e-12


# ---- everything else takes it


def test_many_motions_at_once_have_the_heights_of_each():
    containers = [jar(SCALENE), jar(turned(ISOSCELES, 0.3)), jar(ISOSCELES)] * 4
    models = [Model(one).spatial() for one in containers]
    motion = shaken()
    for model, found in zip(models, wall_heights(models, [motion] * 12), strict=True):
        response, _ = simulate(model, motion)
        expected = np.column_stack([response.sh_x, response.sh_y])
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)


def test_a_model_file_holds_the_directions(monkeypatch):
    for points in (SCALENE, turned(ISOSCELES, 0.3)):
        model = Model(jar(points), modes=2).with_effect("second_mode", damping_ratio=0.02)
        text = format_model(model)
        monkeypatch.setattr(Prism, "solved", lambda *_: pytest.fail("computed again"))
        monkeypatch.setattr(solver, "read", lambda _: None)
        read = parse_model(text, "jar.yaml")
        assert read == model
        motion = shaken()
        assert (simulate(read, motion)[0].msh == simulate(model, motion)[0].msh).all()
        monkeypatch.undo()


def test_the_table_tells_the_directions():
    rows = mode_table(Model(jar(SCALENE)), 3)
    assert [(row.axis, row.number) for row in rows] == [("x", 1), ("x", 2), ("x", 3),
                                                        ("y", 1), ("y", 2), ("y", 3)]  # fmt: skip
    assert len({row.azimuth for row in rows}) == 6
    tilted = mode_table(Model(jar(turned(ISOSCELES, 0.3))), 2)
    assert [round(row.azimuth % math.pi, 6) for row in tilted] == [0.3] * 2 + [
        round(0.3 + math.pi / 2, 6)
    ] * 2


def test_forces_are_those_of_the_turned_container():
    standing = Standing(mass=0.3, centre_height=0.05, base_radius=0.03, friction=0.5)
    used = [
        standing_use(Model(jar(turned(ISOSCELES, angle)), modes=2), standing, shaken(angle))
        for angle in (0.0, 0.4)
    ]
    assert tuple(used[1]) == pytest.approx(tuple(used[0]), rel=1e-5)
    assert StandingMasses.of(Model(jar(SCALENE)), standing).modal.shape == (2, 2)


def test_a_tray_with_round_corners_is_a_little_lower_than_a_box():
    tray = Tray(width=0.2, depth=0.12, corner_radius=0.03, fill_height=0.04)
    x, y = 0.1, 0.06
    height = float(tray.msh(np.array(x), np.array(y)))  # of a plane that rises by 1
    exact = 0.07 + 0.03 + 0.03 * math.sqrt(2.0)
    assert height == pytest.approx(exact, rel=3e-4)
    assert len(tray.corners) <= MOST_CORNERS


def test_few_corners_keep_the_form():
    t = np.linspace(0.0, math.tau, 400, endpoint=False)
    ring = np.column_stack([np.cos(t), 0.5 * np.sin(t)])
    few = few_corners(ring)
    assert len(few) == MOST_CORNERS
    for angle in np.linspace(0.0, 3.0, 13):
        d = np.array([math.cos(angle), math.sin(angle)])
        assert (few @ d).max() == pytest.approx((ring @ d).max(), rel=5e-3)
    box = np.array([[-1, -1], [0, -1], [1, -1], [1, 1], [-1, 1.0]])
    assert len(few_corners(box)) == 4


def test_another_fill_height_keeps_the_tilt():
    container = jar(SCALENE)
    model = Model(container).with_effect("fill_level", delta=0.004)
    direct = Model(replace(container, fill_height=0.054, table=None))
    expected, found = (simulate(one, shaken())[0].msh for one in (direct, model))
    assert found == pytest.approx(expected, abs=2e-3 * expected.max())


# ---- what people write


@pytest.mark.parametrize(
    "text",
    ["x;y\n0;0\n0,1;0\n0,04;0,07\n", "x\ty\n0\t0\n0.1\t0\n0.04\t0.07\n", "0 0\n0.1 0\n0.04 0.07\n",
     "\ufeffx,y\n0,0\n0.1,0\n0.04,0.07\n", "# of a drawing\n0,0\n0.1,0\n\n0.04,0.07\n"],
    ids=["semicolons", "tabs", "spaces", "byte order mark", "remark"],
)  # fmt: skip
def test_outlines_in_files_of_many_programs(tmp_path, text):
    (tmp_path / "jar.csv").write_text(text, encoding="utf-8")
    read = points_of("jar.csv", ("container", "outline"), tmp_path)
    assert read == SCALENE


@pytest.mark.parametrize(
    "points",
    [SCALENE[::-1], (*SCALENE, SCALENE[0]), (SCALENE[0], SCALENE[0], *SCALENE[1:])],
    ids=["clockwise", "closed", "twice"],
)
def test_an_outline_however_it_is_written_is_the_same(points):
    modes = [jar(one).natural_frequency(1) for one in (points, SCALENE)]
    assert modes[0] == pytest.approx(modes[1], rel=1e-6)


@pytest.mark.parametrize(
    "points",
    [
        ((0, 0), (0.1, 0), (0.1, 1e-4), (0, 1e-4)),
        ((0, 0), (0.1, 0), (0.1, 0), (0, 0)),
        ((0, 0), (0.1, 0), (0.15, 0), (0.1, 0), (0.1, 0.1), (0, 0.1)),
        ((0, 0), (0.1, 0), (0.05, 0.05), (0.1, 0.1), (0, 0.1), (0.05, 0.05)),
    ],
    ids=["sliver", "line", "spur", "two parts"],
)
def test_an_outline_without_room_is_refused(points):
    with pytest.raises(
        SloshModelError, match=r"touches itself|encloses (no area|too little)|different points"
    ):
        jar(points)
