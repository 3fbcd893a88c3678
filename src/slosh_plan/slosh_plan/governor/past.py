"""States of the models of the governor's first container at recent steps."""

from __future__ import annotations

from collections import deque

import numpy as np

from slosh_base.types import Array
from slosh_plan.tuning import TUNING


class PastLiquid:
    """Stores the recent states of a container's models, and its recent accelerations.

    Args:
        stores: (MODELS, …) of the models, an example.
    """

    def __init__(self, stores: Array) -> None:
        count = TUNING.governor_past
        self._stamps: deque[int] = deque(maxlen=count)
        self._stores, self._felt = np.zeros((count, *stores.shape)), np.zeros((count, 3))
        self._added = 0

    def add(self, stamp_ns: int, stores: Array, felt: Array) -> None:
        """Stores the models' states and the acceleration at one step.

        Args:
            stamp_ns: of the step [ns].
            stores: of the models, from the container's on.
            felt: (3,) acceleration at that moment [m/s²].
        """
        row, shape = self._added % len(self._felt), self._stores.shape[1:]
        self._stamps.append(stamp_ns)
        self._stores[row] = stores[: shape[0], : shape[1]]
        self._felt[row] = felt
        self._added += 1

    def since(self, stamp_ns: int) -> int:
        """Returns how many of the stored steps lie at or after a time; 0 if all are later than it.

        Args:
            stamp_ns: the moment [ns].
        """
        if not self._stamps or self._stamps[0] > stamp_ns:
            return 0
        count = 0
        for one in reversed(self._stamps):
            if one < stamp_ns:
                break
            count += 1
        return count

    def last(self, count: int) -> tuple[Array, Array]:
        """Returns the models' states (MODELS, …) `count` steps ago; accelerations since that step.

        The last row of the latter, (count, 3), is left for the present moment.
        """
        rows = np.arange(self._added - count, self._added) % len(self._felt)
        return self._stores[rows[0]].copy(), self._felt[np.roll(rows, -1)]
