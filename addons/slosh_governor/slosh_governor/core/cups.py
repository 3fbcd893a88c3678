"""The containers whose height limits the governor keeps, as arrays for its compiled code."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from slosh_base.types import Array
from slosh_governor.core import layout
from slosh_governor.core.waves import kind_of
from slosh_governor.tuning import TUNING
from slosh_model import kernel as model_kernel
from slosh_model.constants import GRAVITY
from slosh_model.layout import divided
from slosh_model.model import Model
from slosh_model.simulate import store_of
from slosh_model.standing import Standing
from slosh_model.standing_use import StandingMasses
from slosh_model.tray import ARM, Tray, TrayContainer
from slosh_plan.errors import SloshPlanError
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.tray import limits_of

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
    def gains(self) -> Array:
        """Heights at the wall per displacement of the first mode along x and y [1]."""
        mode = divided(store_of(self.model))[1][0]
        return np.array([float(mode["height_gain"]), float(mode["height_gain_y"])])

    @property
    def fastest(self) -> float:
        """Highest natural frequency of its modes [rad/s]."""
        return max(mode.natural_frequency for mode in self.model.mode_constants())

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


def steps_of(cups: Sequence[Cup], period: float) -> int:
    """Returns the steps of a `period` [s] per sample of a predicted stop."""
    fastest = max(cup.fastest for cup in cups)
    return max(math.floor(TUNING.phase / fastest / period), 1)


def reserve_of(cups: Sequence[Cup], spacing: float, error: float) -> float:
    """Returns the part by which heights are raised: a crest between samples is above both.

    Samples are so near that it is never negative, at any rate and for any modes.

    Args:
        cups: the containers.
        spacing: time of a row [s].
        error: of the natural frequencies, relative.
    """
    phase = max(
        spacing * cup.fastest * (1.0 + error) / _parts(cup, spacing, error) for cup in cups
    )
    return (1.0 + TUNING.reserve) / math.cos(0.5 * phase) - 1.0


def _parts(cup: Cup, spacing: float, error: float) -> int:
    """Returns into how many samples a row is divided; see `uses.add_uses`."""
    phase = spacing * cup.fastest * (1.0 + error)
    return math.ceil(phase / (2.0 * TUNING.phase))


def stores_of(cups: Sequence[Cup], factors: Factors) -> Array:
    """Returns the state arrays of all models of all containers at rest, one model per row."""
    rows = [_twin(cup.model, *pair) for cup in cups for pair in factors]
    found = np.zeros((len(rows), max(map(len, rows))))
    for row, store in zip(found, rows, strict=True):
        row[: len(store)] = store
    return found


def table_of(
    cups: Sequence[Cup], spacing: float, error: float, *, turns: bool
) -> tuple[Array, Array]:
    """Returns containers' parameters (C, CUP), and the points (P, 4) whose acceleration is used.

    Args:
        cups: the containers.
        spacing: time of a row [s].
        error: of the natural frequencies, relative.
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
        _fill(row, cup)
        row[layout.PARTS_OF_ROW] = _parts(cup, spacing, error)
    return table, np.array(points)


def _fill(row: Array, cup: Cup) -> None:
    model, store = cup.model, store_of(cup.model)
    run = divided(store)[0]
    row[layout.PUMP] = cup.fastest * float(run[0]["lift"]) / (2.0 * GRAVITY)
    row[layout.LIMIT], row[layout.SIZE] = cup.limits.height, len(store)
    row[layout.WAVE] = kind_of(model)
    row[layout.DRIVEN] = bool(model.uses("drive"))
    row[layout.MODULATED] = bool(model.uses("modulation"))
    if cup.standing is not None:
        masses = StandingMasses.of(model, cup.standing)
        row[layout.FRICTION] = cup.limits.friction * cup.standing.friction
        row[layout.BASE] = cup.limits.tipping * cup.standing.base_radius
        row[layout.CENTRE] = masses.centre_height
        row[layout.MASS_X : layout.MASS_Y + 1] = masses.modal[0] / masses.total
        row[layout.ARM_X : layout.ARM_Y + 1] = masses.heights[0]
        stiffness = cup.fastest**2
        moved = row[layout.MASS_X : layout.MASS_Y + 1] / cup.gains
        moments = GRAVITY + np.abs(row[layout.ARM_X : layout.ARM_Y + 1]) * stiffness
        row[layout.PUSH] = float((moved * stiffness).max())
        row[layout.SWAY] = float((moved * moments).max())


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
