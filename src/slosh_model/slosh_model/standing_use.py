"""Computes whether a loosely standing container slides, tips or lifts off its tray.

The liquid acts on its container by its total mass and by the modal masses that move in it (Ibrahim
2005, ch. 5; Dodge 2000, ch. 3). Coulomb friction holds the base as long as the lateral force is at
most μ times the normal force; the container stands as long as the centre of pressure lies within
its base. The inertia against rotation is neglected.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from slosh_base.types import Array
from slosh_model.constants import GRAVITY
from slosh_model.containers import X_AXIS, Y_AXIS, Container
from slosh_model.errors import SloshModelError
from slosh_model.least_wave import growing_waves
from slosh_model.model import Model
from slosh_model.simulate import Inputs, State, simulate
from slosh_model.standing import Standing

LEVELS = 64
"""Fill heights from which the centre of the liquid's mass is integrated."""


@dataclass(frozen=True, slots=True)
class StandingMasses:
    """Masses of a standing container and its liquid, with heights above the base.

    Attributes:
        total: of the container and the liquid [kg].
        centre_height: of the centre of both [m].
        modal: (modes, 2) of the modes along x and y [kg].
        heights: (modes, 2) of these masses [m].
    """

    total: float
    centre_height: float
    modal: Array
    heights: Array

    @classmethod
    def of(cls, model: Model, standing: Standing) -> StandingMasses:
        """Computes the masses of a model's liquid in its container.

        Raises:
            SloshModelError: the liquid's volume is not known.
        """
        container = model.container
        liquid = container.volume * model.liquid.density
        if not math.isfinite(liquid):
            raise SloshModelError(
                f"the liquid's volume in a {container.shape} is not known: whether the container "
                "keeps standing cannot be computed"
            )
        total = standing.mass + liquid
        moment = standing.mass * standing.centre_height + liquid * liquid_centre(container)
        modes = [mode.number for mode in model.mode_constants()]
        numbers = [(n, axis) for n in modes for axis in (X_AXIS, Y_AXIS)]
        modal = [liquid * container.mass_ratio(n, axis) for n, axis in numbers]
        heights = [container.fill_height + container.mass_height(n, axis) for n, axis in numbers]
        shape = (len(modes), 2)
        return cls(
            total, moment / total, np.reshape(modal, shape), np.reshape(heights, shape)
        )  # fmt: skip


class StandingUse(NamedTuple):
    """Fractions of the available friction and support base that a container uses in a motion.

    Attributes:
        friction: largest lateral force by what friction can hold; above 1 the container slides.
        tipping: largest distance of the centre of pressure from the base's centre by the base's
            radius; above 1 the container tips. Both are infinite where it lifts off.
    """

    friction: float
    tipping: float

    @property
    def stands(self) -> bool:
        """Whether the container neither slides nor tips nor lifts off."""
        return max(self) <= 1.0

    @property
    def words(self) -> str:
        """Describes by a verb what the container does: stand, slide, tip or lift off."""
        if self.stands:
            return "stands"
        if not all(map(math.isfinite, self)):
            return "lifts off"
        return "slides" if self.friction >= self.tipping else "tips"


@lru_cache(maxsize=32)  # a plan asks for each motion that it checks
def liquid_centre(container: Container) -> float:
    """Returns the height of the liquid's centre of mass above the floor [m]."""
    step = container.fill_height / LEVELS
    fills = step * np.arange(1, LEVELS + 1)
    volumes = [container.filled_to(fill, container.rim_height).volume for fill in fills.tolist()]
    below = step * (sum(volumes) - 0.5 * volumes[-1])
    return container.fill_height - below / volumes[-1]


def standing_use(
    model: Model,
    standing: Standing,
    inputs: Inputs,
    place: Array | None = None,
    state: State | None = None,
) -> StandingUse:
    """Simulates a motion; returns the fractions of friction and support base that it uses.

    Args:
        model: of the liquid, as the tray's motion drives it.
        standing: how the container stands.
        inputs: motion of the tray's frame.
        place: (3,) of the centre of the still surface in that frame [m]; None: its origin.
        state: of the liquid at the first sample; None: at rest, but for the smallest wave.
    """
    found = _use(model, standing, inputs, place, state)
    (waves,) = growing_waves(model, [inputs])
    for wave in waves.starts if waves else ():
        started = State(
            float(inputs.t[0]),
            wave if state is None else wave + state.modal,
            np.zeros(4) if state is None else state.held,
            None if state is None else state.memory,
        )
        other = _use(model.spatial(), standing, inputs, place, started)
        found = StandingUse(*map(max, found, other))
    return found


def _use(
    model: Model, standing: Standing, inputs: Inputs, place: Array | None, state: State | None
) -> StandingUse:
    """Simulates a motion from a state; returns what it uses; as `standing_use`."""
    masses = StandingMasses.of(model, standing)
    modal = simulate(model, inputs, state)[0].modal
    above = np.array([0.0, 0.0, masses.centre_height - model.container.fill_height])
    force = specific_force(inputs, above if place is None else place + above)
    displacement, speed = modal[:, :, :2], modal[:, :, 2:]
    if not model.container.follows_yaw:
        displacement, speed = (_turned(one, -inputs.yaws) for one in (displacement, speed))
    change = np.gradient(speed, inputs.t, axis=0)
    axes = model.container.axes(model.mode_count)
    turn = Rotation.from_euler("z", axes).as_matrix()[:2, :2]
    displaced, pulled, lifted = (
        one.sum(axis=1) @ turn.T
        for one in (
            masses.modal * displacement, masses.modal * change,
            masses.modal * masses.heights * change,
        )
    )  # fmt: skip
    lateral = masses.total * force[:, :2] + pulled
    normal = masses.total * force[:, 2]
    moment = displaced * force[:, 2:] - masses.total * masses.centre_height * force[:, :2] - lifted
    held = np.where(normal > 0.0, normal, np.nan)
    slip = np.hypot(*lateral.T) / (standing.friction * held)
    tip = np.hypot(*moment.T) / (standing.base_radius * held)
    return StandingUse(_largest(slip), _largest(tip))


def specific_force(inputs: Inputs, arm: Array) -> Array:
    """Returns the specific force (N, 3) [m/s²] at a point of a moving frame, in its axes.

    Args:
        inputs: motion of the frame's origin.
        arm: (3,) of the place in the frame [m].
    """
    force: Array = inputs.acceleration + np.array([0.0, 0.0, GRAVITY])
    if len(inputs.poses) == 0:
        return force
    attitude, rate, change = np.split(inputs.poses[:, :10], [4, 7], axis=1)
    turned: Array = Rotation.from_quat(attitude).inv().apply(force)
    return turned + np.cross(change, arm) + np.cross(rate, np.cross(rate, arm))


def _turned(vectors: Array, angle: Array) -> Array:
    """Rotates vectors (N, modes, 2) by angles (N,) [rad]."""
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)


def _largest(used: Array) -> float:
    """Returns the largest value, or infinity if a value is unknown."""
    return float(used.max()) if np.isfinite(used).all() else math.inf
