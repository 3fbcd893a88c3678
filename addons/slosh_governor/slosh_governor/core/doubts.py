"""What is not known of the liquids, and what an observer tells of it."""

from __future__ import annotations

import math

import numpy as np

from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array
from slosh_governor.core import layout
from slosh_governor.core.commands import ModelDoubt, SeenLiquid
from slosh_governor.core.mechanics import Mechanics
from slosh_governor.core.past import PastLiquid
from slosh_governor.core.seen import Witness, refusal
from slosh_governor.core.step_clock import Lapse
from slosh_governor.core.unknown import Cause, UnknownWave, advanced, measured, wave_heights
from slosh_governor.tuning import TUNING
from slosh_plan.heights import first_period


class LiquidDoubts:
    """Holds the waves that may be in the containers beside those of the models, and their causes.

    Args:
        mechanics: motion and models.
        doubt: by how much the liquids may differ from the models.
        period: time of a step [s].
        timeout: for so long a robot holds its velocity [s].
        at_rest: whether the liquids are at rest at the first step.
        watched: whether observed states are of the first container.

    Attributes:
        wave: the unknown waves.
        since_ns: from when on the first unknown wave decays [ns]; 0: there is none; None: the
            governor was not asked yet.
        liquid_ns: stamp of the last observed state that was taken [ns]; 0: none.
    """

    def __init__(
        self,
        mechanics: Mechanics,
        doubt: ModelDoubt,
        period: float,
        timeout: float,
        *,
        at_rest: bool,
        watched: bool,
    ) -> None:
        self._mechanics, self._period, self._timeout = mechanics, period, timeout
        self._watched = watched
        self.wave = UnknownWave(mechanics.cups, doubt)
        self.since_ns: int | None = 0 if at_rest else None
        self._gains = np.array([cup.gains.max() for cup in mechanics.cups])
        first = mechanics.cups[0]
        self._modes, self._limit = first.model.modes, first.limits.height
        self._past = PastLiquid(mechanics.first)
        frequencies = np.array([frequency for frequency, _ in doubt.factors])
        self._witness = Witness(frequencies, first_period(first.model), self._limit)
        self._seen: SeenLiquid | None = None
        self.liquid_ns = 0
        for one in (advanced, measured):
            one.load()

    def see(self, liquid: SeenLiquid) -> str:
        """Stores an observed state for the next step; returns why it is not used, if it is not."""
        last = self.liquid_ns if self._seen is None else self._seen.stamp_ns
        found = refusal(liquid, self._modes, last)
        if not found and self._watched:
            self._seen = liquid
        return found

    def idle(self, now_ns: int) -> None:
        """Lets the first unknown waves decay before the first step."""
        if self.since_ns is None:
            self.since_ns = now_ns
        if self.since_ns:
            self.wave.heights = self.wave.waited((now_ns - self.since_ns) / SECOND)
            self.wave.cause = Cause.START

    def begin(self, now_ns: int) -> None:
        """Sets the unknown waves of the first step: the largest, decayed since the first call."""
        if self.since_ns is None:
            self.since_ns = now_ns
        if self.since_ns:
            waited = self.wave.waited((now_ns - self.since_ns) / SECOND)
            for cup, height in enumerate(waited.tolist()):
                self.wave.bound(cup, height, Cause.START)

    def move(self, way: float, *, begun: bool) -> None:
        """Adds the waves that others may have made by moving the resting container a way [m]."""
        if way <= TUNING.nudged:
            return
        if not begun:
            self.since_ns = None
            return
        self.wave.add(np.minimum(self._gains * way, self.wave.largest), Cause.MOVED)

    def make_up(self, lapse: Lapse) -> None:
        """Advances the liquid to the present; adds to the unknown wave what may be otherwise.

        A robot may hold its velocity while a step is late, or reach the next one later: what lies
        between is a displacement by the change of velocity in the delay. A clock that steps looks
        like a step later than usual: then nothing has been held, and the waves are behind. Where
        the time that has passed is not known the robot may have stopped, too.
        """
        felt = self._mechanics.felt_lately
        self.wave.advance(lapse.passed, felt[:, 2].copy())
        if lapse.doubtful > 0.0:
            self.doubt_time(lapse.doubtful, lapse.cause)
        if lapse.held > 0.0:
            self._mechanics.hold(lapse.held)
        if lapse.uneven > 0.0 and felt[:, :2].any():
            self.wave.shift(self._period * lapse.uneven * felt[:, :2], Cause.LATE)

    def doubt_time(self, seconds: float, cause: Cause) -> None:
        """Adds to the unknown wave what may be if a time [s] has not passed, or only in part."""
        more = self.wave.turned(seconds)
        for cup in range(len(more)):
            more[cup] += wave_heights(self._mechanics.models(cup), seconds=seconds).max()
        if not self._mechanics.rests and seconds > self._timeout:
            cups = self._mechanics.cups
            omega = [cup.model.mode_constants()[0].natural_frequency for cup in cups]
            speed = float(np.linalg.norm(self._mechanics.moved[layout.VELOCITY]))
            more += self._gains * speed / np.array(omega)
        self.wave.add(more, cause)

    def look(self, now_ns: int) -> None:
        """Stores the models at a step; compares with those then the observed state; see `Witness`.

        The state of an observer that is proven to see the liquid bounds the unknown wave.
        """
        self._past.add(now_ns, self._mechanics.stores, self._mechanics.felt(0))
        liquid, self._seen = self._seen, None
        if liquid is None:
            return
        distance = self._witness.look(liquid, self._past)
        if math.isnan(distance):
            return
        self.liquid_ns = liquid.stamp_ns
        now = float(self.wave.heights[0])
        if distance > now:
            most = float(self.wave.largest[0]) + self._limit
            self.wave.bound(0, min(distance, most), Cause.FUSED)
        elif self._witness.highest < now:
            self.wave.bound(0, self._witness.highest, Cause.FUSED)

    def allow(self) -> None:
        """Raises the heights that the motion is judged by to those of the unknown waves.

        At most up to a part of the limit, so that the container can move. In steps: a held stop
        that is safe stays so where they change a little.
        """
        table = self._mechanics.table
        limit, extra = table[:, layout.LIMIT], table[:, layout.EXTRA]
        grain, most = TUNING.grain * limit, TUNING.unknown * limit
        heights = self.wave.heights
        wanted: Array = np.where(heights > 0.0, np.minimum(heights + grain, most), 0.0)
        kept = (np.minimum(heights, most) <= extra) & (extra <= wanted + grain) & (heights > 0.0)
        found = np.where(kept, extra, wanted)
        if (found > extra).any():
            self._mechanics.doubt_stop()
        extra[:] = found
