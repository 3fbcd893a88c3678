"""Least-squares problem: residuals of the heights as a function of all unknowns.

Nuisances are a motion's own: the offset of its clock where inputs and heights have two, and the
state in which a free decay begins. A still level that is unknown is taken out of the residual.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from slosh_base.types import Array
from slosh_discovery.discover.problem import LONGEST_STEP, Answer, PreparedMotion
from slosh_discovery.discover.tuning import TUNING as DISCOVER
from slosh_discovery.identify.parameters import FreeParameter, fitted_model
from slosh_discovery.identify.trials import Trial
from slosh_discovery.identify.tuning import TUNING
from slosh_model.batch import wall_heights
from slosh_model.measure import measured_heights
from slosh_model.model import Model
from slosh_model.response import Response
from slosh_model.simulate import Inputs, State, simulate

STEP = 1e-4
"""Step of the derivatives, relative to a parameter's width."""
IMPOSSIBLE = 1.0
"""Residual where a model has no answer [m]."""

IN_LINE = 1e-6
"""Azimuths whose sines differ by less lie on one line through the middle."""
_STILL = np.zeros(4)


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """Least-squares problem of a model over several trials (prepared motions).

    Attributes:
        model: whose parameters are fitted.
        parameters: (P,) those that are.
        trials: the data.
        clocks, states: for each trial its places in the vector behind the parameters: of the clock
            offset, and of the state's components; empty: none.
        size: V, length of the vector: parameters, then nuisances.
    """

    model: Model
    parameters: tuple[FreeParameter, ...]
    trials: tuple[Trial, ...]
    clocks: tuple[tuple[int, ...], ...] = field(init=False)
    states: tuple[tuple[int, ...], ...] = field(init=False)
    size: int = field(init=False)

    def __post_init__(self) -> None:
        at = len(self.parameters)
        clocks, states = [], []
        for trial in self.trials:
            clock = 0 if trial.prepared.motion.same_clock else 1
            state = state_basis(trial.prepared).shape[1] if trial.free else 0
            clocks.append(tuple(range(at, at + clock)))
            states.append(tuple(range(at + clock, at + clock + state)))
            at += clock + state
        for name, value in (("clocks", tuple(clocks)), ("states", tuple(states)), ("size", at)):
            object.__setattr__(self, name, value)

    @property
    def starts(self) -> Array:
        """Initial values (P,) of the parameters."""
        return np.array([parameter.start for parameter in self.parameters])

    def start(self, values: Array) -> Array:
        """Returns the initial vector of unknowns: parameters, clock offsets and initial states."""
        vector = np.zeros(self.size)
        vector[: len(values)] = values
        model = self.model_at(vector)
        for trial, clock, state in zip(self.trials, self.clocks, self.states, strict=True):
            vector[list(clock)] = trial.clock_offset
            if state and model is not None:
                vector[list(state)] = guessed_state(trial.prepared, model)
        return vector

    def bounds(self, start: Array) -> tuple[Array, Array]:
        """Returns lower and upper bounds of all unknowns."""
        reach = self.widths * np.where(np.arange(self.size) < len(self.parameters), 0.0, 1.0)
        for clock in self.clocks:
            reach[list(clock)] = DISCOVER.clock_span
        for state in self.states:
            reach[list(state)] *= TUNING.state_span
        lower, upper = start - reach, start + reach
        for place, parameter in enumerate(self.parameters):
            lower[place], upper[place] = parameter.lower, parameter.upper
        return lower, upper

    @property
    def widths(self) -> Array:
        """Prior widths of all parameters and nuisance parameters."""
        widths = np.full(self.size, TUNING.clock_width)
        widths[: len(self.parameters)] = [parameter.width for parameter in self.parameters]
        gain = self.model.height_gains()[0]
        for trial, state in zip(self.trials, self.states, strict=True):
            widths[list(state)] = np.nanmax(np.abs(trial.prepared.heights)) / gain
        return widths

    def model_at(self, vector: Array) -> Model | None:
        """Returns the model with the vector's parameters, or None if they are impossible."""
        values = {p.name: float(v) for p, v in zip(self.parameters, vector, strict=False)}
        return fitted_model(self.model, values)

    def predicted(self, vectors: Sequence[Array]) -> list[list[Array | None]]:
        """Returns heights (times, azimuths) [m] by parameter vector and trial; else None."""
        models = [self.model_at(vector) for vector in vectors]
        liquid = self._from_rest(models)
        return [
            [
                None if model is None else self._heights(trial, index, model, vector, rows)
                for index, trial in enumerate(self.trials)
            ]
            for model, vector, rows in zip(models, vectors, liquid, strict=True)
        ]

    def residuals(self, vectors: Sequence[Array]) -> Array:
        """Returns measured minus predicted heights [m], one column (N,) per vector of unknowns."""
        columns = []
        for answers in self.predicted(vectors):
            parts = [self._part(t, a) for t, a in zip(self.trials, answers, strict=True)]
            columns.append(np.concatenate(parts))
        count = sum(trial.count for trial in self.trials)
        return np.column_stack(columns) if columns else np.empty((count, 0))

    def derivative(self, vector: Array) -> Array:
        """Returns the residual's derivatives with respect to all unknowns, by central differences.

        A trial's residual knows its own nuisances alone, so that all trials' first ones are moved
        at a time, and so on.
        """
        groups = self._moved_together()
        moved = [other for group in groups for other in self._moved(vector, group)]
        residuals = self.residuals(moved)
        ends = np.cumsum([0, *(trial.count for trial in self.trials)])
        jacobian = np.zeros((len(residuals), self.size))
        for number, group in enumerate(groups):
            ahead, behind = 2 * number, 2 * number + 1
            change = residuals[:, ahead] - residuals[:, behind]
            for place, trial in group:
                rows = slice(None) if trial is None else slice(ends[trial], ends[trial + 1])
                jacobian[rows, place] = change[rows] / (moved[ahead][place] - moved[behind][place])
        return jacobian

    def _moved_together(self) -> list[list[tuple[int, int | None]]]:
        """Returns the groups of unknowns that can be varied in the same simulation."""
        groups: list[list[tuple[int, int | None]]] = [
            [(place, None)] for place in range(len(self.parameters))
        ]
        own = [(*clock, *state) for clock, state in zip(self.clocks, self.states, strict=True)]
        most = max(map(len, own), default=0)
        groups += [
            [(places[n], trial) for trial, places in enumerate(own) if len(places) > n]
            for n in range(most)
        ]
        return groups

    def _moved(self, vector: Array, group: list[tuple[int, int | None]]) -> list[Array]:
        """Returns copies of the vector with a group of unknowns varied, within the bounds."""
        places = [place for place, _ in group]
        lower, upper = self.bounds(vector)
        moved = []
        for step in (STEP, -STEP):
            other = vector.copy()
            other[places] += step * self.widths[places]
            moved.append(np.clip(other, lower, upper))
        return moved

    def _from_rest(self, models: Sequence[Model | None]) -> list[dict[int, Array]]:
        """Simulates each model from rest; returns the liquid's heights by the inputs' `id`."""
        pairs: list[tuple[int, Inputs]] = []
        for number, model in enumerate(models):
            if model is not None:
                driven = [t.prepared.inputs_for(model) for t in self.trials if not t.free]
                pairs += [(number, one) for one in {id(one): one for one in driven}.values()]
        found: list[dict[int, Array]] = [{} for _ in models]
        if pairs:
            rows = wall_heights(
                [models[number] for number, _ in pairs],  # type: ignore[misc]
                [one for _, one in pairs],
                max_step=LONGEST_STEP,
            )
            for (number, one), heights in zip(pairs, rows, strict=True):
                found[number][id(one)] = heights
        return found

    def _heights(
        self, trial: Trial, index: int, model: Model, vector: Array, liquid: dict[int, Array]
    ) -> Array | None:
        prepared = trial.prepared
        if trial.free:
            state = state_basis(prepared) @ vector[list(self.states[index])]
            heights = decayed(prepared, model, state)
        else:
            heights = liquid[id(prepared.inputs_for(model))]
        answer: Answer | None = prepared.answer(model, prepared.inputs_for(model), heights)
        if answer is None:
            return None
        clock = self.clocks[index]
        return answer.at(prepared.t, float(vector[clock[0]]) if clock else 0.0)

    @staticmethod
    def _part(trial: Trial, heights: Array | None) -> Array:
        prepared = trial.prepared
        if heights is None:
            return np.full(trial.count, IMPOSSIBLE)
        difference = (prepared.heights - heights)[prepared.kept]
        difference = np.clip(np.nan_to_num(difference, nan=IMPOSSIBLE), -IMPOSSIBLE, IMPOSSIBLE)
        if not prepared.motion.level_known:
            difference = difference - difference.mean()
        return difference


def state_basis(prepared: PreparedMotion) -> Array:
    """Returns a basis, one column per observable state of a mode: x, y, velocities / ω [m].

    Heights along one line tell of the state along it; the maximum over the wall does not tell how
    the path is turned, and it is turned so that it begins on the x axis.
    """
    azimuths = prepared.azimuths
    if azimuths is None:
        return np.eye(4)[:, [0, 2, 3]]
    if np.abs(np.sin(azimuths - azimuths[0])).max() < IN_LINE:
        c, s = math.cos(azimuths[0]), math.sin(azimuths[0])
        return np.array([[c, 0.0], [s, 0.0], [0.0, c], [0.0, s]])
    return np.eye(4)


def decayed(prepared: PreparedMotion, model: Model, state: Array) -> Array:
    """Returns the liquid's heights (N, 2) [m] at +x and +y in free decay from a state.

    Args:
        prepared: the motion.
        model: the model.
        state: (4,) of the first mode at the inputs' start, velocities over ω [m].
    """
    response = _response(prepared.inputs_for(model), model, state)
    return np.column_stack([response.sh_x, response.sh_y])


def guessed_state(prepared: PreparedMotion, model: Model) -> Array:
    """Estimates the initial state, as coefficients of `state_basis`, from measured heights."""
    if prepared.azimuths is None:
        return _guess_from_maximum(prepared, model)
    basis, kept = state_basis(prepared), prepared.kept
    linear = model.linear()
    columns = []
    for direction in range(basis.shape[1]):
        response = _response(prepared.coarse, linear, basis[:, direction])
        heights = measured_heights(linear, response, prepared.azimuths)[prepared.rows]
        columns.append(heights[kept])
    measured = prepared.heights[kept]
    state = np.linalg.lstsq(np.column_stack(columns), measured, rcond=None)[0]
    return np.asarray(state, dtype=np.float64)


def _response(inputs: Inputs, model: Model, state: Array) -> Response:
    modes = model.mode_constants()
    modal = np.zeros((len(modes), 4))
    omega = modes[0].natural_frequency
    modal[0] = state * np.array([1.0, 1.0, omega, omega])
    begin = State(float(inputs.t[0]), modal, _STILL)
    return simulate(model, inputs, begin, max_step=LONGEST_STEP)[0]


def _guess_from_maximum(prepared: PreparedMotion, model: Model) -> Array:
    """Estimates the initial state from the squared maximum height, which oscillates at 2ω.

    Both decay alike. An ellipse with the half axes P and Q gives (P² ± Q²)/2 of the two.
    """
    mode, gain = model.mode_constants()[0], model.height_gains()[0]
    since = prepared.t - prepared.coarse.t[0]
    turned = mode.natural_frequency * math.sqrt(1.0 - mode.damping_ratio**2) * since
    decay = np.exp(-2.0 * mode.damping_ratio * mode.natural_frequency * since)
    columns = np.column_stack([decay, decay * np.cos(2 * turned), decay * np.sin(2 * turned)])
    squares = (prepared.heights[:, 0] / gain) ** 2
    mean, cosine, sine = np.linalg.lstsq(columns, squares, rcond=None)[0].tolist()
    wave, phase = math.hypot(cosine, sine), 0.5 * math.atan2(sine, cosine)
    long = math.sqrt(max(mean + wave, 0.0))
    short = max(math.sqrt(max(mean - wave, 0.0)), TUNING.least_width * long)
    place = complex(long * math.cos(phase), -short * math.sin(phase))
    speed = complex(long * math.sin(phase), short * math.cos(phase))
    # Turned so that it begins on the x axis.
    size = abs(place)
    speed *= place.conjugate() / size if size > 0.0 else 1.0
    return np.array([size, speed.real, speed.imag])
