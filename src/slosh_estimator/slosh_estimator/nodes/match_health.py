"""Whether measurements find the estimates of their moments."""

from __future__ import annotations

from slosh_msgs_py.node.diagnostics import WARN, Health

FAR = 2.0
"""So far apart the two sides' newest stamps never lie where their clocks are one [s]."""


class MatchHealth:
    """Watches the stamps of both sides, and how many measurements find no estimate.

    Attributes:
        measured_ns, estimated_ns: the newest stamps [ns]; 0: none yet.
    """

    def __init__(self) -> None:
        self.measured_ns = self.estimated_ns = 0
        self._measured = self._unmatched = 0

    def look(self, measured: int, unmatched: int) -> Health | None:
        """What is wrong since the last look; None: nothing.

        Args:
            measured: measurements so far.
            unmatched: those of them that found no estimate.
        """
        came, self._measured = measured - self._measured, measured
        failed, self._unmatched = unmatched - self._unmatched, unmatched
        apart = (self.measured_ns - self.estimated_ns) * 1e-9
        if came and self.estimated_ns and abs(apart) > FAR:
            way = "ahead of" if apart > 0.0 else "behind"
            return WARN, (
                f"the stamps of the measurements lie {abs(apart):.3f} s {way} those of the "
                "estimates: nothing is compared; both must come from one clock"
            )
        if failed and 2 * failed >= came:
            return WARN, f"{failed} of {came} measurements find no estimate of their moment"
        return None
