"""Initial state of the liquid when a motion begins."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from slosh_base.types import Array
from slosh_model.model import Model
from slosh_model.simulate import State
from slosh_plan.errors import SloshPlanError


@dataclass(frozen=True, slots=True, eq=False)
class LiquidState:
    """State of the liquid in linear and nonlinear model, in the axes of `slosh_model.State.modal`.

    >>> import numpy as np
    >>> from slosh_plan import LiquidState
    >>> LiquidState(np.zeros((1, 4)), np.zeros((1, 4))).linear.shape
    (1, 4)

    Attributes:
        linear: (modes, 4) x, y, vx, vy of each mode's mass in the L model [m, m/s].
        nonlinear: the same of the NL model.

    Raises:
        SloshPlanError: a shape that is none, or a value that is not finite.
    """

    linear: Array
    nonlinear: Array

    def __post_init__(self) -> None:
        for name in ("linear", "nonlinear"):
            value = np.array(getattr(self, name), dtype=np.float64)
            if value.ndim != 2 or value.shape[1] != 4 or not np.isfinite(value).all():
                raise SloshPlanError(
                    f"the liquid's state ({name}) must be finite numbers of the shape (modes, 4), "
                    f"not {value.shape}"
                )
            value.setflags(write=False)
            object.__setattr__(self, name, value)


LiquidStates = LiquidState | Mapping[str, LiquidState]
"""State of one container's liquid, or of each container's on a tray by its name."""


def state_of(states: LiquidStates | None, container: str) -> LiquidState | None:
    """Returns the state of the liquid in a container; None if the liquid is at rest.

    Raises:
        SloshPlanError: the containers' states do not contain it.
    """
    if states is None or isinstance(states, LiquidState):
        return states
    if container not in states:
        raise SloshPlanError(f"the state of the liquid in container {container!r} is not given")
    return states[container]


def begun(model: Model, modal: Array | None, t: float) -> State | None:
    """Returns a model's state at a motion's start time t [s]; None if the liquid is at rest.

    Raises:
        SloshPlanError: the state of another model.
    """
    if modal is None:
        return None
    if len(modal) != model.mode_count:
        raise SloshPlanError(
            f"the liquid's state has {len(modal)} modes, the model {model.mode_count}"
        )
    return State(t, modal, np.zeros(4))
