"""Whether measurements find the estimates of their moments."""

from __future__ import annotations

from slosh_msgs_py.node.diagnostics import WARN, Health


class MatchHealth:
    """Watches how many measurements find no estimate."""

    def __init__(self) -> None:
        self._measured = self._unmatched = 0

    def look(self, measured: int, unmatched: int) -> Health | None:
        """What is wrong since the last look; None: nothing.

        Args:
            measured: measurements so far.
            unmatched: those of them that found no estimate.
        """
        came, self._measured = measured - self._measured, measured
        failed, self._unmatched = unmatched - self._unmatched, unmatched
        if failed and 2 * failed >= came:
            return WARN, f"{failed} of {came} measurements find no estimate of their moment"
        return None
