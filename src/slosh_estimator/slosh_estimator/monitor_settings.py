"""Settings of the monitor: limits and timeouts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from slosh_estimator.errors import SloshEstimatorError
from slosh_estimator.limits import LIMIT, Hysteresis, Source
from slosh_model.errors import SloshModelError
from slosh_model.model import Model
from slosh_model.wall import rim_name

HEIGHT_LIMITS = ("measured_limit", "estimated_limit")
"""Names of the limits that a container's own limit takes the place of."""
RIM, RIM_DISTANCE = "rim", "rim_distance"
"""Names among the recorded settings of the monitor: of the height that the rim allows, and of the
distance that is kept to it."""


@dataclass(frozen=True, slots=True)
class MonitorSettings:
    """Limits and timeouts of the monitor, from its parameters.

    >>> MonitorSettings(measured_limit=0.02).limits[Source.MEASURED]  # m
    0.02

    Attributes:
        measured_limit, estimated_limit, disagreement_limit: [m]; NaN: not watched.
        warn_share: share of a limit from which the state is WARN.
        hysteresis: how an excess ends.
        timeout: a side that was silent for so long counts as stale [s]; below 0.5.
        buffer: how far back estimates are kept [s].
        max_gap: widest pair of estimates between which is interpolated [s].
        camera: whether there is one; without, the estimate alone is watched.
        rim: height at which the liquid comes as near to the container's rim as it may [m]; where
            it is lower than a limit of the height, it holds instead. NaN: not known.
        rim_distance: that least vertical distance to the rim [m]; 0: the rim itself.

    Raises:
        SloshEstimatorError: a value does not fit.
    """

    measured_limit: float = math.nan
    estimated_limit: float = math.nan
    disagreement_limit: float = math.nan
    warn_share: float = 0.8
    hysteresis: Hysteresis = field(default_factory=Hysteresis)
    timeout: float = 0.3
    buffer: float = 2.0
    max_gap: float = 0.05
    camera: bool = True
    rim: float = math.nan
    rim_distance: float = 0.0

    @classmethod
    def from_parameters(cls, parameters: Mapping[str, Any]) -> MonitorSettings:
        """Creates the settings from the parameters of a monitor node.

        Raises:
            KeyError: one is missing.
            TypeError, ValueError: one cannot be.
        """
        return cls(
            parameters["measured_limit"],
            parameters["estimated_limit"],
            parameters["disagreement_limit"],
            parameters["warn_share"],
            Hysteresis(parameters["release"], round(parameters["hold"] * 1e9)),
            parameters["timeout"],
            parameters["buffer"],
            # Recordings of before know of no cell without a camera.
            camera=parameters.get("camera", True),
            # It is no parameter of the node, which learns it of the estimator's model.
            rim=parameters.get(RIM, math.nan),
            rim_distance=parameters.get(RIM_DISTANCE, 0.0),
        )

    @classmethod
    def from_partial(cls, parameters: Mapping[str, Any]) -> MonitorSettings:
        """Creates settings from whichever limits the parameters contain; others are unlimited."""
        names = ("measured_limit", "estimated_limit", "disagreement_limit", RIM, RIM_DISTANCE)
        values = [parameters.get(name) for name in names]
        measured, estimated, apart, rim, distance = (
            float(value) if isinstance(value, int | float) else math.nan for value in values
        )
        distance = distance if distance > 0.0 else 0.0
        return cls(measured, estimated, apart, rim=rim, rim_distance=distance)

    @property
    def limits(self) -> dict[Source, float]:
        """Limit of each monitored quantity [m]; heights are also limited by the rim."""
        return {
            # `fmin`: a limit that is not watched, and a rim that is not known, are NaN.
            Source.MEASURED: float(np.fmin(self.measured_limit, self.rim)),
            Source.ESTIMATED: float(np.fmin(self.estimated_limit, self.rim)),
            Source.DISAGREEMENT: self.disagreement_limit,
        }

    def at_rim(self, source: Source) -> bool:
        """Returns whether the rim limits a quantity, because no lower limit is set."""
        given = {Source.MEASURED: self.measured_limit, Source.ESTIMATED: self.estimated_limit}
        return source in given and bool(self.rim <= np.fmin(given[source], math.inf))

    def limit_name(self, source: Source) -> str:
        """Returns the name of what limits a quantity: a set limit, the rim or a rim distance."""
        return rim_name(self.rim_distance) if self.at_rim(source) else LIMIT

    def under_rim(self, model: Model) -> MonitorSettings:
        """Returns the settings with the rim of a model's container as a limit of the heights.

        Raises:
            SloshModelError: a distance to the rim that its still liquid does not keep, or one to
                a rim that is not known.
        """
        rim = model.container.height_below_rim(self.rim_distance)
        return replace(self, rim=math.nan if rim is None else rim)

    def near_rim(self, model: Model) -> tuple[float, str]:
        """Returns the height [m] that the rim allows, and why a rim distance cannot be kept.

        Where the distance to the rim cannot be kept, the complaint says why, and the rim itself
        holds. It is empty otherwise.
        """
        try:
            return self.under_rim(model).rim, ""
        except SloshModelError as error:
            return replace(self, rim_distance=0.0).under_rim(model).rim, f"rim_distance: {error}"

    def __post_init__(self) -> None:
        for name in ("timeout", "buffer", "max_gap", "warn_share"):
            if not getattr(self, name) > 0.0:
                raise SloshEstimatorError(f"{name} = {getattr(self, name)!r} must be positive")
        if not 0.0 <= self.rim_distance < math.inf:
            raise SloshEstimatorError(
                f"rim_distance = {self.rim_distance!r} m must not be negative"
            )
