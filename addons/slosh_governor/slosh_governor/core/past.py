"""States of the models of the governor's first container at recent steps."""

from __future__ import annotations

from collections import deque

import numpy as np

from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array
from slosh_governor.tuning import TUNING
from slosh_model import kernel as model_kernel


class PastLiquid:
    """Stores the recent states of a container's models, and its recent accelerations.

    Args:
        stores: (MODELS, …) of the models, an example.
    """

    def __init__(self, stores: Array) -> None:
        count = TUNING.past
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

    def at(self, stamp_ns: int) -> Array | None:
        """Returns the models' states (MODELS, …) at a moment [ns]; None: it is not known."""
        later = None
        for back, one in enumerate(reversed(self._stamps), 1):
            if one > stamp_ns:
                later = one
                continue
            rows = np.arange(self._added - back, self._added - back + 2) % len(self._felt)
            stores: Array = self._stores[rows[0]].copy()
            if one == stamp_ns:
                return stores
            if later is None:
                return None
            share = (stamp_ns - one) / (later - one)
            felt = self._felt[rows[0]] + share * (self._felt[rows[1]] - self._felt[rows[0]])
            for store in stores:
                model_kernel.step(store, (stamp_ns - one) / SECOND, *felt.tolist())
            return stores
        return None
