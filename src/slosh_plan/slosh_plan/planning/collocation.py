"""Collocation problem of a path: all intervals combined, with sparse derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array

from slosh_base.types import Array
from slosh_plan.planning.flow import Expression, Flow, casadi
from slosh_plan.planning.interval import (
    CHAIN,
    LIMITS,
    LIQUID,
    SHARES,
    Interval,
    StateLayout,
    curve_of,
)
from slosh_plan.planning.loose_terms import LooseTerms
from slosh_plan.planning.path import Leg, Path

Indices = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class LegUnknowns:
    """Indices of the unknowns of one leg of the path.

    Attributes:
        duration: of the leg.
        states: (n + 1, K).
        controls: (n, D).
        middles: (n, 4 for each liquid).
    """

    duration: int
    states: Indices
    controls: Indices
    middles: Indices

    @classmethod
    def after(cls, begin: int, count: int, layout: StateLayout) -> LegUnknowns:
        """Creates the indices of the unknowns of `count` intervals, from index `begin` on."""
        shapes = ((count + 1, layout.size), (count, layout.driven), (count, layout.waves))
        arrays, at = [], begin + 1
        for shape in shapes:
            arrays.append(np.arange(at, at + shape[0] * shape[1]).reshape(shape))
            at += shape[0] * shape[1]
        return cls(begin, *arrays)

    @property
    def end(self) -> int:
        """Index after the last unknown of this leg of the path."""
        return self.duration + 1 + self.states.size + self.controls.size + self.middles.size

    @property
    def of_intervals(self) -> Indices:
        """Indices (n, size) of each interval's unknowns, in the interval's own order."""
        count = len(self.controls)
        durations = np.full((count, 1), self.duration)
        return np.hstack(
            [durations, self.states[:-1], self.states[1:], self.controls, self.middles]
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Part:
    """A group of constraints: values, bounds, and non-zero entries of their derivatives."""

    values: Expression
    lower: Array
    upper: Array
    jacobian: Expression
    rows: Indices
    columns: Indices
    hessian: Expression
    hessian_rows: Indices
    hessian_columns: Indices


class CollocationProblem:
    """Unknowns, constraints and derivatives of the optimal control problem.

    Args:
        flows: the liquids.
        path: the path.
        yaw: of the container [rad].
        counts: intervals of each leg.
        layout: of the states.
        loose: how the container stands on its tray, with each liquid; empty: it is held.

    Attributes:
        legs: where each leg's unknowns stand; behind them all stands a residual's
            `share` for each liquid.
        lower, upper: bounds of the demands.
    """

    def __init__(
        self,
        flows: tuple[Flow, ...],
        path: Path,
        yaw: float,
        counts: Sequence[int],
        layout: StateLayout,
        loose: tuple[LooseTerms, ...] = (),
    ) -> None:
        ca = casadi()

        self.legs: list[LegUnknowns] = []
        for count in counts:
            begin = self.legs[-1].end if self.legs else 0
            self.legs.append(LegUnknowns.after(begin, count, layout))
        size = self.legs[-1].end + len(flows)
        self._x = ca.MX.sym("x", size)
        self._limits = ca.MX.sym("limits", len(LIMITS))
        self._weights: list[Expression] = []
        parts = [
            self._intervals(Interval(flows, yaw, layout, count, leg.demands, loose), leg, place)
            for count, leg, place in zip(counts, path.legs, self.legs, strict=True)
        ]
        parts += [self._residual(flow, n, layout) for n, flow in enumerate(flows)]
        parts.append(self._joins(flows, path, layout))
        self.lower = np.concatenate([part.lower for part in parts])
        self.upper = np.concatenate([part.upper for part in parts])
        self._values = ca.vertcat(*(part.values for part in parts))
        self._jacobian = self._assembled_jacobian(parts, size)
        self._hessian = self._assembled_hessian(parts, size)

    def solver(self, options: dict[str, Any]) -> Any:
        """Creates IPOPT's solver for the problem."""
        ca = casadi()

        x, limits, weights = self._x, self._limits, ca.vertcat(*self._weights)
        scale = ca.MX.sym("scale")
        problem = {
            "x": x, "p": limits, "g": self._values,
            "f": ca.sum1(x[[leg.duration for leg in self.legs]]),
        }  # fmt: skip
        derivatives = {
            "jac_g": ca.Function("jac_g", [x, limits], [self._values, self._jacobian]),
            "hess_lag": ca.Function("hess_lag", [x, limits, scale, weights], [self._hessian]),
        }
        return ca.nlpsol("plan", "ipopt", problem, derivatives | options)

    def sizes(self) -> dict[str, int]:
        """Numbers of unknowns, constraints and parameters by their CasADi names."""
        return {"x": self._x.numel(), "g": len(self.lower), "p": len(LIMITS)}

    def _intervals(self, interval: Interval, leg: Leg, place: LegUnknowns) -> _Part:
        ca = casadi()

        count, of_intervals = interval.count, place.of_intervals
        unknowns = ca.reshape(self._x[of_intervals.ravel().tolist()], interval.size, count)
        places = interval.places().map(count)(unknowns)
        look = curve_of(leg).map(len(SHARES) * count)
        about, terms = look(ca.reshape(places, 1, -1))
        about = ca.reshape(about, len(SHARES), count)
        demands, slopes, bends = interval.demands()
        lower, upper = interval.bounds()
        weights = ca.MX.sym("weights", len(lower), count)
        self._weights.append(ca.vec(weights))
        begin = sum(one.numel() for one in self._weights[:-1])
        given = (unknowns, self._limits, about, terms)
        row, column = (np.array(found) for found in slopes.sparsity_out(0).get_triplet())
        first, second = (np.array(found) for found in bends.sparsity_out(0).get_triplet())
        offsets = begin + len(lower) * np.arange(count)[:, None]
        return _Part(
            ca.vec(demands.map(count)(*given)),
            np.tile(lower, count),
            np.tile(upper, count),
            _entries(slopes.map(count)(*given)),
            (offsets + row).ravel(),
            of_intervals[:, column].ravel(),
            _entries(bends.map(count)(*given, weights)),
            of_intervals[:, first].ravel(),
            of_intervals[:, second].ravel(),
        )

    def _residual(self, flow: Flow, number: int, layout: StateLayout) -> _Part:
        """Returns the constraint on a liquid's residual wave at the end of the motion."""
        ca = casadi()

        own = slice(LIQUID * number, LIQUID * (number + 1))
        where = self.legs[-1].states[-1, layout.liquid][own].tolist()
        where.append(self.legs[-1].end + number)
        unknowns, limit = ca.SX.sym("unknowns", LIQUID + 1), ca.SX.sym("limit")
        liquid = unknowns[:LIQUID] * layout.scale[layout.liquid][own]
        found = ca.vertcat(*flow.residual(liquid, limit, unknowns[LIQUID]))
        weights = ca.SX.sym("weights", found.numel())
        slopes = ca.Function("slopes", [unknowns, limit], [ca.jacobian(found, unknowns)])
        hessian = ca.triu(ca.hessian(ca.dot(weights, found), unknowns)[0])
        bends = ca.Function("bends", [unknowns, limit, weights], [hessian])
        outer = ca.MX.sym("weights", found.numel())
        begin = sum(one.numel() for one in self._weights)
        self._weights.append(outer)
        given, place = (self._x[where], self._limits[1]), np.array(where)
        row, column = (np.array(one) for one in slopes.sparsity_out(0).get_triplet())
        first, second = (np.array(one) for one in bends.sparsity_out(0).get_triplet())
        return _Part(
            ca.Function("residual", [unknowns, limit], [found])(*given),
            np.full(found.numel(), -np.inf),
            np.zeros(found.numel()),
            _entries(slopes(*given)),
            begin + row,
            place[column],
            _entries(bends(*given, outer)),
            place[first],
            place[second],
        )

    def _joins(self, flows: tuple[Flow, ...], path: Path, layout: StateLayout) -> _Part:
        """Returns constraints between legs: rest at corners, continuous tilt and liquid state."""
        ca = casadi()

        rows: list[tuple[dict[int, float], float]] = []
        for n, (leg, place) in enumerate(zip(path.legs, self.legs, strict=True)):
            first, last = place.states[0].tolist(), place.states[-1].tolist()
            rows += [({first[0]: 1.0}, 0.0), ({first[1]: 1.0}, 0.0), ({last[1]: 1.0}, 0.0)]
            rows.append(({last[0]: 1.0}, leg.length / float(layout.scale[0])))
            ends = n == len(path.legs) - 1
            if ends or not path.reversals[n]:
                rows.append(({last[2]: 1.0}, 0.0))
            if ends:
                rows += [({at: 1.0}, 0.0) for at in last[CHAIN : CHAIN * layout.driven]]
            if n == 0:
                rows += [({at: 1.0}, 0.0) for at in first[2:]]
                for (number, flow), (axis, lean) in product(
                    enumerate(flows), enumerate(leg.lean())
                ):
                    at = first[layout.liquid][LIQUID * number + axis]
                    rows.remove(({at: 1.0}, 0.0))
                    rest = -lean / flow.frequency[axis] ** 2
                    rows.append(({at: 1.0}, rest / float(layout.scale[layout.liquid][axis])))
                continue
            before = self.legs[n - 1].states[-1].tolist()
            same = zip(first[CHAIN:], before[CHAIN:], strict=True)
            rows += [({new: 1.0, old: -1.0}, 0.0) for new, old in same]
            back = path.reversals[n - 1]
            rows.append(({first[2]: 1.0, before[2]: 1.0} if back else {first[2]: 1.0}, 0.0))
        begin = sum(one.numel() for one in self._weights)
        self._weights.append(ca.MX.sym("weights", len(rows)))
        entries = [(n, at, x) for n, (row, _) in enumerate(rows) for at, x in row.items()]
        row, column, factor = (np.array(one) for one in zip(*entries, strict=True))
        matrix = ca.DM(ca.Sparsity.triplet(len(rows), self._x.numel(), row.tolist(),
                                           column.tolist()))  # fmt: skip
        for n, at, x in entries:
            matrix[n, at] = x
        values = np.array([value for _, value in rows])
        none = np.empty(0, np.int64)
        return _Part(
            matrix @ self._x, values, values, ca.MX(ca.DM(factor)), begin + row, column,
            ca.MX(0, 1), none, none,
        )  # fmt: skip

    def _assembled_jacobian(self, parts: Sequence[_Part], size: int) -> Expression:
        rows = np.concatenate([part.rows for part in parts])
        columns = np.concatenate([part.columns for part in parts])
        entries = casadi().vertcat(*(part.jacobian for part in parts))
        return _assembled(entries, rows, columns, (len(self.lower), size))

    @staticmethod
    def _assembled_hessian(parts: Sequence[_Part], size: int) -> Expression:
        one = np.concatenate([part.hessian_rows for part in parts])
        other = np.concatenate([part.hessian_columns for part in parts])
        entries = casadi().vertcat(*(part.hessian for part in parts))
        rows, columns = np.minimum(one, other), np.maximum(one, other)
        return _assembled(entries, rows, columns, (size, size))


def _entries(blocks: Expression) -> Expression:
    """Returns the structurally non-zero entries of CasADi matrices that are side by side."""
    return blocks.nz[:]


def _assembled(
    entries: Expression, rows: Indices, columns: Indices, shape: tuple[int, int]
) -> Expression:
    """Assembles a sparse matrix from entries; adds those at the same position."""
    ca = casadi()

    flat = columns * shape[0] + rows
    places, which = np.unique(flat, return_inverse=True)
    count = len(flat)
    gather = coo_array((np.ones(count), (which, np.arange(count)))).tocsc()
    pattern = ca.Sparsity(len(places), count, gather.indptr.tolist(), gather.indices.tolist())
    summed = ca.DM(pattern, gather.data) @ entries
    starts = np.searchsorted(places // shape[0], np.arange(shape[1] + 1))
    found = ca.Sparsity(*shape, starts.tolist(), (places % shape[0]).tolist())
    return ca.MX(found, summed)
