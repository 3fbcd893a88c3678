"""What the monitor watches: limits, and how long it is patient."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from slosh_estimator.errors import SloshEstimatorError
from slosh_estimator.limits import Hysteresis, Source


@dataclass(frozen=True, slots=True)
class MonitorSettings:
    """What the monitor watches.

    Attributes:
        measured_limit, estimated_limit, disagreement_limit: [m]; NaN: not watched.
        warn_share: share of a limit from which the state is WARN.
        hysteresis: how an excess ends.
        timeout: a side that was silent for so long counts as stale [s]; below 0.5.
        buffer: how far back estimates are kept [s].
        max_gap: widest pair of estimates between which is interpolated [s].
        camera: whether there is one; without, the estimate alone is watched.

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

    @classmethod
    def from_parameters(cls, parameters: Mapping[str, Any]) -> MonitorSettings:
        """The settings that a monitor node's parameters, by name, mean.

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
        )

    @property
    def limits(self) -> dict[Source, float]:
        """The limit of each quantity that is watched [m]."""
        return {
            Source.MEASURED: self.measured_limit,
            Source.ESTIMATED: self.estimated_limit,
            Source.DISAGREEMENT: self.disagreement_limit,
        }

    def __post_init__(self) -> None:
        for name in ("timeout", "buffer", "max_gap", "warn_share"):
            if not getattr(self, name) > 0.0:
                raise SloshEstimatorError(f"{name} = {getattr(self, name)!r} must be positive")
