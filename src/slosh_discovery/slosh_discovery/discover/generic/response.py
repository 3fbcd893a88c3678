"""Computes how generic terms in the equation of motion change the predicted heights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba.types import boolean, float64, int64
from numpy.typing import NDArray

from slosh_base.compiled.compilation import (
    CHANGED_1,
    CHANGED_2,
    GIVEN_1,
    GIVEN_2,
    compiled,
    entry_point,
)
from slosh_base.types import Array
from slosh_discovery.discover.generic.terms import Term, term_value
from slosh_discovery.discover.motion import MeasuredMotion
from slosh_model import kernel
from slosh_model.errors import SloshModelError
from slosh_model.layout import records
from slosh_model.measure import measured_heights, reading_clock, with_moments
from slosh_model.model import Model
from slosh_model.response import Response
from slosh_model.simulate import Inputs, Simulator

GRID = 0.005
"""Longest time between the samples at which the terms are evaluated [s]."""
STRONGEST = 30.0
"""A force beyond this has run away [m/s²]."""


@dataclass(frozen=True, slots=True, eq=False)
class MotionWithTerms:
    """A motion prepared for many simulations with added equation terms.

    Attributes:
        model: the base model.
        motion: what was measured.
        inputs: the motion's inputs on a grid that holds the moments of the measured heights.
        rows: (M,) the inputs' samples at those moments.
    """

    model: Model
    motion: MeasuredMotion
    inputs: Inputs
    rows: NDArray[np.intp]

    @classmethod
    def of(cls, model: Model, motion: MeasuredMotion, clock_offset: float) -> MotionWithTerms:
        """Resamples a motion for heights whose clock is `clock_offset` [s] ahead of the inputs."""
        start = float(motion.inputs.t[0])
        clock = reading_clock(model)
        moments = np.maximum(clock.moments(motion.t - clock_offset, start), start)
        end = max(float(motion.inputs.t[-1]), float(moments[-1]))
        inputs = with_moments(motion.inputs, np.union1d(moments, np.arange(start, end, GRID)))
        return cls(model, motion, inputs, np.searchsorted(inputs.t, moments))

    def heights(self, terms: Sequence[Term], coefficients: Sequence[float]) -> Array:
        """Returns the sensor's heights (times, azimuths) [m] that the extended model predicts.

        Raises:
            SloshModelError: the solution runs away.
        """
        heights, _ = self._run(terms, coefficients)
        response = Response(self.inputs.t, heights[:, 0], heights[:, 1], np.empty((0, 0, 4)))
        read = measured_heights(self.model, response, self.motion.eta_azimuth)
        return np.asarray(read[self.rows])

    def sizes(self, terms: Sequence[Term]) -> tuple[Array, float]:
        """Returns sums of squares over time, of each term and of the spring force [m²/s⁴]."""
        _, states = self._run((), ())
        t = self.inputs.t - self.inputs.t[0]
        squares = np.zeros(len(terms))
        for index, term in enumerate(terms):
            squares[index] = _square_sum(
                term.scalar, term.vector, t, states, self.inputs.acceleration
            )
        stiffness = self.model.mode_constants()[0].natural_frequency ** 2
        return squares, float(np.sum((stiffness * states[:, :2]) ** 2))

    def _run(self, terms: Sequence[Term], coefficients: Sequence[float]) -> tuple[Array, Array]:
        simulator = Simulator(self.model, max_step=GRID)
        inputs = self.inputs
        heights, states = np.empty((len(inputs.t), 2)), np.empty((len(inputs.t), 4))
        finite = _advance_with_terms(
            simulator.store, inputs.t, inputs.acceleration, inputs.yaws, inputs.poses,
            _codes(terms), np.array(coefficients, dtype=np.float64), heights, states,
        )  # fmt: skip
        if not (finite and np.isfinite(heights).all()):
            raise SloshModelError("the model with generic terms has no bounded solution")
        return heights, states


def _codes(terms: Sequence[Term]) -> NDArray[np.int64]:
    codes = np.array([[term.scalar, term.vector] for term in terms], dtype=np.int64)
    return codes.reshape(-1, 2)


@compiled
def _force(codes, coefficients, t, mode, acceleration):  # type: ignore[no-untyped-def]
    q = (mode["x"], mode["y"], mode["vx"], mode["vy"])
    a = (acceleration[0], acceleration[1], acceleration[2])
    fx = fy = 0.0
    for k in range(codes.shape[0]):
        x, y = term_value(codes[k, 0], codes[k, 1], t, q, a)
        fx += coefficients[k] * x
        fy += coefficients[k] * y
    return fx, fy


@entry_point(
    boolean(
        CHANGED_1, GIVEN_1, GIVEN_2, GIVEN_1, GIVEN_2, int64[:, ::1], GIVEN_1, CHANGED_2, CHANGED_2
    )
)
def _advance_with_terms(  # type: ignore[no-untyped-def]
    store, t, acceleration, yaws, poses, codes, coefficients, heights, states
):
    """Integrates the model; generic terms act as an additional acceleration of the container.

    Each sample is taken twice: with the force that the last two samples foretell, then with the
    one of the state that it leads to. False: the force has run away.
    """
    saved = store.copy()
    runs, modes = records(store)
    run, first = runs[0], modes[0]
    fx, fy = _force(codes, coefficients, 0.0, first, acceleration[0])
    old_x, old_y = fx, fy
    for i in range(t.shape[0]):
        dt = t[i] - t[i - 1] if i > 0 else 0.0
        ax, ay, az = acceleration[i, 0], acceleration[i, 1], acceleration[i, 2]
        pose = kernel.pose_at(poses, i)
        next_x, next_y = 2.0 * fx - old_x, 2.0 * fy - old_y
        old_x, old_y = fx, fy
        saved[:] = store
        height_x = height_y = turn = 0.0
        for turn_of_two in range(2 if codes.shape[0] > 0 else 1):
            if turn_of_two == 1:
                next_x, next_y = _force(codes, coefficients, t[i] - t[0], first, acceleration[i])
                store[:] = saved
            height_x, height_y, turn = kernel.advance(
                run, modes, ax - next_x, ay - next_y, az, yaws[i], pose, dt
            )
        fx, fy = next_x, next_y
        if not abs(fx) + abs(fy) < STRONGEST:
            return False
        heights[i, 0], heights[i, 1] = kernel.turned(height_x, height_y, turn)
        states[i, 0], states[i, 1] = first["x"], first["y"]
        states[i, 2], states[i, 3] = first["vx"], first["vy"]
    return True


@entry_point(float64(int64, int64, GIVEN_1, GIVEN_2, GIVEN_2))
def _square_sum(scalar, vector, t, states, acceleration):  # type: ignore[no-untyped-def]
    total = 0.0
    for i in range(t.shape[0]):
        q = (states[i, 0], states[i, 1], states[i, 2], states[i, 3])
        a = (acceleration[i, 0], acceleration[i, 1], acceleration[i, 2])
        x, y = term_value(scalar, vector, t[i], q, a)
        total += x * x + y * y
    return total
