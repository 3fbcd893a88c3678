"""Constants of the sloshing modes of a prism's outline, independent of the depth."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from slosh_base.types import Array
from slosh_model.errors import SloshModelError
from slosh_shapes.finite_elements import library, lowest

SQUARE, NORM, OFFSET, HEIGHT, ALONG, AROUND = range(6)
"""Of a mode: k², ∫F² and ∫xF over what is computed, F where heights are given, ∮F_s², ∮F²."""
OFFSET_Y = 6
"""And ∫yF, of an outline without symmetry."""
DRIVEN = 1e-6
"""Share of a mode in a straight surface below which no acceleration drives it."""
MOST_SEARCHED = 200
Families = Sequence[list[tuple[float, Array]]]
"""Modes by the axis along which they are driven: k² and F of each."""
_SAME = 2e-3
"""Relative difference of k² below which two modes count as of one frequency."""
_SPARE = 4
"""Modes that are asked for beyond the last driven one, lest their order differs on a mesh."""


class PlaneModes(NamedTuple):
    """The sloshing modes along one axis of an outline, for any depth, in scaled lengths.

    Attributes:
        axis: 0 along x, 1 along y.
        scale: the unit of length [m].
        rows: a row of numbers for each mode.
        area: of the outline.
        reaches: where heights are given, from the centre along each mode's direction.
        crests: the largest height of each over that at the wall.
        turns: azimuth of each mode's motion, from the axis [rad].
    """

    axis: int
    scale: float
    rows: Array
    area: float
    reaches: list[float]
    crests: list[float]
    turns: list[float]


def plane_matrices(inside: Any) -> tuple[Any, Any]:
    """Returns the finite-element matrices of ∫∇u·∇v and ∫uv over the surface."""
    fem = library()
    stiffness = fem.BilinearForm(lambda u, v, w: u.grad[0] * v.grad[0] + u.grad[1] * v.grad[1])
    mass = fem.BilinearForm(lambda u, v, w: u * v)
    return stiffness.assemble(inside), mass.assemble(inside)


class DrivenModes:
    """Finds the lowest modes that a horizontal acceleration excites, on one mesh after another.

    Of a long outline, those across it come after hundreds along it. Where they lie among them is
    found on the first, coarse mesh; the finer ones ask for as many modes as they need.

    Args:
        count: number of modes of each family.
        each: modes that are asked for at first for each of these.
    """

    def __init__(self, count: int, each: int) -> None:
        self._count = count
        self._wanted = each * count

    def lowest(
        self, stiffness: Any, mass: Any, families: Callable[[Array, Array], Families]
    ) -> Families:
        """Returns the lowest driven modes, by group (such as axis).

        Asks for more modes until enough of them are driven.

        Args:
            stiffness, mass: of the eigenvalue problem.
            families: chooses and groups the driven ones by eigenvalues and vectors with ∫F² = 1.

        Raises:
            SloshModelError: too few of the first MOST_SEARCHED modes are driven.
        """
        most = min(MOST_SEARCHED, stiffness.shape[0] - 2)
        while True:
            wanted = min(self._wanted, most)
            values, vectors = lowest(stiffness, mass, wanted, below=-1.0)
            vectors = vectors / np.sqrt((vectors * (mass @ vectors)).sum(axis=0))
            found = families(values, vectors)
            fewest = min(map(len, found))
            if fewest >= self._count:
                chosen = [family[: self._count] for family in found]
                last = max(family[-1][0] for family in chosen)
                self._wanted = min(wanted, int(np.sum(values <= last * (1.0 + _SAME))) + _SPARE)
                return chosen
            if wanted == most:
                raise SloshModelError(
                    f"modes: only {fewest} of the first {wanted} of this outline are driven by an "
                    "acceleration along each axis; ask for fewer modes",
                    ("modes",),
                )
            self._wanted = 2 * wanted


def area_of(inside: Any) -> float:
    """Returns the area or length of the region that a finite-element basis covers."""
    return float(library().Functional(lambda w: 1.0 + 0.0 * w.x[0]).assemble(inside))


def along_wall(wall: Any, f: Array) -> tuple[float, float]:
    """Returns the integrals of (dF/ds)² and F² along the wall, for a mode's surface shape F."""
    fem, known = library(), wall.interpolate(f)
    around = fem.Functional(lambda w: w["f"] ** 2)
    slope = fem.Functional(lambda w: (w.n[0] * w["f"].grad[1] - w.n[1] * w["f"].grad[0]) ** 2)
    return float(slope.assemble(wall, f=known)), float(around.assemble(wall, f=known))


def of_one_frequency(values: Array) -> list[Array]:
    """Returns the indices of eigenvalues in groups of almost equal ones."""
    steps = np.diff(values) > _SAME * np.maximum(values[1:], 1e-3)
    return np.split(np.arange(len(values)), np.flatnonzero(steps) + 1)
