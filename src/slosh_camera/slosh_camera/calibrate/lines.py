"""Detects long, nearly vertical lines in an image, which may be a container's sides."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slosh_camera.calibrate.edges import EdgeImage
from slosh_camera.calibrate.tuning import TUNING

FloatArray = NDArray[np.float64]

_LEAN_STEP = 0.004
_MAX_PIXELS = 30_000


@dataclass(frozen=True, slots=True)
class UprightLine:
    """The nearly vertical line u = column + lean (v - middle row), and its strength.

    Attributes:
        column: u in the image's middle row [px].
        lean: du/dv.
        support: sum of the supports of its pixels, about the number of rows that show it.
        top: v of its first pixel.
        bottom: v of its last pixel.
    """

    column: float
    lean: float
    support: float
    top: float
    bottom: float


def upright_lines(edges: EdgeImage, count: int, least: float) -> list[UprightLine]:
    """Detects the strongest nearly vertical lines of an image by a Hough transform.

    Each line found takes its pixels with it, so that one thick edge gives one line.

    Args:
        edges: the image.
        count: at most so many lines.
        least: least support of a line [rows].

    Returns:
        Lines, the strongest first.
    """
    rows, columns = edges.shape
    u, v, weight, lean = _edge_pixels(edges)
    leans = np.arange(-TUNING.most_lean, TUNING.most_lean + 0.5 * _LEAN_STEP, _LEAN_STEP)
    margin = int(np.ceil(TUNING.most_lean * rows / 2.0)) + 2
    votes = np.zeros((leans.size, columns + 2 * margin))
    _vote(votes, leans, (u, v, weight, lean), margin)
    lines: list[UprightLine] = []
    for _ in range(4 * count):
        # Two neighbouring columns together: a line between them splits its votes.
        pairs = votes[:, :-1] + votes[:, 1:]
        index = int(np.argmax(pairs))
        row, column = divmod(index, pairs.shape[1])
        if pairs[row, column] < 0.5 * least or len(lines) == count:
            break
        fit = _refine(u, v, weight, (column + 0.5 - margin, float(leans[row])))
        near = np.abs(u - fit[0] - fit[1] * v) < TUNING.vote_reach
        near |= np.abs(u - (column + 0.5 - margin) - leans[row] * v) < TUNING.vote_reach
        taken = (u[near], v[near], -weight[near], lean[near])
        _vote(votes, leans, taken, margin)
        support = float(weight[near].sum())
        if support >= least:
            middle = 0.5 * (rows - 1)
            span = v[near] + middle
            lines.append(UprightLine(fit[0], fit[1], support, span.min(), span.max()))
        keep = ~near
        u, v, weight, lean = u[keep], v[keep], weight[keep], lean[keep]
    return sorted(lines, key=lambda line: -line.support)


def _edge_pixels(edges: EdgeImage) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Returns position, edge strength and inclination of all nearly vertical edge pixels."""
    across = edges.across.astype(np.float64)
    size = np.abs(across)
    steep = np.abs(edges.down) < (TUNING.most_lean + TUNING.lean_error) * size
    ridge = np.zeros(size.shape, dtype=bool)
    ridge[1:-1, 1:-1] = (size[1:-1, 1:-1] >= size[1:-1, :-2]) & (size[1:-1, 1:-1] > size[1:-1, 2:])
    rows, columns = np.nonzero(ridge & steep & (size > 0.5 * edges.reference))
    if rows.size > _MAX_PIXELS:
        strongest = np.argpartition(-size[rows, columns], _MAX_PIXELS)[:_MAX_PIXELS]
        rows, columns = rows[strongest], columns[strongest]
    left, here, right = (size[rows, columns + shift] for shift in (-1, 0, 1))
    shift = 0.5 * (left - right) / np.minimum(left - 2.0 * here + right, -1e-9)
    lean = -edges.down[rows, columns].astype(np.float64) / across[rows, columns]
    middle = 0.5 * (edges.shape[0] - 1)
    u = np.asarray(columns + np.clip(shift, -0.5, 0.5), dtype=np.float64)
    v = np.asarray(rows - middle, dtype=np.float64)
    return u, v, edges.support(here), lean


def _vote(
    votes: FloatArray,
    leans: FloatArray,
    pixels: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
    margin: int,
) -> None:
    u, v, weight, own = pixels
    for row, lean in enumerate(leans):
        fits = np.abs(own - lean) < TUNING.lean_error
        bins = np.rint(u[fits] - lean * v[fits]).astype(np.intp) + margin
        bins = np.clip(bins, 0, votes.shape[1] - 1)
        votes[row] += np.bincount(bins, weight[fits], votes.shape[1])


def _refine(
    u: FloatArray, v: FloatArray, weight: FloatArray, start: tuple[float, float]
) -> tuple[float, float]:
    """Refines a line by a weighted fit to nearby edge pixels; returns column and inclination."""
    column, lean = start
    for reach in (2.0, 1.2):
        near = np.abs(u - column - lean * v) < reach
        if np.count_nonzero(near) < 8 or np.ptp(v[near]) < 8.0:
            break
        root = np.sqrt(weight[near])
        matrix = np.column_stack((root, root * v[near]))
        solution = np.linalg.lstsq(matrix, root * u[near], rcond=None)[0]
        if abs(solution[1]) > TUNING.most_lean:
            break
        column, lean = float(solution[0]), float(solution[1])
    return column, lean
