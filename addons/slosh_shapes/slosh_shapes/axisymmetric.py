"""Computes the sloshing modes of bodies of revolution by an eigenvalue problem.

The potential φ(r, z) cos θ of the liquid obeys Laplace's equation, no flow crosses the wall, and
at the still surface ∂φ/∂z = λφ with λ = ω²/g (Faltinsen & Timokha, *Sloshing*, 2009, ch. 4). With
φ = r u, which makes u regular on the axis, the weak form for all v is

    ∫ [(u + r u_r)(v + r v_r) + r² u_z v_z + u v] r dA = λ ∫ r³ u v dr,

on the left over the meridian's half of the liquid, on the right over its surface. From a mode,
with f = φ at the surface, N = π∫ f² r dr, X = π∫ f r² dr and the liquid's volume V, follow (ibid.,
ch. 5)

    mass share λX²/(NV),  height per displacement λX f/N,  static share X f(R)/(N R),

and from the moment of the pressure on the wall the height of the mass (Dodge 2000, ch. 3).
Damping: the layer at the wall (Keulegan 1959) and the bulk (Lamb 1932, § 348),

    ζ = ½ √(ν/2ω) ∫|∇φ|² dS / ∫|∇φ|² dV + (ν/ω) ∫|∇∇φ|² dV / ∫|∇φ|² dV,

where dS covers the wall, and a share of the surface: what has been in the air has a film, and one
that does not yield has a layer as the wall has (Miles, Proc. R. Soc. A 297, 1967).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from slosh_base.types import Array
from slosh_model.constants import GRAVITY
from slosh_model.shapes.contour import Piece, ends_at, line, wetted
from slosh_model.shapes.mode_numbers import FILM, ModeNumbers
from slosh_shapes.finite_elements import (
    bases,
    library,
    limit,
    lowest,
    refined,
    scaled,
    solver,
)
from slosh_shapes.mesh import Side, Size, graded
from slosh_shapes.sizes import bending, sharp_corners
from slosh_shapes.tuning import TUNING

LAMBDA, MASS, HEIGHT, PLACE, LAYER, BULK = range(6)
"""Numbers of a mode, in lengths of R: λ, mass share, height at the wall per displacement, height
of the mass above the still surface, and both damping terms."""


def revolution_modes(
    profile: Sequence[Piece], level: float, count: int
) -> tuple[ModeNumbers, ...]:
    """Computes the first sloshing modes of a body of revolution.

    Args:
        profile: from the floor's centre, or a core's top, to the rim [m].
        level: height of the still surface in it [m].
        count: number of modes.

    Raises:
        SloshModelError: an impossible contour, or scikit-fem is missing.
    """
    sides, size, radius = region(profile, level)
    numbers, surface = refined(
        sides, size, lambda mesh: _solved(mesh, count),
        change=TUNING.change, most=TUNING.most_divisions,
    )  # fmt: skip
    rows = limit(numbers)
    omega = np.sqrt(GRAVITY * rows[:, LAMBDA] / radius)
    # ζ in units of √ν and ν, from lengths of R.
    layers = rows[:, LAYER] / (radius * np.sqrt(2.0 * omega))
    bulk = rows[:, BULK] / (radius * radius * omega)
    places, shapes = surface
    return tuple(
        ModeNumbers(
            axis=0,
            natural_frequency=float(omega[n]),
            reach=radius,
            mass_ratio=float(rows[n, MASS]),
            height_per_displacement=float(rows[n, HEIGHT]),
            mass_height=float(rows[n, PLACE] * radius),
            crest_ratio=float(np.abs(shapes[n]).max()),
            crest_place=float(places[np.argmax(np.abs(shapes[n]))] * radius),
            layer_damping=float(layers[n]),
            bulk_damping=float(bulk[n]),
            surface=tuple(
                (float(radius * r), float(h))
                for r, h in zip(places.tolist(), shapes[n].tolist(), strict=True)
            ),
        )
        for n in range(count)
    )


def region(
    profile: Sequence[Piece], level: float, parts: float = TUNING.surface_parts
) -> tuple[list[Side], Size, float]:
    """Returns half of the liquid's meridian section, scaled by R, and initial mesh sizes.

    Args:
        profile: from the floor's centre, or a core's top, to the rim [m].
        level: height of the still surface in it [m].
        parts: number of first triangles across the surface.

    Returns:
        sides "wall", "surface" and "axis"; the size; R, the surface's outer radius [m].
    """
    chain = wetted(profile, level)
    radius = float(chain[-1].one(1.0)[0])
    chain = tuple(scaled(piece, np.array([0.0, level]), radius) for piece in chain)
    start, end = ends_at(chain)
    inner = float(start[0]) if start[1] > -1e-9 else 0.0
    sides = [Side(piece, "wall") for piece in chain]
    sides.append(Side(line((float(end[0]), 0.0), (inner, 0.0)), "surface"))
    if start[1] < -1e-9:
        sides.append(Side(line((0.0, 0.0), (0.0, float(start[1]))), "axis"))
    return sides, _size(sides, (1.0 - inner) / parts), radius


def _size(sides: Sequence[Side], base: float) -> Size:
    """Returns a mesh size function that is fine at the surface, at bends and at corners."""
    annular = all(side.name != "axis" for side in sides)
    places, sizes = [], []
    t = np.linspace(0.0, 1.0, 65)
    for side in sides:
        at = side.piece.at(t)
        own = np.full(len(t), base)
        if side.name == "wall":
            # Waves die out with depth; the gap to the surface bounds the size near the contact.
            depth = np.maximum(-at[:, 1], 0.0)
            own = np.maximum(base + TUNING.growth * depth, base)
            if not side.piece.straight:
                bend = np.maximum(TUNING.bend * bending(at), TUNING.deep_bend * depth)
                own = np.minimum(own, bend)
            if annular:
                own = np.minimum(own, TUNING.core * at[:, 0])
            own = np.minimum(own, np.maximum(TUNING.gap * depth, TUNING.narrowest * base))
        if side.name != "axis":
            places.append(at)
            sizes.append(own)
    for place, share in sharp_corners(sides):
        places.append(place[None])
        # What is wrong there reaches the surface as the wave reaches down, e^(-ξ depth) at most.
        share = min(share * np.exp(-TUNING.fading * place[1]), 1.0)
        sizes.append(np.array([share * (base - TUNING.growth * place[1])]))
    return graded(np.vstack(places), np.concatenate(sizes))


def _solved(mesh: Any, count: int) -> tuple[Array, tuple[Array, Array]]:
    """Solves the eigenvalue problem on a mesh; returns mode constants and surface shapes."""
    fem = library()
    inside, surface, wall = bases(mesh, "surface", "wall")

    def energy(u: Any, v: Any, w: Any) -> Any:
        r = w.x[0]
        along = (u + r * u.grad[0]) * (v + r * v.grad[0])
        return r * (along + r * r * u.grad[1] * v.grad[1] + u * v)

    stiffness = fem.BilinearForm(energy).assemble(inside)
    mass = fem.BilinearForm(lambda u, v, w: w.x[0] ** 3 * u * v).assemble(surface)
    values, vectors = lowest(stiffness, mass, count)
    volume = 2.0 * fem.Functional(lambda w: w.x[0]).assemble(inside)
    offset = fem.LinearForm(lambda v, w: w.x[0] ** 3 * v).assemble(surface)
    on_wall, film = _Wall(fem, wall), fem.Functional(_along_surface)
    continuous = solver(fem.BilinearForm(lambda u, v, w: u * v).assemble(inside))
    dofs = np.unique(surface.get_dofs(mesh.boundaries["surface"]).flatten())
    radii = mesh.doflocs[0, dofs]
    order = np.argsort(radii)
    dofs, radii = dofs[order], radii[order]
    rows, shapes = [], []
    for n in range(count):
        u = vectors[:, n]
        shape = radii * u[dofs]
        u, shape = u / shape[-1], shape / shape[-1]
        norm, reach = float(u @ (mass @ u)), float(offset @ u)
        kinetic = float(u @ (stiffness @ u))
        moment, layer = on_wall.of(u)
        layer += FILM * float(film.assemble(surface, u=surface.interpolate(u)))
        rows.append(
            (
                values[n],
                values[n] * reach**2 / (norm * volume),
                values[n] * reach / norm,
                moment / (values[n] * reach) - 1.0 / values[n],
                0.5 * layer / kinetic,
                _bulk(fem, inside, u, continuous) / kinetic,
            )
        )
        shapes.append(shape)
    return np.array(rows), (radii, np.array(shapes))


def _along_surface(w: Any) -> Any:
    """Returns the integrand |∇φ|² r of the velocity along the still surface."""
    r, u = w.x[0], w["u"]
    return r * ((u + r * u.grad[0]) ** 2 + u * u)


class _Wall:
    """Finite-element integrals of the velocity potential over the container's wall."""

    def __init__(self, fem: Any, basis: Any) -> None:
        self._basis = basis

        def moment(w: Any) -> Any:
            r, z = w.x
            return r * r * w["u"] * (z * w.n[0] - r * w.n[1])

        def layer(w: Any) -> Any:
            r, u = w.x[0], w["u"]
            along = w.n[0] * (r * u.grad[1]) - w.n[1] * (u + r * u.grad[0])
            return r * (along**2 + u * u)

        self._moment, self._layer = fem.Functional(moment), fem.Functional(layer)

    def of(self, u: Array) -> tuple[float, float]:
        """Returns the wall integrals for the moment, φ (z n_r − r n_z) r, and damping, |∇φ|² r."""
        known = self._basis.interpolate(u)
        moment, layer = (
            form.assemble(self._basis, u=known) for form in (self._moment, self._layer)
        )
        return float(moment), float(layer)


def _bulk(fem: Any, basis: Any, u: Array, continuous: Callable[[Array], Array]) -> float:
    """Returns the integral of |∇∇φ|² r over the liquid's section."""
    grad, load = basis.interpolate(u).grad, fem.LinearForm(lambda v, w: w["slope"] * v)
    slopes = [continuous(load.assemble(basis, slope=grad[k])) for k in range(2)]

    def rate(w: Any) -> Any:
        r, u_r, u_z = w.x[0], w["slope_r"], w["slope_z"]
        rr = 2.0 * u_r + r * u_r.grad[0]
        rz = u_z + 0.5 * r * (u_r.grad[1] + u_z.grad[0])
        zz = -(rr + u_r)
        return r * (rr**2 + zz**2 + 2.0 * rz**2 + 3.0 * u_r**2 + 2.0 * u_z**2)

    fields = {"slope_r": basis.interpolate(slopes[0]), "slope_z": basis.interpolate(slopes[1])}
    return float(fem.Functional(rate).assemble(basis, **fields))
