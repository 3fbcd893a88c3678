"""Finite elements for both eigenvalue problems: curved elements and mesh refinement."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np
import scipy

from slosh_base.types import Array
from slosh_model.errors import SloshModelError
from slosh_model.shapes.contour import Piece
from slosh_shapes.mesh import (
    Side,
    Size,
    Triangles,
    divided,
    on_sides,
    triangulated,
)

HOW_TO_GET = (
    "the modes of this container must be computed with scikit-fem, which is not installed "
    "(pip install -r requirements/modes.txt); or store them in a model file, with "
    "`slosh modes MODEL -o OUT.yaml` on a machine that has scikit-fem"
)
INTEGRATED = 6
"""Degree to which integrals are exact: r³ times two gradients of second-order elements."""
ORDER = 4.0
"""Of an eigenvalue's error, by the size of second-order elements (Strang & Fix 1973, ch. 6)."""
_PLACED = 1e-9
"""Of a place inside a triangle, relative to its size."""
_SOLVED = 1e-10
"""Relative to an eigenvalue; its vector is known to the root of that at least."""
_TRUSTED = (0.6, 1.5)
"""By so much the error's fall may differ from that order for the limit to be extrapolated."""


def available() -> bool:
    """Returns whether the optional library scikit-fem is installed."""
    return importlib.util.find_spec("skfem") is not None


@cache
def library() -> Any:
    """Imports scikit-fem, or raises an error if it is not installed.

    Raises:
        SloshModelError: it is not installed.
    """
    if not available():
        raise SloshModelError(HOW_TO_GET)
    return importlib.import_module("skfem")


def curved(mesh: Triangles, sides: Sequence[Side]) -> Any:
    """Creates a second-order mesh with curved, named boundaries."""
    fem = library()
    straight = fem.MeshTri(mesh.points.T.copy(), mesh.corners.T.copy())
    made = fem.MeshTri2.from_mesh(straight)
    facets = {tuple(pair): k for k, pair in enumerate(np.sort(made.facets.T, axis=1).tolist())}
    own = np.array([facets[tuple(sorted(pair))] for pair in mesh.edge.tolist()])
    places = made.doflocs.copy()
    # One node in the middle of each facet.
    places[:, made.dofs.facet_dofs[0, own]] = on_sides(
        sides, mesh.side, mesh.shares.mean(axis=1)
    ).T
    names = np.array([sides[k].name for k in mesh.side.tolist()])
    parts = {str(name): own[names == name] for name in np.unique(names)}
    return replace(made, doflocs=places).with_boundaries(parts)


def bases(mesh: Any, *parts: str) -> list[Any]:
    """Creates second-order finite-element bases inside a mesh and on parts of its boundary."""
    fem = library()
    mapping = mesh.mapping()
    # Its own tolerance is below the rounding of triangles that are small beside their distance.
    mapping.invF = partial(mapping.invF, newton_tol=_PLACED)
    shared = {"mapping": mapping, "intorder": INTEGRATED}
    return [
        fem.CellBasis(mesh, fem.ElementTriP2(), **shared),
        *(
            fem.FacetBasis(mesh, fem.ElementTriP2(), facets=mesh.boundaries[part], **shared)
            for part in parts
        ),
    ]


def scaled(piece: Piece, origin: Array, scale: float) -> Piece:
    """Returns a curve shifted to an origin and divided by a scale."""
    return replace(piece, at=lambda t: (piece.at(t) - origin) / scale)


def solver(matrix: Any) -> Callable[[Array], Array]:
    """Returns a function that solves equations with a sparse, positive definite matrix.

    It needs no pivots, which is half of the time of a general matrix.
    """
    factors = scipy.sparse.linalg.splu(
        matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )  # fmt: skip
    solve: Callable[[Array], Array] = factors.solve
    return solve


def lowest(stiffness: Any, mass: Any, count: int, *, below: float = 0.0) -> tuple[Array, Array]:
    """Returns the lowest eigenvalues of K x = λ M x, and eigenvectors as columns.

    Args:
        stiffness, mass: K and M, sparse and symmetric.
        count: number of eigenvalues.
        below: a number below all of them.
    """
    # Always the same start: so are the bits that come out.
    start = 1.0 + np.arange(stiffness.shape[0]) % 7
    inverse = scipy.sparse.linalg.LinearOperator(
        stiffness.shape, matvec=solver(stiffness - below * mass), dtype=np.float64
    )
    values, vectors = scipy.sparse.linalg.eigsh(
        stiffness, count, mass, sigma=below, v0=start, tol=_SOLVED, OPinv=inverse
    )
    order = np.argsort(values)
    return values[order], vectors[:, order]


def refined(
    sides: Sequence[Side],
    size: Size,
    solve: Callable[[Any], tuple[Array, Any]],
    *,
    change: float,
    most: int,
    watched: Sequence[int] = range(3),
) -> tuple[list[Array], Any]:
    """Refines the mesh until the results have converged.

    Args:
        sides: of the region.
        size: of the first triangles.
        solve: a mesh to a row of numbers for each mode, ω² first, and to anything else.
        change: of the watched ω, relative, that ends it.
        most: number of divisions, at most.
        watched: rows of the modes whose ω must stand.

    Returns:
        the numbers of each mesh, and what else the last one gave.
    """
    mesh = triangulated(sides, size)
    numbers: list[Array] = []
    for _ in range(most + 1):
        found, more = solve(curved(mesh, sides))
        numbers.append(found)
        if len(numbers) > 2 and _stands([one[watched] for one in numbers], change):
            break
        mesh = divided(mesh, sides)
    return numbers, more


def _stands(numbers: Sequence[Array], change: float) -> bool:
    """Returns whether refining the mesh changed all frequencies by less than a tolerance."""
    before, now = (_extrapolated(numbers[k - 1], numbers[k])[:, 0] for k in (-2, -1))
    return bool((np.abs(np.sqrt(now / before) - 1.0) < change).all())


def limit(numbers: Sequence[Array]) -> Array:
    """Extrapolates results of successive meshes if their errors decrease as expected.

    Richardson's extrapolation by the elements' order where their
    error falls so; where a corner spoils the order, what the finest mesh has.
    """
    coarse, middle, fine = numbers[-3:]
    with np.errstate(all="ignore"):
        fall = (middle - coarse) / (fine - middle) / 2.0**ORDER
    steady = (fall > _TRUSTED[0]) & (fall < _TRUSTED[1])
    return np.where(steady, _extrapolated(middle, fine), fine)


def _extrapolated(coarse: Array, fine: Array) -> Array:
    limit: Array = fine + (fine - coarse) / (2.0**ORDER - 1.0)
    return limit
