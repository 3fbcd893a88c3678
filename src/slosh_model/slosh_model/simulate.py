"""Simulates a model over a whole motion, or sample by sample with equal results.

Between two input samples the acceleration is interpolated linearly (first-order hold) and the
equations of motion are integrated by the classical Runge-Kutta method in equal sub-steps.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from slosh_base.types import Array
from slosh_model import kernel
from slosh_model.containers import X_AXIS, Y_AXIS
from slosh_model.effects.registry import (
    EFFECTS,
    PARAMETER_COUNT,
    SLOTS,
)
from slosh_model.errors import SloshModelError
from slosh_model.for_notebooks import span
from slosh_model.interpolation import columns_at
from slosh_model.layout import MODAL, RUN, back_to_rest, divided, new_store
from slosh_model.model import VERTICAL, Model
from slosh_model.modes import Mode
from slosh_model.pose import pose_rows
from slosh_model.response import Response

MAXIMUM_STEP = 0.002
"""Default bound of the sub-step [s]: relative error below 1e-6 for modes up to 10 Hz."""
MAXIMUM_GAP = 3600.0
"""Longest time between two samples [s]; more is a clock that jumped, not a motion."""
_HELD = ("ax", "ay", "az", "elapsed")
_REMEMBERED = ("started", "turn", "yaw")
_MEMORY_COUNT = len(_REMEMBERED) + RUN["drive_memory"].shape[0]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Inputs:
    """The motion of the container: times, accelerations and attitudes.

    >>> import numpy as np
    >>> from slosh_model import Inputs
    >>> t = np.arange(1001) / 1000.0  # s
    >>> inputs = Inputs(t, np.outer(np.sin(9.0 * t), [1.0, 0.0, 0.0]))  # m/s²
    >>> inputs.acceleration.shape
    (1001, 3)

    Attributes:
        t: (N,) time [s], strictly increasing.
        acceleration: (N, 3) of the container's origin in the world's axes, gravity excluded
            [m/s²].
        attitude: (N, 4) quaternion x, y, z, w, world ← container, of any length but zero; None:
            upright and not turned.
        angular_velocity: (N, 3) in the container's frame [rad/s]; None: the attitude's rate of
            change. Without an attitude it is integrated from upright.
        yaws, poses: (N,) [rad] and (N, POSE_COUNT), from attitude and rate; see `pose_rows`.

    Raises:
        SloshModelError: shapes that do not match, a value that is not finite, time that does not
            increase or jumps by more than MAXIMUM_GAP; the text names the array and the row.
    """

    t: Array
    acceleration: Array
    attitude: Array | None = None
    angular_velocity: Array | None = None
    yaws: Array = field(init=False, repr=False)
    poses: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        rows = np.size(self.t)
        widths = {"t": "", "acceleration": "xyz", "attitude": "xyzw", "angular_velocity": "xyz"}
        for name, columns in widths.items():
            value = getattr(self, name)
            if value is not None:
                shape = (rows, len(columns)) if columns else (rows,)
                object.__setattr__(self, name, _frozen(name, value, shape, columns))
        if rows == 0:
            raise SloshModelError("t is empty: a motion needs at least one sample")
        _check_times(self.t)
        if self.attitude is not None and not self.attitude.any(axis=1).all():
            row = int(np.argmin(self.attitude.any(axis=1)))
            raise SloshModelError(
                f"attitude[{row}] is zero: a quaternion must have a length above 0"
            )
        yaws, poses = pose_rows(self.t, self.attitude, self.angular_velocity)
        for name, array in (("yaws", yaws), ("poses", poses)):
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    def __repr__(self) -> str:
        strongest = float(np.linalg.norm(self.acceleration, axis=1).max())
        turning = "turning" if len(self.poses) else "upright"
        return f"Inputs({span(self.t)}, {turning}, acceleration up to {strongest:.3g} m/s²)"

    def resampled(self, t: Array, acceleration: Array | None = None) -> Inputs:
        """Returns the motion at other times, interpolated as in the integrator.

        Attitude and rates come from the given samples: moments may lie too close to each other to
        differentiate between them.

        Args:
            t: (M,) strictly increasing [s]; beyond the samples the last values stay.
            acceleration: (M, 3) [m/s²]; None: interpolated.
        """
        if acceleration is None:
            acceleration = columns_at(t, self.t, self.acceleration)
        if len(self.poses) == 0:
            return Inputs(t, acceleration)
        poses = columns_at(t, self.t, self.poses)
        poses[:, :4] /= np.linalg.norm(poses[:, :4], axis=1, keepdims=True)
        other = Inputs(t, acceleration, poses[:, :4], poses[:, 4:7])
        yaws = np.interp(t, self.t, self.yaws)
        for name, array in (("yaws", yaws), ("poses", poses)):
            array.setflags(write=False)
            object.__setattr__(other, name, array)
        return other


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """State of a simulation, from which another simulation can start.

    >>> import numpy as np
    >>> from slosh_model import State
    >>> State(0.0, np.zeros((1, 4)), np.zeros(4)).modal.shape
    (1, 4)

    Attributes:
        t: time of the last input [s].
        modal: (modes, 4) x, y, vx, vy of each mode's mass [m, m/s].
        held: (4,) the last input's acceleration [m/s²] and the time since rest [s].
        memory: what the model's effects remember; None: nothing yet.

    Raises:
        SloshModelError: a shape that does not match or a value that is not finite.
    """

    t: float
    modal: Array
    held: Array
    memory: Array | None = None

    def __post_init__(self) -> None:
        if not math.isfinite(self.t):
            raise SloshModelError(f"the state's t = {self.t!r} s is not finite")
        modal = _frozen("modal", self.modal, (len(self.modal), 4))
        object.__setattr__(self, "modal", modal)
        object.__setattr__(self, "held", _frozen("held", self.held, (len(_HELD),)))
        memory = self.memory
        if memory is None:
            memory = np.zeros(_MEMORY_COUNT)
            memory[_REMEMBERED.index("started")] = 1.0
        object.__setattr__(self, "memory", _frozen("memory", memory, (_MEMORY_COUNT,)))


class Simulator:
    """Simulates a model sample by sample.

    >>> import slosh
    >>> from slosh_model import Simulator
    >>> simulator = Simulator(slosh.Model.from_cup(diameter=0.08, fill_height=0.06))
    >>> simulator.model
    Model(3D-NL, radius 40 mm, filled to 60 mm, 3.369 Hz, damping ratio 0.00603)

    Args:
        model: the model.
        max_step: longest sub-step [s].

    Attributes:
        model: the model.
        store: all that runs, as the kernel takes it; see `layout`.
    """

    __slots__ = (
        "_modes",
        "_run",
        "_step",
        "model",
        "store",
    )

    def __init__(self, model: Model, *, max_step: float = MAXIMUM_STEP) -> None:
        self.model = model
        self.store = store_of(model, max_step)
        self._run, self._modes = divided(self.store)
        self._step = kernel.step.load()

    def reset(self) -> None:
        """Resets the liquid to rest; the next input counts as the first one."""
        back_to_rest(self.store)

    def step(self, dt: float, ax: float, ay: float, az: float) -> tuple[float, float]:
        """Adds an input sample of an upright container; returns liquid heights at the wall [m].

        Args:
            dt: time since the sample before [s], finite; without one it is ignored, and where it
                is not above 0 the sample only replaces the one before.
            ax, ay, az: the container's acceleration, gravity excluded [m/s²].

        Returns:
            sh_x, sh_y: signed height on the wall at +x and +y [m]; not finite where the solution
                has left the finite numbers, until `reset`.
        """
        heights: tuple[float, float] = self._step(self.store, dt, ax, ay, az)
        return heights

    @property
    def modal(self) -> Array:
        """Modal state: (modes, 4) x, y, vx, vy of each mode's mass [m, m/s]."""
        return np.column_stack([self._modes[name] for name in MODAL])

    def run(self, inputs: Inputs, state: State | None = None) -> tuple[Response, State]:
        """Simulates a whole motion from an earlier state or from rest; see `simulate`."""
        start = float(inputs.t[0])
        self.start(state, start)
        if state is not None:
            start = state.t
        heights = np.empty((len(inputs.t), 2))
        history = np.empty((len(inputs.t), len(self._modes), len(MODAL)))
        kernel.advance_many(
            self.store, np.diff(inputs.t, prepend=start), inputs.acceleration, inputs.yaws,
            inputs.poses, history, heights,
        )  # fmt: skip
        bad = np.flatnonzero(~np.isfinite(heights).all(axis=1))
        if len(bad):
            raise SloshModelError(
                f"the solution left the finite numbers at t = {inputs.t[bad[0]]:g} s: the motion "
                "is far outside the model's range, or max_step is too long"
            )
        for array in (heights, history):
            array.setflags(write=False)
        container = self.model.container
        response = Response(inputs.t, heights[:, 0], heights[:, 1], history, container)
        return response, self._state(float(inputs.t[-1]))

    def start(self, state: State | None, start: float) -> None:
        """Sets the liquid's state (None: at rest) for a motion that starts at `start` [s].

        Raises:
            SloshModelError: another model's state, or one that does not lead to the start.
        """
        self.reset()
        if state is None:
            return
        if len(state.modal) != len(self._modes):
            raise SloshModelError(
                f"the state has {len(state.modal)} modes, the model {len(self._modes)}"
            )
        if state.t > start:
            raise SloshModelError(
                f"the motion starts at {start:.9g} s, before the state's {state.t:.9g} s"
            )
        if start - state.t > MAXIMUM_GAP:
            raise SloshModelError(
                f"the motion starts at {start:.9g} s, more than {MAXIMUM_GAP:g} s "
                f"after the state's {state.t:.9g} s"
            )
        for name, column in zip(MODAL, state.modal.T, strict=True):
            self._modes[name] = column
        memory = state.memory
        assert memory is not None
        values = [*state.held, *memory]
        for name, value in zip((*_HELD, *_REMEMBERED), values, strict=False):
            self._run[name] = value
        self._run["drive_memory"] = memory[len(_REMEMBERED) :]

    def _state(self, t: float) -> State:
        run = self._run[0]
        held = np.array([run[name] for name in _HELD])
        memory = np.array([*(run[name] for name in _REMEMBERED), *run["drive_memory"]])
        return State(t, self.modal, held, memory)


def simulate(
    model: Model, inputs: Inputs, state: State | None = None, *, max_step: float = MAXIMUM_STEP
) -> tuple[Response, State]:
    """Simulates the liquid's response to a motion.

    >>> import numpy as np
    >>> from slosh_model import Inputs, read_model, simulate
    >>> t = np.arange(1001) / 1000.0  # s
    >>> inputs = Inputs(t, np.outer(np.sin(9.0 * t), [1.0, 0.0, 0.0]))  # m/s²
    >>> response, state = simulate(read_model("cup/model.yaml"), inputs)
    >>> print(f"{1e3 * response.msh.max():.1f} mm, stands at {state.t} s")
    5.6 mm, stands at 1.0 s

    Args:
        model: the model.
        inputs: the container's motion.
        state: where to start; None: at rest.
        max_step: longest sub-step [s].

    Returns:
        the response at the input's samples, and the state from which the next part can go on.

    Raises:
        SloshModelError: the motion starts before the state or long after it, the state is another
            model's, or the solution left the finite numbers.
    """
    return Simulator(model, max_step=max_step).run(inputs, state)


def store_of(model: Model, max_step: float = MAXIMUM_STEP) -> Array:
    """Returns the array of a model's constants and state before its first sample.

    Raises:
        SloshModelError: max_step is not positive.
    """
    if not (math.isfinite(max_step) and max_step > 0.0):
        raise SloshModelError(f"max_step = {max_step!r} s must be positive")
    constants = model.mode_constants()
    store = new_store(len(constants))
    run, modes = divided(store)
    run["max_step"] = float(max_step)
    run["cornered"] = float(model.container.cornered)
    run["static_height"], run["static_height_y"] = (
        model.static_height(constants, axis) for axis in (X_AXIS, Y_AXIS)
    )
    run["axes"] = axes = model.container.axes(len(constants))
    corners = model.container.corners
    run["corner_count"], run["corners"][0, : len(corners)] = len(corners), corners
    run["lift"] = float(model.has(VERTICAL))
    run["parameters"] = effect_parameters(model)
    gains = (model.height_gains(constants, axis) for axis in (X_AXIS, Y_AXIS))
    for n, (mode, gain, gain_y) in enumerate(zip(constants, *gains, strict=True)):
        across = mode.along(Y_AXIS)
        modes[n] = (
            mode.natural_frequency, mode.damping_ratio, mode.curvature, mode.reach, gain, mode.xi,
            mode.container.fill_height, across.natural_frequency / mode.natural_frequency,
            across.reach, gain_y, *_direction_in(mode, axes),
            0.0, 0.0, 0.0, 0.0,
        )  # fmt: skip
    return store


def _direction_in(mode: Mode, axes: float) -> tuple[float, float]:
    """Returns the direction of a mode in axes turned by `axes` [rad]; (0, 0) if it has none."""
    if not mode.container.one_directional:
        return 0.0, 0.0
    direction = mode.container.direction(mode.number) - axes
    return math.cos(direction), math.sin(direction)


def effect_parameters(model: Model) -> Array:
    """Returns the effect switches and parameters (PARAMETER_COUNT,) for the compiled code."""
    flat = np.zeros(PARAMETER_COUNT)
    for name, values in model.acting.items():
        slot = SLOTS.get(name)
        if slot is None:
            continue
        flat[slot] = 1.0
        for offset, parameter in enumerate(EFFECTS[name].parameters, start=1):
            flat[slot + offset] = values[parameter.name]
    return flat


def _frozen(name: str, value: Any, shape: tuple[int, ...], columns: str = "") -> Array:
    """Returns a read-only copy of an array after checking its shape and values.

    Raises:
        SloshModelError: no numbers, another shape, or a value that is not finite.
    """
    try:
        array = np.array(value, dtype=np.float64, order="C")
    except (TypeError, ValueError):
        raise SloshModelError(f"{name} is not an array of numbers") from None
    array.setflags(write=False)
    if array.shape != shape:
        raise SloshModelError(f"{name} has the shape {array.shape}, expected {shape}")
    bad = np.argwhere(~np.isfinite(array))
    if len(bad):
        place = tuple(int(index) for index in bad[0])
        axis = f".{columns[place[1]]}" if columns else "".join(f"[{i}]" for i in place[1:])
        raise SloshModelError(f"{name}[{place[0]}]{axis} = {array[place]} is not finite")
    return array


def _check_times(t: Array) -> None:
    """Raises SloshModelError if time does not increase or has a gap."""
    intervals = np.diff(t)
    for wrong, what in (
        (intervals <= 0.0, "does not come after"),
        (intervals > MAXIMUM_GAP, f"comes more than {MAXIMUM_GAP:g} s after"),
    ):
        if wrong.any():
            row = int(np.argmax(wrong)) + 1
            raise SloshModelError(
                f"t[{row}] = {t[row]:.9g} s {what} t[{row - 1}] = {t[row - 1]:.9g} s"
            )
