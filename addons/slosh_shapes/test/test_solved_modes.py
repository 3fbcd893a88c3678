"""Tests computed modes against exact values, and the motion that follows from them."""

import math
import re
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from slosh_model import Inputs, Model, SloshModelError, simulate, wall_heights
from slosh_model.constants import GRAVITY
from slosh_model.containers import _SHAPES
from slosh_model.mode_table import mode_table
from slosh_model.model_text import format_model, parse_model
from slosh_model.shapes import (
    Beaker,
    Bottle,
    Cone,
    Ellipsoid,
    Flask,
    Frustum,
    Prism,
    Revolution,
    Sphere,
    Tray,
)
from slosh_model.shapes.contour import Piece, arc, line
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.shapes.rectangle import Rectangle
from slosh_model.shapes.round_cups import RoundCup
from slosh_model.shapes.solved import SolvedContainer, solved_modes
from slosh_model.shapes.table_text import points_of
from slosh_shapes import axisymmetric, finite_elements, solver
from slosh_shapes.mesh import divided, triangulated
from slosh_testing.surface import rectangle_surface, surface_height

pytestmark = pytest.mark.skipif(
    not finite_elements.available(), reason="no scikit-fem (requirements/modes.txt)"
)
R = 0.05
CUP = Frustum(bottom_radius=0.028, top_radius=0.04, height=0.09, fill_height=0.06)
HEXAGON = Prism(
    outline=tuple(
        (R * math.cos(k * math.pi / 3), R * math.sin(k * math.pi / 3)) for k in range(6)
    ),
    fill_height=0.05,
)
HALF_ROUND = Prism(
    outline=tuple(
        (R * math.cos(a), R * math.sin(a)) for a in np.linspace(-math.pi / 2, math.pi / 2, 33)
    ),
    fill_height=0.05,
)
SHAPES = (
    CUP,
    Cone(top_radius=0.06, height=0.08, fill_height=0.05),
    Sphere(radius=0.05, fill_height=0.06),
    Ellipsoid(radius=0.08, semi_height=0.05, fill_height=0.04),
    Beaker(radius=0.035, foot_radius=0.008, height=0.1, fill_height=0.06),
    Flask(
        bottom_radius=0.04, neck_radius=0.014, shoulder_height=0.09, height=0.13, fill_height=0.06
    ),
    Bottle(
        radius=0.04, foot_radius=0.01, body_height=0.12, neck_radius=0.014, shoulder_height=0.16,
        height=0.22, fill_height=0.15,
    ),
    Revolution(profile=((0.01, 0.09), (0.01, 0.0), (0.04, 0.0), (0.04, 0.09)), fill_height=0.06),
    Tray(width=0.2, depth=0.12, corner_radius=0.03, fill_height=0.04),
    HEXAGON,
    HALF_ROUND,
)  # fmt: skip


def numbers_of(model, n):
    assert isinstance(model.container, SolvedContainer)
    return model.container.numbers(n)


def revolved(points, **lengths):
    return Revolution(profile=tuple(points), **lengths)


def contour_eigenvalues(pieces, level):
    rows = axisymmetric.revolution_modes(pieces, level, 3)
    return [row.natural_frequency**2 * row.reach / GRAVITY for row in rows]


# ---- eigenvalues


def test_a_cone_of_45_degrees_is_exact():
    cone = Cone(top_radius=0.1, height=0.1, fill_height=0.06)
    assert cone.root(1) == pytest.approx(1.0, abs=1e-10)
    # Of φ = xz: X = N, V = π/3, and the pressure's moment by hand.
    assert cone.mass_ratio(1) == pytest.approx(0.75, rel=1e-9)
    assert cone.mass_height(1) == pytest.approx(-0.4 * 0.06, rel=1e-9)


@pytest.mark.first(2)
@pytest.mark.parametrize("level", [1.2, 1.5, 2.0, 4.0])
def test_hyperbolic_bowls_are_exact(level):
    """Tests hyperbolic bowls against the exact solution φ = xz (Troesch 1960)."""
    end = math.acosh(1.2 * level)
    bowl = Piece(lambda t: np.column_stack([np.sinh(end * t), np.cosh(end * t)]))
    found = contour_eigenvalues((bowl,), level)
    assert found[0] == pytest.approx(math.sqrt(level**2 - 1.0) / level, rel=1e-9)


MCIVER = {0.2: 1.07232, 0.6: 1.26251, 1.0: 1.56016, 1.4: 2.12320, 1.8: 3.95930}
OTHER_CASES = {
    "cone 30": (Cone(top_radius=math.tan(math.pi / 6), height=1.0, fill_height=0.5), 1.30439),
    "cone 60": (Cone(top_radius=math.tan(math.pi / 3), height=1.0, fill_height=0.5), 0.67768),
    "cup 0.7 1.5": (
        Frustum(bottom_radius=0.7, top_radius=1.06, height=1.8, fill_height=1.5), 1.64777,
    ),
    "wider below": (
        Frustum(bottom_radius=1.2, top_radius=0.96, height=1.2, fill_height=1.0), 1.87218,
    ),
    "ellipsoid": (Ellipsoid(radius=1.0, semi_height=0.5, fill_height=0.5), 1.08402),
}  # fmt: skip


@pytest.mark.first(2)
@pytest.mark.parametrize(("depth", "expected"), MCIVER.items())
def test_spheres_are_those_of_mciver(depth, expected):
    sphere = Sphere(radius=1.0, fill_height=depth)
    assert sphere.root(1) / sphere.size == pytest.approx(expected, rel=1e-5)


@pytest.mark.first(2)
@pytest.mark.parametrize("name", OTHER_CASES)
def test_cones_cups_and_bowls(name):
    container, expected = OTHER_CASES[name]
    assert container.root(1) == pytest.approx(expected, rel=2e-5)


def test_a_ring_has_the_roots_of_its_bessel_functions():
    from scipy.optimize import brentq
    from scipy.special import jvp, yvp

    def cross(k, inner=0.25):
        return jvp(1, k) * yvp(1, k * inner) - jvp(1, k * inner) * yvp(1, k)

    ring = revolved([(0.1, 1.0), (0.1, 0.0), (0.4, 0.0), (0.4, 1.0)], fill_height=0.6)
    for n, near in ((1, 1.64), (2, 5.0)):
        k = brentq(cross, near - 0.3, near + 0.4)
        assert ring.root(n) == pytest.approx(k * math.tanh(k * 1.5), rel=2e-6)


def test_the_order_on_a_smooth_contour():
    """Tests that halving the mesh size reduces the error to about a sixteenth."""
    sphere = Sphere(radius=1.0, fill_height=1.0)
    sides, size, _ = axisymmetric.region(sphere.contour, sphere.level)
    mesh, found = triangulated(sides, size), []
    for _ in range(4):
        rows, _ = axisymmetric._solved(finite_elements.curved(mesh, sides), 3)
        found.append(rows[:, 0])
        mesh = divided(mesh, sides)
    errors = np.abs(np.diff(found, axis=0))
    orders = np.log2(errors[:-1] / errors[1:])
    seen = errors[1:] > 1e-8  # below, rounding is as large
    assert seen[:, 1:].all()
    assert (orders[seen] > 3.5).all(), orders


# ---- closed forms


def test_a_cylinder_by_its_contour_is_the_cylinder():
    contour = Beaker(radius=R, foot_radius=1e-4, height=0.2, fill_height=0.07)
    exact = Cylinder(R, 0.07)
    sharp = revolved([(0.0, 0.0), (R, 0.0), (R, 0.2)], fill_height=0.07)
    for n in (1, 2, 3):
        assert sharp.natural_frequency(n) == pytest.approx(exact.natural_frequency(n), rel=1e-6)
        assert sharp.mass_ratio(n) == pytest.approx(exact.mass_ratio(n), rel=1e-6)
        assert sharp.curved_gain(n) == pytest.approx(exact.curved_gain(n), rel=1e-6)
        assert sharp.mass_height(n) == pytest.approx(exact.mass_height(n), rel=1e-6)
    assert contour.natural_frequency(1) == pytest.approx(exact.natural_frequency(1), rel=1e-4)
    assert sharp.volume == pytest.approx(exact.volume, rel=1e-9)


def test_its_damping_is_near_the_formula_for_a_cylinder():
    """Tests that the damping is close to the empirical formula for a cylinder."""
    for depth in (0.5, 1.0, 2.0):
        sharp = revolved([(0.0, 0.0), (R, 0.0), (R, 0.2)], fill_height=depth * R)
        formula = Cylinder(R, depth * R).damping_ratio(1e-6)
        assert sharp.damping_ratio(1e-6) == pytest.approx(formula, rel=0.08)


def test_a_prism_over_a_rectangle_is_the_rectangle():
    a, b = 0.09, 0.05
    prism = Prism(outline=((-a, -b), (a, -b), (a, b), (-a, b)), fill_height=0.06)
    exact = Rectangle(2 * a, 2 * b, 0.06)
    for axis in (0, 1):
        for n in (1, 2, 3):
            for of in ("natural_frequency", "mass_ratio", "curved_gain", "mass_height"):
                found, expected = getattr(prism, of)(n, axis), getattr(exact, of)(n, axis)
                assert found == pytest.approx(expected, rel=1e-6), (of, axis, n)
    walls = exact.damping_ratio(1e-6)  # Keulegan's, without film and bulk
    assert walls < prism.damping_ratio(1e-6) < 2.0 * walls


def test_a_prism_over_a_circle_is_the_cylinder():
    corners = np.linspace(0.0, 2.0 * math.pi, 65)[:-1]
    outline = tuple((R * math.cos(a), R * math.sin(a)) for a in corners.tolist())
    prism = Prism(outline=outline, smooth=True, fill_height=0.07)
    exact = Cylinder(R, 0.07)
    assert not prism.cornered
    assert prism.natural_frequency(1) == pytest.approx(exact.natural_frequency(1), rel=1e-6)
    assert prism.curved_gain(1) == pytest.approx(exact.curved_gain(1), rel=1e-4)


# ---- relations


@pytest.mark.first(4)
@pytest.mark.parametrize("container", SHAPES, ids=lambda one: f"{one.shape} {one.size:.3g}")
@pytest.mark.parametrize("axis", [0, 1])
def test_a_constant_acceleration_tilts_the_surface_as_gravity_does(container, axis):
    """Tests that a constant acceleration tilts the surface by η = -R a/g in any shape."""
    t = np.linspace(0.0, 30.0, 1501)
    acceleration = np.zeros((len(t), 3))
    acceleration[:, axis] = np.minimum(t / 5.0, 1.0)
    model = Model(container, damping_ratio=0.2, modes=2)
    response, _ = simulate(model, Inputs(t, acceleration))
    expected = -container.reaches[axis] / GRAVITY
    assert (response.sh_x, response.sh_y)[axis][-1] == pytest.approx(expected, rel=1e-9)


@pytest.mark.first(3)
@pytest.mark.parametrize("container", SHAPES, ids=lambda one: f"{one.shape} {one.size:.3g}")
def test_the_modes_share_static_tilt_and_mass(container):
    rows = [row for row in mode_table(Model(container), 3) if row.axis == "x"]
    shares, masses = [row.static_share for row in rows], [row.mass_ratio for row in rows]
    assert 0.7 < sum(shares) < 1.1
    assert all(mass > 0.0 for mass in masses)
    assert sum(masses) < 1.0


@pytest.mark.first(3)
@pytest.mark.parametrize("container", SHAPES, ids=lambda one: f"{one.shape} {one.size:.3g}")
def test_masses_and_frequencies_add_up_to_the_surface(container):
    """Tests that masses and frequencies satisfy Σ m g/ω² = ρ∫x²dS."""
    lifted = sum(
        container.mass_ratio(n) * container.volume * GRAVITY / container.natural_frequency(n) ** 2
        for n in (1, 2, 3)
    )
    if hasattr(container, "top"):
        inner = 0.01 if container.shape == "revolution" else 0.0
        exact = math.pi * (container.size**4 - inner**4) / 4.0
    else:
        exact = second_moment(container.contour)
    assert 0.97 * exact < lifted < exact


def second_moment(pieces):
    """Returns ∫x²dA over an outline by Green's theorem."""
    a = np.vstack([piece.at(np.linspace(0.0, 1.0, 501)[:-1]) for piece in pieces])
    b = np.roll(a, -1, axis=0)
    cross = a[:, 0] * b[:, 1] - b[:, 0] * a[:, 1]
    squares = a[:, 0] ** 2 + a[:, 0] * b[:, 0] + b[:, 0] ** 2
    return float((cross * squares).sum() / 12.0)


def test_a_container_twice_as_large_is_slower_by_the_root_of_two():
    large = Frustum(bottom_radius=0.056, top_radius=0.08, height=0.18, fill_height=0.12)
    for n in (1, 2, 3):
        ratio = CUP.natural_frequency(n) / large.natural_frequency(n)
        assert ratio == pytest.approx(math.sqrt(2.0), rel=1e-9)
        assert large.mass_ratio(n) == pytest.approx(CUP.mass_ratio(n), rel=1e-9)


def test_every_direction_of_a_hexagon_is_alike():
    assert not HEXAGON.cornered
    assert HALF_ROUND.cornered
    first, second = (HEXAGON.natural_frequency(1, axis) for axis in (0, 1))
    assert first == pytest.approx(second, rel=1e-5)


def test_a_bulb_is_highest_inside():
    """Tests that the surface in a bulb is highest away from the wall (high spots)."""
    bulb, bowl = Sphere(radius=R, fill_height=1.6 * R), Sphere(radius=R, fill_height=0.8 * R)
    ratio, place = bulb.crest(1)
    assert ratio > 1.05
    assert place < 0.9 * bulb.size
    assert bowl.crest(1) == (pytest.approx(1.0, abs=1e-9), pytest.approx(bowl.size))
    wall = bulb.wall
    assert wall.crest_inside
    assert wall.place(0.01).surface_height == pytest.approx(0.01 * ratio)
    assert wall.place(wall.height_at(0.002)).distance_to_rim == pytest.approx(0.002)
    assert not bowl.wall.crest_inside


def test_a_height_on_a_leaning_wall():
    place = CUP.wall.place(0.009)
    lean = math.hypot(0.012, 0.09) / 0.09
    assert place.height_along_wall == pytest.approx(0.009 * lean, rel=1e-9)
    assert place.contact_radius == pytest.approx(0.036 + 0.009 * 0.012 / 0.09, rel=1e-9)
    assert place.distance_to_rim == pytest.approx(0.021, rel=1e-9)
    assert place.distance_along_wall == pytest.approx(0.021 * lean, rel=1e-9)
    beyond = CUP.wall.place(0.05)
    assert math.isnan(beyond.height_along_wall)
    assert beyond.distance_to_rim == pytest.approx(-0.02)
    lower = CUP.wall.place(-0.009)
    assert lower.height_along_wall == pytest.approx(-0.009 * lean, rel=1e-9)


@pytest.mark.parametrize(
    "container", [Cylinder(0.04, 0.06, 0.11), Rectangle(0.2, 0.1, 0.03, 0.08), CUP]
)
def test_a_limit_is_a_height_or_a_distance_to_the_rim(container):
    free = container.freeboard
    assert container.height_below_rim() == pytest.approx(free)
    assert container.height_below_rim(0.01) == pytest.approx(free - 0.01)
    with pytest.raises(SloshModelError, match="the distance of the still liquid"):
        container.height_below_rim(free)


def test_a_distance_to_an_unknown_rim_is_refused():
    unknown = Cylinder(0.04, 0.06)
    assert unknown.height_below_rim() is None
    assert math.isnan(unknown.wall.place(0.01).distance_to_rim)
    with pytest.raises(SloshModelError, match="rim is not known"):
        unknown.height_below_rim(0.01)


# ---- dynamics


def test_the_motion_is_that_of_the_modal_equations():
    model = Model(CUP, modes=2).spatial()
    t = np.linspace(0.0, 1.0, 10001)
    sizes, rates = (2.0, 1.5, 1.0), (9.0, 17.0, 5.0)
    acceleration = np.column_stack([a * np.sin(w * t) for a, w in zip(sizes, rates, strict=True)])
    response, _ = simulate(model, Inputs(t, acceleration))
    rows = [CUP.numbers(n) for n in (1, 2)]
    height = np.zeros((len(t), 2))
    for axis in (0, 1):
        left = CUP.size / GRAVITY
        for row in rows:
            omega, zeta = row.natural_frequency, row.damping_ratio(1e-6)

            def rate(at, q, omega=omega, zeta=zeta, axis=axis):
                lift = 1.0 + sizes[2] * math.sin(rates[2] * at) / GRAVITY
                pull = omega**2 * lift * q[0] + 2.0 * zeta * omega * q[1]
                return [q[1], -pull - sizes[axis] * math.sin(rates[axis] * at)]

            done = solve_ivp(rate, (0.0, 1.0), [0.0, 0.0], "DOP853", t, rtol=1e-10, atol=1e-13)
            height[:, axis] += row.height_per_displacement * done.y[0]
            left -= row.height_per_displacement / omega**2
        lift = 1.0 + acceleration[:, 2] / GRAVITY
        height[:, axis] -= left * acceleration[:, axis] / lift
    found = np.column_stack([response.sh_x, response.sh_y])
    assert np.abs(found - height).max() < 1e-6 * np.abs(height).max()


def test_free_waves_keep_their_energy():
    t = np.arange(0.0, 5.0, 0.002)
    push = np.where(t < 0.2, 3.0, 0.0)
    motion = Inputs(t, np.column_stack([push, np.zeros_like(t), np.zeros_like(t)]))
    response, _ = simulate(Model(HEXAGON, damping_ratio=0.0), motion, max_step=0.0005)
    x, vx = response.modal[200:, 0, 0], response.modal[200:, 0, 2]
    energy = vx**2 + (HEXAGON.natural_frequency(1) * x) ** 2
    assert np.ptp(energy) < 1e-6 * energy.mean()


def test_many_motions_at_once_have_the_heights_of_each():
    t = np.arange(0.0, 1.0, 0.004)
    motion = Inputs(t, np.column_stack([np.sin(9.0 * t), np.cos(7.0 * t) - 1.0, 0.0 * t]))
    models = [Model(one).spatial() for one in (Cylinder(R, 0.07), CUP, SHAPES[8])]
    for model, found in zip(models, wall_heights(models, [motion] * 3), strict=True):
        response, _ = simulate(model, motion)
        expected = np.column_stack([response.sh_x, response.sh_y])
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)


def test_closed_forms_of_the_surface_are_refused():
    for of in (lambda m: surface_height(m, np.zeros((1, 4)), 1.0, 0.0),
               lambda m: rectangle_surface(m, np.zeros((1, 4)), 0.0)):  # fmt: skip
        with pytest.raises(SloshModelError, match="no closed form of the surface of a tray"):
            of(Model(SHAPES[8]))


def test_a_shape_by_one_class():
    """Tests that a new shape needs only one class with lengths and a contour."""

    @dataclass(frozen=True, kw_only=True, repr=False)
    class Goblet(RoundCup):
        shape: ClassVar[str] = "goblet"
        radius: float

        @property
        def contour(self):
            return arc((0.0, self.radius), (self.radius, self.radius), -math.pi / 2, 0.0), line(
                (self.radius, self.radius), (self.radius, 3.0 * self.radius)
            )

    try:
        model = parse_model("container: {shape: goblet, radius: 0.04, fill_height: 0.05}")
        assert model.container.freeboard == pytest.approx(0.07)
        assert model.natural_frequency_hz == pytest.approx(
            Model(Cylinder(0.04, 0.045)).natural_frequency_hz, rel=0.03
        )
        assert parse_model(format_model(model)) == model
    finally:
        del _SHAPES["goblet"]


@pytest.mark.parametrize(
    ("name", "instead"),
    [
        ("surface_nonlinearity", "its models are linear"),
        ("bound_modes", "leave the effect out"),
        ("surface_tension", "give natural_frequency"),
    ],
)
def test_effects_that_need_a_cylinder_are_refused(name, instead):
    with pytest.raises(SloshModelError, match=f"{name}' is not for a frustum: {instead}"):
        Model(CUP).with_effect(name)


@pytest.mark.parametrize(
    "container",
    [
        HEXAGON,
        pytest.param(CUP, marks=pytest.mark.long),
        pytest.param(Sphere(radius=R, fill_height=1.2 * R), marks=pytest.mark.long),
    ],
)
def test_modes_of_a_fill_height_near_by_are_interpolated(container):
    for delta in (-0.011, 0.004):
        filled = container.filled_to(container.fill_height + delta, None)
        exact = solved_modes(replace(filled, table=None), 3)
        for n in (1, 2, 3):
            one, other = filled.numbers(n), exact[n - 1]
            assert one.natural_frequency == pytest.approx(other.natural_frequency, rel=2e-4)
            assert one.height_per_displacement == pytest.approx(
                other.height_per_displacement, rel=2e-3
            )
        changed = Model(container).with_effect("fill_level", delta=delta)
        constants = changed.mode_constants()[0]
        assert constants.natural_frequency == pytest.approx(exact[0].natural_frequency, rel=2e-4)
    same = container.filled_to(container.fill_height, None)
    assert same.natural_frequency(1) == container.natural_frequency(1)


def test_nothing_linear_is_called_nonlinear():
    model = Model(CUP).spatial()
    assert model.nonlinear() == model
    assert model.nonlinear().name == "3D-L"
    assert 0.003 < CUP.linear_height < 0.01


# ---- model files


@pytest.mark.first(3)
@pytest.mark.parametrize("container", SHAPES, ids=lambda one: f"{one.shape} {one.size:.3g}")
def test_a_model_file_holds_the_modes(container, monkeypatch):
    model = Model(container, modes=2)
    text = format_model(model)
    expected = [replace(container.numbers(n), surface=()) for n in (1, 2)]

    def refuse(*_):
        raise AssertionError("computed again")

    monkeypatch.setattr(solver, "read", refuse)
    monkeypatch.setattr(type(container), "solved", refuse)
    solved_modes.cache_clear()
    again = parse_model(text)
    assert again == model
    assert again.modes == 2
    assert format_model(again) == text
    assert [numbers_of(again, n) for n in (1, 2)] == expected


def test_modes_of_another_fill_height_are_refused():
    text = format_model(Model(CUP)).replace("fill_height: 0.06", "fill_height: 0.05")
    with pytest.raises(SloshModelError, match=r"modes_of = .* belong to other dimensions"):
        parse_model(text)


@pytest.mark.parametrize(
    ("change", "refusal"),
    [
        ((r"reach: [^,]*", "reach: -1"), "reach = -1.0 must be above 0"),
        (("axis: x", "axis: r"), r"modes\[0\].axis = 'r' must be x or y"),
        (("mass_ratio: ", "mass: "), r"unknown key 'modes\[0\].mass'"),
        ((r"natural_frequency: [^,]*", "natural_frequency: .nan"), "must be a finite number"),
        (("modes_in_use: 1", "modes_in_use: 7"), "modes = 7 must lie in 1 … 6"),
    ],
)
def test_modes_that_cannot_be_are_refused(change, refusal):
    text = re.sub(change[0], change[1], format_model(Model(CUP)), count=1)
    with pytest.raises(SloshModelError, match=refusal):
        parse_model(text)


def test_closed_forms_take_no_list():
    with pytest.raises(SloshModelError, match="modes must be a number: those of a cylinder"):
        parse_model("container: {radius: 0.05, fill_height: 0.07}\nmodes: []")


@pytest.mark.parametrize("heading", ["z,r", "Height [m],Radius [m]", '"z";"r"', "# none\nz,r"])
def test_a_profile_whose_heading_names_the_height_first(tmp_path, heading):
    separator = ";" if ";" in heading else ","
    rows = ("0,0", "0,0.028", "0.09,0.04")
    text = "\n".join((heading, *(row.replace(",", separator) for row in rows)))
    (tmp_path / "cup.csv").write_text(text)
    read = points_of("cup.csv", ("container", "profile"), tmp_path)
    assert read == ((0.0, 0.0), (0.028, 0.0), (0.04, 0.09))


@pytest.mark.parametrize(
    ("heading", "rows"),
    [
        ("r [mm],z [mm]", ("0,0", "28,0", "40,90")),
        ("r (cm);z (cm)", ("0;0", "2,8;0", "4;9")),
        ("x_in,y_in", ("0,0", "1.1023622047,0", "1.5748031496,3.5433070866")),
        ("d,z", ("0,0", "0.056,0", "0.08,0.09")),
        ("Height [mm],Diameter [cm]", ("0,0", "0,5.6", "90,8")),
        ("z,y", ("0,0", "0,0.028", "0.09,0.04")),
    ],
)
def test_a_heading_says_units_diameters_and_order(tmp_path, heading, rows):
    (tmp_path / "cup.csv").write_text("\n".join((heading, *rows)))
    read = points_of("cup.csv", ("container", "profile"), tmp_path)
    np.testing.assert_allclose(read, [[0.0, 0.0], [0.028, 0.0], [0.04, 0.09]], rtol=1e-9)


@pytest.mark.parametrize(
    ("heading", "told"),
    [
        ("r [parsec],z", "the unit 'parsec' is unknown"),
        ("r,phi", "give the points as x and y"),
        ("one", "'one' is no line of two columns"),
    ],
)
def test_a_heading_that_cannot_be_read_is_named(tmp_path, heading, told):
    (tmp_path / "cup.csv").write_text(f"{heading}\n0,0\n0.028,0\n0.04,0.09\n")
    with pytest.raises(SloshModelError, match=told):
        points_of("cup.csv", ("container", "profile"), tmp_path)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "cp1252"])
def test_a_contour_in_the_encodings_of_spreadsheets(tmp_path, encoding):
    text = "# Ø außen\nr [mm],z [mm]\n" + "".join(f"{28 + k / 10},{k}\n" for k in range(40))
    (tmp_path / "cup.csv").write_bytes(text.encode(encoding))
    read = points_of("cup.csv", ("container", "profile"), tmp_path)
    np.testing.assert_allclose(read[:2], [[0.028, 0.0], [0.0281, 0.001]], rtol=1e-12)
    assert len(read) == 40


def test_a_circle_of_many_points_is_the_cylinder():
    turn = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
    points = tuple(
        zip((0.035 * np.cos(turn)).tolist(), (0.035 * np.sin(turn)).tolist(), strict=True)
    )
    prism = parse_model(
        f"container: {{shape: prism, outline: {[list(p) for p in points]}, fill_height: 0.06}}"
    ).container
    round_one = parse_model("container: {radius: 0.035, fill_height: 0.06}").container
    assert prism.natural_frequency(1) == pytest.approx(round_one.natural_frequency(1), rel=1e-4)


def test_a_profile_on_one_upright_line_is_refused(tmp_path):
    text = "container: {shape: revolution, profile: [[0, 0], [0, 0.1]], fill_height: 0.06}"
    with pytest.raises(SloshModelError, match="no width: all points lie on one upright line"):
        parse_model(text)


def test_a_profile_in_a_file(tmp_path):
    (tmp_path / "cup.csv").write_text("r,z\n0,0\n0.028,0\n0.04,0.09\n")
    text = "container: {shape: revolution, profile: cup.csv, fill_height: 0.06}"
    (tmp_path / "model.yaml").write_text(text)
    model = Model.load(tmp_path / "model.yaml")
    assert model.container.natural_frequency(1) == pytest.approx(
        CUP.natural_frequency(1), rel=1e-9
    )
    (tmp_path / "cup.csv").write_text("r,z\n0,0\n0.028,wide\n")
    with pytest.raises(SloshModelError, match=r"cup.csv:3: '0.028,wide' must be two numbers"):
        Model.load(tmp_path / "model.yaml")
    (tmp_path / "cup.csv").unlink()
    with pytest.raises(SloshModelError, match=r"model.yaml:1: container.profile: .*cup.csv"):
        Model.load(tmp_path / "model.yaml")


def test_a_profile_from_the_rim_to_the_floor_is_the_same():
    points = ((0.0, 0.0), (0.028, 0.0), (0.04, 0.09))
    assert revolved(points[::-1], fill_height=0.06) == revolved(points, fill_height=0.06)


@pytest.mark.parametrize(
    ("container", "refusal"),
    [
        ("shape: revolution, profile: [[0, 0], [0.03, 0], [0.04, 0.09]], fill_height: 0.1", "rim"),
        ("shape: revolution, profile: [[0, 0], [-0.03, 0], [0.04, 0.09]], fill_height: 0.05",
         r"profile\[1\]: r = -0.03 m must not be below 0"),
        ("shape: revolution, profile: [[0, 0], [30, 0], [40, 90]], fill_height: 0.05",
         "divide millimetres by 1000"),
        ("shape: revolution, profile: [[0.01, 0], [0.03, 0], [0.04, 0.09]], fill_height: 0.05",
         "the floor is open"),
        ("shape: revolution, profile: [[0, 0], [0.04, 0], [0.04, 0.05], [0.02, -0.02], "
         "[0.05, 0.09]], fill_height: 0.05", "crosses itself near"),
        ("shape: revolution, profile: [[0, 0]], fill_height: 0.05", "has 1 points"),
        ("shape: revolution, profile: [[0, 0], [0.03]], fill_height: 0.05", r"must be a pair"),
        ("shape: revolution, profile: [[0, 0], [0.03, .nan]], fill_height: 0.05", "finite"),
        ("shape: revolution, profile: 7, fill_height: 0.05", "must be a list of pairs"),
        ("shape: revolution, profile: [[0, 0], [0.03, 0]], fill_height: 0.05, smooth: 1",
         "smooth = 1 must be true or false"),
        ("shape: prism, outline: [[0, 0], [0.1, 0.1], [0.1, 0], [0, 0.2]], fill_height: 0.05",
         "crosses itself"),
        ("shape: prism, outline: [[0, 0], [0.1, 0], [0.05, 0]], fill_height: 0.05",
         "touches itself"),
        ("shape: beaker, radius: 0.03, foot_radius: 0.04, height: 0.1, fill_height: 0.05",
         "foot_radius = 0.04 m must be below radius"),
        ("shape: tray, width: 0.1, depth: 0.05, corner_radius: 0.03, fill_height: 0.05",
         "below half"),
        ("shape: frustum, bottom_radius: 28, top_radius: 0.04, height: 0.09, fill_height: 0.05",
         "did you mean 28 mm"),
        ("shape: frustum, bottom_radius: 0.028, top_radius: 0.04, height: 0.09, "
         "fill_height: 0.05, rim_height: 0.2", "above the contour's end"),
        ("shape: frustum, top_radius: 0.04, height: 0.09, fill_height: 0.05", "is missing"),
    ],
)  # fmt: skip
def test_containers_that_cannot_be_are_refused_in_one_line(container, refusal):
    with pytest.raises(SloshModelError, match=refusal) as caught:
        parse_model(f"container: {{{container}}}", "cup.yaml")
    assert str(caught.value).startswith("cup.yaml:1: ")
    assert "\n" not in str(caught.value)


def test_without_the_library_known_modes_suffice(monkeypatch):
    text = format_model(Model(CUP))
    monkeypatch.setattr(finite_elements, "available", lambda: False)
    finite_elements.library.cache_clear()
    solved_modes.cache_clear()
    monkeypatch.setattr(solver, "read", lambda _: None)
    assert numbers_of(parse_model(text), 1)
    with pytest.raises(SloshModelError, match=r"pip install -r requirements/modes\.txt"):
        parse_model("container: {shape: sphere, radius: 0.05, fill_height: 0.031}")
    monkeypatch.undo()
    finite_elements.library.cache_clear()


def test_a_straight_line_is_a_straight_line():
    piece = line((0.0, 0.0), (1.0, 2.0))
    assert piece.shares_at(1.0, 1) == pytest.approx([0.5])
    assert piece.part(1.0, 0.0).one(0.0).tolist() == [1.0, 2.0]
