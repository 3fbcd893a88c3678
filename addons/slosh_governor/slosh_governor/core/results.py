"""Results of the governor's steps, from its motion and the heights."""

from __future__ import annotations

import math

import numpy as np

from slosh_base.files.nanoseconds import SECOND
from slosh_governor.core import layout
from slosh_governor.core.commands import Governed, GovernorState
from slosh_governor.core.doubts import LiquidDoubts
from slosh_governor.core.mechanics import Mechanics
from slosh_governor.core.requests import Requests


class Results:
    """Creates the results of steps; what was not looked at in a step is that of the one before.

    Args:
        mechanics: motion and models.
        doubts: of the liquids.
        requests: to the governor.
    """

    def __init__(self, mechanics: Mechanics, doubts: LiquidDoubts, requests: Requests) -> None:
        self._mechanics, self._doubts, self._requests = mechanics, doubts, requests
        self._uses, self._own = mechanics.told.copy(), np.zeros(len(mechanics.cups))
        self._loose = [k for k, cup in enumerate(mechanics.cups) if cup.standing is not None]
        self._joint_start: tuple[float, ...] = ()

    def start_at(self, joints: tuple[float, ...]) -> None:
        """Stores measured joint positions (J,), from which the next result's motion goes on."""
        self._joint_start = joints

    def idle(self) -> None:
        """Forgets what the last step used: the container is at rest."""
        self._mechanics.told[:] = 0.0
        self._own[:] = 0.0

    def governed(self, now_ns: int, steps: int, *, share: float, safe: bool) -> Governed:
        """Creates the result of a step from the present motion and heights.

        Args:
            now_ns: time of the step [ns].
            steps: how many were made.
            share: of the command that is followed.
            safe: whether the models keep the limits, with what is allowed for unknown waves.
        """
        one, requests, unknown = self._mechanics, self._requests, self._doubts.wave.heights
        told, extra = one.told, one.table[:, layout.EXTRA]
        # What is left of a held stop uses no more than all of it.
        looked = told == told
        np.copyto(self._uses, told, where=looked)
        np.copyto(self._own, told[:, layout.PEAK] - extra, where=looked[:, layout.PEAK])
        peaks, limits = np.maximum(self._own, 0.0) + unknown, one.table[:, layout.LIMIT]
        uses = self._uses[:, layout.SLIP :].max(axis=1)
        # Unsafe by the height that an unknown wave may gain is still safe; so are waves that leave
        # more room than what is kept for the motion.
        safe = safe or bool(looked[:, layout.PEAK].all() and (uses <= 1.0).all())
        safe = safe and bool((peaks <= limits).all())
        safe = safe and not any(unknown[k] > extra[k] for k in self._loose)
        shares = np.maximum(uses, peaks / limits)
        worst = int(shares.argmax()) if len(one.cups) > 1 else 0
        peak, nominal = float(peaks[worst]), float(self._uses[worst, layout.NOMINAL])
        friction = tipping = math.nan
        if self._loose:
            friction, tipping = self._uses[self._loose, layout.SLIP :].max(axis=0).tolist()
        velocity, acceleration, position = map(tuple, one.moved.tolist())
        start, self._joint_start = self._joint_start, ()
        return Governed(
            now_ns, velocity, acceleration, position, share, self._state(share), requests.reason,
            safe, peak, peak - nominal,
            one.cups[worst].limits.height, float(one.answer[layout.REST]),
            self.age(now_ns),
            steps, requests.count, self._doubts.liquid_ns,
            one.cups[worst].name, friction, tipping,
            tuple(map(tuple, one.joints.tolist())) if one.joints.size else (),
            self.wanted,
            one.carrier.refused_by(share) if requests.follows else "",
            start, float(unknown[worst]), str(self._doubts.wave.cause),
            self._doubts.since_ns or 0,
        )  # fmt: skip

    def age(self, now_ns: int) -> float:
        """Returns the age of a command at a step; see `Governed.age`."""
        sent_ns = self._requests.sent_ns
        return (now_ns - sent_ns) / SECOND if sent_ns > 0 else math.nan

    @property
    def wanted(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Velocities and targets (D,) of the last command; NaN: not given."""
        none, latest = (math.nan,) * self._mechanics.motion.shape[1], self._requests.latest
        return latest.velocity or none, latest.target or none

    def _state(self, share: float) -> GovernorState:
        if self._requests.follows:
            return GovernorState.FOLLOWING if share == 1.0 else GovernorState.LIMITED
        return GovernorState.RESTING if self._mechanics.rests else GovernorState.STOPPING
