"""Computes the sloshing modes of troughs by plane eigenvalue problems.

Between vertical end walls at x = ±L/2 the potential is φ = ψ(y, z) sin kx with k = nπ/L, n odd,
and ψ even in y: longitudinal modes, which an acceleration along x drives. With k = 0 and ψ odd in
y it is a transverse mode. For all v (Faltinsen & Timokha, *Sloshing*, 2009, ch. 4)

    ∫ (∇ψ·∇v + k²ψv) dA = λ ∫ ψv dy,

on the left over half of the liquid's section, on the right over its surface. All other modes, n
even or ψ odd with n ≥ 1, exert no net force. Masses, heights and damping are those of
`axisymmetric`; the integrals along x are in closed form.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from slosh_base.types import Array
from slosh_model.constants import GRAVITY
from slosh_model.shapes.contour import Piece
from slosh_model.shapes.mode_numbers import FILM, LEAST, ModeNumbers
from slosh_shapes.axisymmetric import region
from slosh_shapes.finite_elements import (
    bases,
    library,
    limit,
    lowest,
    refined,
    solver,
)
from slosh_shapes.tuning import TUNING

LAMBDA, MASS, HEIGHT, PLACE, LAYER, BULK, SHARE = range(7)
"""Numbers of a mode, in lengths of half the surface's width: λ, mass share, height at the wall per
displacement, height of the mass above the still surface, both damping terms, and its share in the
square of a plane surface."""
_DRIVEN = 1e-4
"""Share in a plane surface below which a mode of more than one wave is left out: its height under
a constant acceleration is about 1 % of the whole, and nothing where the walls are vertical."""
_NONE = 1e-12
"""Share of rounding errors: a transverse mode has no mass then, as all but one at 45 deg."""
_ALONG = 41
"""Places along x at which a longitudinal mode's height is given."""


def trough_modes(
    half: Sequence[Piece], level: float, length: float, count: int
) -> tuple[ModeNumbers, ...]:
    """Computes the first sloshing modes of a trough along x, then as many along y.

    Args:
        half: right half of its section, from the floor's middle to the rim [m].
        level: height of the still surface in it [m].
        length: between the end walls [m].
        count: number of modes along each axis.

    Raises:
        SloshModelError: scikit-fem is missing, or the section is too intricate.
    """
    _, _, width = region(half, level)
    long = length / width
    # m is the number of half waves across; more along x leave room for fewer of those.
    keys = [(n, m) for i, n in enumerate(range(1, 2 * count, 2)) for m in range(count - i)]
    watched = [row for row, (n, m) in enumerate(keys) if n // 2 + m < LEAST]
    watched += range(len(keys), len(keys) + min(count, LEAST))
    shortest = (2 * count - 1) * math.pi / long
    wanted = shortest / TUNING.wave_part
    parts = max(TUNING.surface_parts, min(wanted, TUNING.most_parts))
    # The short waves of a short trough would take long to stand.
    divisions = TUNING.most_divisions - (2.0 * wanted > parts)
    sides, size, _ = region(half, level, parts)
    numbers, surface = refined(
        sides, size, lambda mesh: _solved(mesh, long, keys, count),
        change=TUNING.change, most=divisions, watched=watched,
    )  # fmt: skip
    rows = limit(numbers)
    order = np.argsort(rows[: len(keys), LAMBDA], kind="stable").tolist()
    along = [row for row in order if keys[row][1] == 0 or rows[row, SHARE] > _DRIVEN][:count]
    across = list(range(len(keys), len(keys) + count))
    places, shapes = surface
    found = [_longitudinal(rows[row], width, long, keys[row][0], shapes[row]) for row in along]
    found += [_mode(1, rows[row], width, width, places, shapes[row]) for row in across]
    return tuple(found)


def _longitudinal(
    row: Array, width: float, long: float, half_waves: int, shape: Array
) -> ModeNumbers:
    """Returns a mode along x, whose heights across an end wall are given by `shape`."""
    share = np.linspace(0.0, 1.0, _ALONG)
    wave = np.sin(0.5 * half_waves * math.pi * share) * math.sin(0.5 * half_waves * math.pi)
    # Its highest place is at an end wall; where on it does not matter for a distance along x.
    return _mode(0, row, width, 0.5 * long * width, 0.5 * long * share, wave, float(shape.max()))


def _mode(
    axis: int, row: Array, width: float, reach: float, places: Array, shape: Array,
    higher: float = 0.0,
) -> ModeNumbers:  # fmt: skip
    """Returns a mode's constants in SI units, from lengths relative to half the surface width."""
    omega = math.sqrt(GRAVITY * float(row[LAMBDA]) / width)
    return ModeNumbers(
        axis=axis,
        natural_frequency=omega,
        reach=reach,
        mass_ratio=float(row[MASS]),
        height_per_displacement=float(row[HEIGHT]),
        mass_height=float(row[PLACE] * width),
        crest_ratio=max(float(np.abs(shape).max()), higher),
        crest_place=float(places[np.argmax(np.abs(shape))] * width),
        layer_damping=float(row[LAYER]) / (width * math.sqrt(2.0 * omega)),
        bulk_damping=float(row[BULK]) / (width * width * omega),
        surface=tuple(
            (float(width * y), float(h))
            for y, h in zip(places.tolist(), shape.tolist(), strict=True)
        ),
    )


def _solved(
    mesh: Any, long: float, keys: Sequence[tuple[int, int]], count: int
) -> tuple[Array, tuple[Array, Array]]:
    """Solves the eigenvalue problems on a mesh; returns mode constants and surface shapes."""
    parts = _Integrals.over(mesh)
    rows: list[tuple[float, ...]] = []
    shapes, edge = [], -1
    for n, group in itertools.groupby(keys, lambda key: key[0]):
        k = n * math.pi / long
        values, vectors = lowest(
            parts.stiffness + k * k * parts.area, parts.surface, len(list(group))
        )
        for value, psi in zip(values.tolist(), vectors.T, strict=True):
            on_surface = psi[parts.dofs]
            if not rows:  # heights are given where the first mode is highest: middle or edge
                edge = -1 if abs(on_surface[-1]) >= abs(on_surface[0]) else 0
            scaled = psi / on_surface[edge]
            rows.append(parts.longitudinal(value, scaled, k, long))
            shapes.append(scaled[parts.dofs])
    free = parts.off_axis
    values, vectors = lowest(parts.stiffness[free][:, free], parts.surface[free][:, free], count)
    for value, some in zip(values.tolist(), vectors.T, strict=True):
        psi = np.zeros(parts.stiffness.shape[0])
        psi[free] = some
        psi /= psi[parts.dofs[-1]]
        rows.append(parts.transverse(value, psi, long))
        shapes.append(psi[parts.dofs])
    return np.array(rows), (parts.places, np.array(shapes))


@dataclass(frozen=True, slots=True, eq=False)
class _Integrals:
    """Finite-element matrices and vectors of integrals over half of a trough's cross-section.

    Attributes:
        slopes: (2, 2) ∫ψ_i v_j dA, i and j of y, z.
        stiffness: ∫∇ψ·∇v dA.
        area, surface, wall: ∫ψv over the section, the surface's line and the wall's.
        along_surface, along_wall: ∫ψ_s v_s over these lines.
        loads: (2,) ∫ψ_i v dA, from which continuous slopes follow.
        heights, offsets, arms: ∫v dy and ∫yv dy over the surface, ∫zv dA over the section.
        lift, moment: ∮v n_z ds and ∮v (z n_y - y n_z) ds over the wall.
        size: the section's area.
        dofs, places: of the surface, from the middle outwards.
        off_axis: of the section, without its middle line.
        continuous: loads to continuous fields.
    """

    slopes: list[list[Any]]
    stiffness: Any
    area: Any
    surface: Any
    wall: Any
    along_surface: Any
    along_wall: Any
    loads: list[Any]
    heights: Array
    offsets: Array
    arms: Array
    lift: Array
    moment: Array
    size: float
    dofs: Array
    places: Array
    off_axis: Array
    continuous: Callable[[Array], Array]

    @classmethod
    def over(cls, mesh: Any) -> _Integrals:
        """Assembles the integrals over a mesh of half of the section."""
        fem = library()
        inside, surface, wall = bases(mesh, "surface", "wall")

        def both(form: Any, basis: Any = inside) -> Any:
            return fem.BilinearForm(form).assemble(basis)

        def one(form: Any, basis: Any = inside) -> Any:
            return fem.LinearForm(form).assemble(basis)

        def along(u: Any, v: Any, w: Any) -> Any:
            tangent = (-w.n[1], w.n[0])
            first, second = (f.grad[0] * tangent[0] + f.grad[1] * tangent[1] for f in (u, v))
            return first * second

        def product(u: Any, v: Any, _: Any) -> Any:
            return u * v

        slopes = [
            [both(lambda u, v, _, i=i, j=j: u.grad[i] * v.grad[j]) for j in (0, 1)] for i in (0, 1)
        ]
        area = both(product)
        dofs = np.unique(surface.get_dofs(mesh.boundaries["surface"]).flatten())
        dofs = dofs[np.argsort(mesh.doflocs[0, dofs])]
        return cls(
            slopes=slopes,
            stiffness=slopes[0][0] + slopes[1][1],
            area=area,
            surface=both(product, surface),
            wall=both(product, wall),
            along_surface=both(along, surface),
            along_wall=both(along, wall),
            loads=[both(lambda u, v, _, i=i: u.grad[i] * v) for i in (0, 1)],
            heights=one(lambda v, _: 1.0 * v, surface),
            offsets=one(lambda v, w: w.x[0] * v, surface),
            arms=one(lambda v, w: w.x[1] * v),
            lift=one(lambda v, w: w.n[1] * v, wall),
            moment=one(lambda v, w: (w.x[1] * w.n[0] - w.x[0] * w.n[1]) * v, wall),
            size=float(fem.Functional(lambda w: 1.0 + 0.0 * w.x[0]).assemble(inside)),
            dofs=dofs,
            places=mesh.doflocs[0, dofs],
            continuous=solver(area),
            off_axis=inside.complement_dofs(inside.get_dofs(mesh.boundaries["axis"])),
        )

    def longitudinal(self, value: float, psi: Array, k: float, long: float) -> tuple[float, ...]:
        """Returns the constants of a longitudinal mode from its eigenvalue λ and shape ψ.

        Its integrals along x are those of sin²kx, L/2, and of x sin kx, ±2/k²; at the end walls
        sin kx is ±1, with the same sign.
        """
        norm, squares = float(psi @ (self.surface @ psi)), k * k
        reach = 2.0 / squares * float(self.heights @ psi)
        slope = float(psi @ (self.stiffness @ psi))
        moment = 2.0 * float(self.arms @ psi) - 2.0 / squares * float(self.lift @ psi)
        layer = _form(psi, self.along_wall) + squares * _form(psi, self.wall)
        layer += FILM * (_form(psi, self.along_surface) + squares * norm)
        bent, mixed = self._bent(psi), 2.0 * squares * slope
        volume, whole = self.size * long, 0.5 * long * norm
        return (
            value,
            value * reach * reach / (whole * volume),
            value * reach / whole,
            moment / (value * reach) - 1.0 / value,
            0.5 * (layer + 4.0 * slope / long) / (value * norm),
            (bent + squares * squares * _form(psi, self.area) + mixed) / (value * norm),
            reach * reach / (whole * long**3 / 12.0),
        )

    def transverse(self, value: float, psi: Array, long: float) -> tuple[float, ...]:
        """Returns the constants of a transverse mode from its eigenvalue λ and shape ψ."""
        norm, reach = float(psi @ (self.surface @ psi)), float(self.offsets @ psi)
        layer = _form(psi, self.along_wall) + FILM * _form(psi, self.along_surface)
        slope, share = value * norm, 3.0 * reach * reach / norm
        place = float(self.moment @ psi) / (value * reach) - 1.0 / value if share > _NONE else 0.0
        return (
            value,
            value * max(share, _NONE) / 3.0 / self.size,
            value * reach / norm if share > _NONE else 0.0,
            place,
            0.5 * (layer + 2.0 * slope / long) / slope,
            self._bent(psi) / slope,
            share,
        )

    def _bent(self, psi: Array) -> float:
        """Returns the integral ∫|∇∇ψ|² dA over the trough's section."""
        y, z = (self.continuous(load @ psi) for load in self.loads)
        (yy, yz), (zy, zz) = self.slopes
        mixed = _form(y, zz) + _form(z, yy) + float(y @ ((yz + zy.T) @ z))
        return _form(y, yy) + _form(z, zz) + 0.5 * mixed


def _form(psi: Array, matrix: Any) -> float:
    return float(psi @ (matrix @ psi))
