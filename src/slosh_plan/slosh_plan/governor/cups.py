"""The containers whose height limits the governor keeps, as arrays for its compiled code."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from slosh_base.types import Array
from slosh_model import kernel as model_kernel
from slosh_model.layout import divided
from slosh_model.model import Model
from slosh_model.simulate import store_of
from slosh_model.standing import Standing
from slosh_model.standing_use import StandingMasses
from slosh_model.tray import ARM, Tray, TrayContainer
from slosh_plan.errors import SloshPlanError
from slosh_plan.governor import layout
from slosh_plan.governor.waves import kind_of
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.tray import limits_of
from slosh_plan.tuning import TUNING

Point = tuple[float, float, float, float]
STILLING = 0.7
"""Damping ratio with which a liquid comes to rest before the first step."""
Factors = Sequence[tuple[float, float]]


@dataclass(frozen=True, slots=True)
class Cup:
    """A container whose height limit the governor keeps, with its model and position.

    Attributes:
        name: of the container; empty: it is the only one.
        model: NL twin of its liquid.
        limits: of its height, with its rim; and shares of friction and base.
        place: of the still surface in the moving frame [m].
        standing: how it stands on the tray; None: it is held.
    """

    name: str
    model: Model
    limits: PlanLimits
    place: tuple[float, float, float]
    standing: Standing | None

    @property
    def points(self) -> tuple[Point, Point]:
        """Still surface and centre of mass in tray axes [m]: (x, y, z, whether liquid yaws)."""
        turns = float(self.model.container.follows_yaw)
        x, y, z = self.place
        if self.standing is None:
            return (x, y, z, turns), (x, y, z, turns)
        masses = StandingMasses.of(self.model, self.standing)
        below = masses.centre_height - self.model.container.fill_height
        return (x, y, z, turns), (x, y, z + below, turns)


def cups_of(tray: Tray, limits: PlanLimits, *, turns: bool) -> tuple[Cup, ...]:
    """Returns the containers on a tray whose limits the governor keeps, in the tray's order.

    Args:
        tray: the tray, or a model as a tray of one.
        limits: of each, lowered to its own limit and rim.
        turns: whether the tray turns: otherwise equal containers are one.

    Raises:
        SloshPlanError: no container, no limit of a height, a loosely standing container whose
            model has several modes or whose outline has no axis of symmetry.
    """
    if not tray.present:
        raise SloshPlanError("the tray is empty: no liquid to keep safe")
    found: dict[object, Cup] = {}
    for one in tray.present:
        cup = _cup(one, limits)
        equal = cup.name if turns else (cup.model, cup.limits, cup.standing)
        found.setdefault(equal, cup)
    return tuple(found.values())


def _cup(one: TrayContainer, limits: PlanLimits) -> Cup:
    own = limits_of(one, limits).under_rim(one.model)
    where = f"{one.name}: " if one.name else ""
    if not math.isfinite(own.height):
        raise SloshPlanError(f"{where}the governor needs a limit of the height, or a rim")
    if one.standing is not None and len(one.model.mode_constants()) > 1:
        raise SloshPlanError(
            f"{where}stands loosely: the governor needs a model with one mode, without second_mode"
        )
    if one.standing is not None and one.model.container.one_directional:
        raise SloshPlanError(
            f"{where}stands loosely: the governor needs an outline with an axis of symmetry"
        )
    arm = next((use.parameters for use in one.placed.effects if use.name == ARM), None)
    place = (0.0, 0.0, 0.0) if arm is None else (arm["x"], arm["y"], arm["z"])
    return Cup(one.name, one.model.nonlinear(), own, place, one.standing)


def spacing_of(cups: Sequence[Cup], period: float) -> tuple[int, float]:
    """Returns steps per sample of a predicted stop, and the modes' highest frequency [rad/s]."""
    fastest = max(mode.natural_frequency for cup in cups for mode in cup.model.mode_constants())
    return max(math.floor(TUNING.governor_phase / fastest / period), 1), fastest


def stores_of(cups: Sequence[Cup], factors: Factors) -> Array:
    """Returns the state arrays of all models of all containers at rest, one model per row."""
    rows = [_twin(cup.model, *pair) for cup in cups for pair in factors]
    found = np.zeros((len(rows), max(map(len, rows))))
    for row, store in zip(found, rows, strict=True):
        row[: len(store)] = store
    return found


def table_of(cups: Sequence[Cup], spacing: float, *, turns: bool) -> tuple[Array, Array]:
    """Returns containers' parameters (C, CUP), and the points (P, 4) whose acceleration is used.

    Args:
        cups: the containers.
        spacing: time of a row [s].
        turns: whether the tray turns; otherwise one point stands for all.
    """
    points: list[Point] = []
    table = np.zeros((len(cups), layout.CUP))
    for row, cup in zip(table, cups, strict=True):
        own = cup.points if turns else ((0.0, 0.0, 0.0, 0.0),) * 2
        for column, point in zip((layout.POINT, layout.MASS_POINT), own, strict=True):
            if point not in points:
                points.append(point)
            row[column] = points.index(point)
        _fill(row, cup, spacing)
    return table, np.array(points)


def _fill(row: Array, cup: Cup, spacing: float) -> None:
    model = cup.model
    fastest = max(mode.natural_frequency for mode in model.mode_constants())
    row[layout.LIMIT], row[layout.SIZE] = cup.limits.height, len(store_of(model))
    row[layout.WAVE] = kind_of(model)
    row[layout.DRIVEN] = bool(model.uses("drive"))
    row[layout.MODULATED] = bool(model.uses("modulation"))
    row[layout.STEPS] = math.ceil(spacing * fastest / (2.0 * TUNING.governor_phase))
    if cup.standing is not None:
        masses = StandingMasses.of(model, cup.standing)
        row[layout.FRICTION] = cup.limits.friction * cup.standing.friction
        row[layout.BASE] = cup.limits.tipping * cup.standing.base_radius
        row[layout.CENTRE] = masses.centre_height
        row[layout.MASS_X : layout.MASS_Y + 1] = masses.modal[0] / masses.total
        row[layout.ARM_X : layout.ARM_Y + 1] = masses.heights[0]


def _twin(model: Model, frequency: float, damping: float) -> Array:
    """Returns the state array, at rest, of a model with scaled frequencies and damping ratios."""
    other = replace(model, natural_frequency=model.mode_frequency(1) * frequency, covariance=None)
    store = store_of(other)
    divided(store)[1]["damping_ratio"] *= damping
    model_kernel.step(store, 0.0, 0.0, 0.0, 0.0)  # at rest, before the first step
    return store


def settle(store: Array, felt: Array, period: float) -> None:
    """Brings a model's liquid to rest in a tilted container, under a constant acceleration.

    Args:
        store: of the model; changed.
        felt: (3,) acceleration that the container feels [m/s²].
        period: of the first mode [s].
    """
    modes = divided(store)[1]
    damping = modes["damping_ratio"].copy()
    modes["damping_ratio"] = STILLING
    for _ in range(400):
        model_kernel.step(store, period / 20.0, *felt.tolist())
    modes["damping_ratio"] = damping
