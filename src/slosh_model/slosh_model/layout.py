"""Memory layout of a running model in compiled code: one array of floats.

They lie in one flat array of floats behind each other: Python hands that over in half the time of
two arrays, and in a quarter of that of arrays of records.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slosh_base.compiled.compilation import compiled
from slosh_model.effects.registry import DRIVE_MEMORY_COUNT, PARAMETER_COUNT
from slosh_model.errors import SloshModelError
from slosh_model.outline_wall import MOST_CORNERS

RUN = np.dtype(
    [
        ("max_step", np.float64),  # longest sub-step [s]
        ("cornered", np.float64),  # not 0 where the wall has corners
        # Wall height per acceleration that follows it at once, along x and y [s²], and 1 where the
        # vertical acceleration acts.
        ("static_height", np.float64),
        ("static_height_y", np.float64),
        ("lift", np.float64),
        ("axes", np.float64),  # azimuth of the modes' axes from the container's +x [rad]
        # Corners of the wall, x and y by the reaches along them; none: round, or a rectangle.
        ("corner_count", np.float64),
        ("corners", np.float64, (MOST_CORNERS, 2)),
        ("parameters", np.float64, (PARAMETER_COUNT,)),  # switches and parameters of the effects
        ("started", np.float64),  # 0 before the first sample
        ("elapsed", np.float64),  # time since rest [s]
        # The last input: acceleration in axes that do not yaw [m/s²], the angle of the
        # container's x axis in them, and its yaw as it was given [rad].
        ("ax", np.float64),
        ("ay", np.float64),
        ("az", np.float64),
        ("turn", np.float64),
        ("yaw", np.float64),
        ("drive_memory", np.float64, (max(DRIVE_MEMORY_COUNT, 1),)),  # of effects on the input
    ],
    align=True,
)
"""A model that runs. Zeros from `started` on: at rest, before any sample."""

MODE = np.dtype(
    [
        ("natural_frequency", np.float64),  # [rad/s]
        ("damping_ratio", np.float64),
        ("curvature", np.float64),
        ("radius", np.float64),  # R [m]
        ("height_gain", np.float64),  # wall height per displacement [1]
        ("xi", np.float64),
        ("fill_height", np.float64),  # h [m]
        ("frequency_ratio", np.float64),  # natural frequency along y relative to that along x
        ("radius_y", np.float64),
        ("height_gain_y", np.float64),
        # Direction of a mode that moves along one line; zeros: along both axes.
        ("along_x", np.float64),
        ("along_y", np.float64),
        # Its mass: place [m] and velocity [m/s].
        ("x", np.float64),
        ("y", np.float64),
        ("vx", np.float64),
        ("vy", np.float64),
    ],
    align=True,
)
"""A mode's constants and its state."""

MODAL = ("x", "y", "vx", "vy")
"""The fields of MODE that hold its state."""

_WORD = np.dtype(np.float64).itemsize
_RUN_LENGTH = RUN.itemsize // _WORD
_STATE = RUN.fields["started"][1] // _WORD  # type: ignore[index]


def new_store(mode_count: int) -> NDArray[np.float64]:
    """Returns the zero-filled array (M,) that holds a model with `mode_count` modes."""
    return np.zeros(_RUN_LENGTH + mode_count * MODE.itemsize // _WORD)


def divided(store: NDArray[np.float64]) -> tuple[NDArray[np.void], NDArray[np.void]]:
    """Returns a model's state array as structured records: one RUN, and one MODE for each mode."""
    return store[:_RUN_LENGTH].view(RUN), store[_RUN_LENGTH:].view(MODE)


def back_to_rest(store: NDArray[np.float64]) -> None:
    """Resets a model's state array to rest, the state before the first sample."""
    store[_STATE:_RUN_LENGTH] = 0.0
    for name in MODAL:
        divided(store)[1][name] = 0.0


def moving_part(store: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns a copy (M,) of the values in a model's array that change during a motion."""
    modes = divided(store)[1]
    return np.concatenate([store[_STATE:_RUN_LENGTH], *(modes[name] for name in MODAL)])


def set_moving_part(store: NDArray[np.float64], values: NDArray[np.float64]) -> None:
    """Restores values that `moving_part` returned for a model with as many modes.

    Raises:
        SloshModelError: it is one of another number of modes or another version.
    """
    modes = divided(store)[1]
    run = _RUN_LENGTH - _STATE
    expected = run + len(MODAL) * len(modes)
    if len(values) != expected:
        raise SloshModelError(f"a state of {len(values)} numbers, the model has {expected}")
    store[_STATE:_RUN_LENGTH] = values[:run]
    for name, column in zip(MODAL, values[run:].reshape(len(MODAL), -1), strict=True):
        modes[name] = column


records = compiled(divided)
"""`divided` for compiled code."""
