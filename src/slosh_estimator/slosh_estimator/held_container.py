"""Content of the robot's gripper: a container with its fill height, or nothing."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

from slosh_estimator.errors import SloshEstimatorError
from slosh_model.checks import mistaken_unit
from slosh_model.model import Model
from slosh_model.model_text import parse_model
from slosh_model.standing import BOUNDS, Standing
from slosh_model.tray import HIGHEST_LIMIT, Tray

CONTAINER: Final = "container"
EMPTY: Final = "gripper_empty"
FRESH: Final = "fresh_liquid"
TRAY_PLACE: Final = "tray_place"
"""Names of what the estimator's recorded settings tell of it, beside the model."""


@dataclass(frozen=True, slots=True)
class HeldContainer:
    """Content of the robot's gripper: a container with its fill height, or nothing.

    Attributes:
        model: of the container; where it is empty, of the last one.
        name: of the container; empty: it has none.
        empty: whether the gripper is empty.
        fill_height: that was given [m]; NaN: none was, and the camera's level stays.
        limit: of the heights [m]; NaN: that of each node.
        fresh: whether the liquid is another than before: still where the container is at rest.
        standing: how the container stands on a tray; None: it is held.

    Raises:
        SloshEstimatorError: an impossible limit.
    """

    model: Model
    name: str = ""
    empty: bool = False
    fill_height: float = math.nan
    limit: float = math.nan
    fresh: bool = False
    standing: Standing | None = None

    def __post_init__(self) -> None:
        given_limit(self.limit)

    def changed(
        self,
        *,
        empty: bool = False,
        name: str = "",
        model: Model | None = None,
        fill_height: float = math.nan,
        limit: float = math.nan,
        standing: Sequence[float] = (),
    ) -> HeldContainer:
        """Returns the gripper's content after a requested change.

        Args:
            empty: whether the gripper is empty from then on.
            name: of another container; empty: it stays.
            model: of that container; None: it stays.
            fill_height: [m]; NaN or 0: that of the model.
            limit: [m]; NaN or 0: that of each node.
            standing: numbers of `Standing`, or zeros for a container that is held; empty: as
                before, unless another container takes the place of one that stood loosely.

        Raises:
            SloshEstimatorError: these contradict each other, or say nothing; another container
                without its standing.
            SloshModelError: the container cannot be filled so, or cannot stand so.
        """
        fill, limit = fill_height or math.nan, given_limit(limit)
        given = bool(name) or model is not None or not math.isnan(fill) or len(standing) > 0
        if empty and given:
            raise SloshEstimatorError("empty with a container: give one of the two")
        if empty:
            return replace(self, empty=True, fresh=False, limit=math.nan, fill_height=math.nan)
        if not given and not self.empty:
            raise SloshEstimatorError("nothing to change: give empty, name, model or fill_height")
        held = self.model if model is None else model
        if not math.isnan(fill):
            held = held.filled_to(fill)
        other = bool(name or model is not None) and name != self.name
        return HeldContainer(
            held, name if model is not None else self.name, False, held.container.fill_height,
            limit, fresh=self.empty or other,
            standing=self._stands(standing, other=other or (model is not None and not name)),
        )  # fmt: skip

    def _stands(self, given: Sequence[float], *, other: bool) -> Standing | None:
        """Returns mass, base and friction of the container after a change; None if held firmly.

        Mass, base and friction of another container do not follow from its model, which tells the
        inside alone; those of the container before would foretell a wrong fall.
        """
        if len(given):
            if len(given) != len(BOUNDS):
                raise SloshEstimatorError(
                    f"standing = {list(given)!r:.60} must be {', '.join(BOUNDS)}, or empty"
                )
            return Standing(*map(float, given)) if any(given) else None
        if other and self.standing is not None:
            raise SloshEstimatorError(
                "standing is missing: another container comes to a place where the last one stood "
                f"loosely: give its {', '.join(BOUNDS)}, or four zeros where it is held"
            )
        return self.standing

    @property
    def recorded(self) -> dict[str, Any]:
        """Returns the container's description as values for the recorded settings, by name."""
        return {CONTAINER: self.name, EMPTY: self.empty, FRESH: self.fresh}

    @property
    def described(self) -> str:
        """Describes the held container and its height limit in one line for users."""
        if self.empty:
            return "no container"
        name = f"container {self.name}, " if self.name else ""
        limit = "" if math.isnan(self.limit) else f", limit {1e3 * self.limit:g} mm"
        return f"{name}{self.model.container.described}{limit}"


def tray_holding(tray: Tray, index: int, held: HeldContainer, limit: float = math.nan) -> Tray:
    """Returns a copy of the tray with another container, or none, in one place.

    Args:
        tray: before.
        index: of the place, from 0.
        held: what it holds.
        limit: of the place where that has none [m].
    """
    own = limit if math.isnan(held.limit) else held.limit
    before = tray.containers[index]
    return tray.with_container(
        index,
        replace(before, model=held.model, limit=own, empty=held.empty, standing=held.standing),
    )


def changed_place(parameters: Mapping[str, Any]) -> str:
    """Returns the tray place that recorded settings say was changed; empty for all places."""
    return str(parameters.get(TRAY_PLACE) or "")


def given_limit(limit: float) -> float:
    """Returns a limit of heights [m] that a request or message gives; NaN where it gives none.

    Args:
        limit: [m]; NaN or 0: none.

    Raises:
        SloshEstimatorError: an impossible limit.
    """
    if not limit or math.isnan(limit):
        return math.nan
    if not 0.0 < limit <= HIGHEST_LIMIT:
        meant = mistaken_unit(limit, "m", 0.0, HIGHEST_LIMIT)
        raise SloshEstimatorError(
            f"limit = {limit!r} m must lie above 0 and up to {HIGHEST_LIMIT:g} m{meant}"
        )
    return limit


def held_by(message: Any, start: Model) -> HeldContainer:
    """Returns the gripper's content according to a ContainerChange message.

    Args:
        message: as any middleware decodes it.
        start: the model that the asking node started with.

    Raises:
        SloshModelError: its model cannot be read.
        SloshEstimatorError: an impossible limit.
    """
    model = parse_model(message.model, "container.model") if message.model else start
    return HeldContainer(
        model, message.name, not message.present, message.fill_height, given_limit(message.limit)
    )


def empty_and_fresh(parameters: Mapping[str, Any]) -> tuple[bool, bool]:
    """Returns two booleans from recorded settings: gripper is empty, liquid was exchanged."""
    return parameters.get(EMPTY) is True, parameters.get(FRESH) is True
