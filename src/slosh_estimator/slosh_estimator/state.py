"""The complete state of an estimator."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from slosh_base.types import Array
from slosh_motion.inputs.sampling import Sample

_POSE = 4  # where a sample's pose begins


class EstimatorState(NamedTuple):
    """Complete state of an estimator after a sample; restoring it gives identical results.

    Attributes:
        sample: the last one.
        first_ns: stamp of the first one [ns].
        settled_ns: from when on the liquid's state is known [ns].
        linear, nonlinear: (M,) the moving part of each model; see `slosh_model.layout`.
        checks: (K,) what the checks and the effects on the measurement remember.
    """

    sample: Sample
    first_ns: int
    settled_ns: int
    linear: Array
    nonlinear: Array
    checks: Array

    @classmethod
    def of_message(cls, message: Any) -> EstimatorState:
        """Returns the state that an EstimatorState message of any reader holds."""
        ax, ay, az, yaw = message.sample[:_POSE].tolist()
        pose = tuple(message.sample[_POSE:].tolist()) or None
        sample = Sample(int(message.sample_stamp), ax, ay, az, yaw, pose=pose)
        parts = (message.linear, message.nonlinear, message.checks)
        return cls(
            sample, int(message.first_stamp), int(message.settled_stamp), *map(np.array, parts)
        )
