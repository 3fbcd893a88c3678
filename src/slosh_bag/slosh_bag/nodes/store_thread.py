"""Deletes old bags of a cell's runs while its recorder works."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

from slosh_bag.errors import SloshBagError
from slosh_bag.store.retention import BagKind, Retention, surplus
from slosh_bag.store.stored_bags import delete, runs_folder, stored_bags
from slosh_msgs_py.node.parameters import ParameterSpec

PERIOD: Final = 60.0
"""Time between two looks at the folder of the runs [s]."""
QUOTA, DAYS, EVENT_DAYS = "store_quota", "store_days", "store_event_days"
STORE_PARAMETERS = (
    ParameterSpec(
        QUOTA,
        0,
        "total size of the bags of all runs beside this one's [bytes]; the oldest are deleted, "
        "complete ones first; 0: no limit",
        bounds=(0, 10**15),
    ),
    ParameterSpec(
        DAYS, 0.0, "age from which complete bags of other runs are deleted [day]; 0.0: no limit",
        bounds=(0.0, 1e5),
    ),
    ParameterSpec(
        EVENT_DAYS, 0.0,
        "age from which event bags of other runs are deleted [day]; 0.0: no limit",
        bounds=(0.0, 1e5),
    ),
)  # fmt: skip
"""How much of a cell's recordings is kept; see `slosh store`."""


class StoreState(NamedTuple):
    """Result of the last check of the folder of all runs: stored and deleted bags, failures.

    Attributes:
        bags: number of bags that are kept.
        size: of these [bytes].
        deleted: number of bags that were deleted since the start.
        excess: size beyond the quota that cannot be deleted [bytes].
        failure: why a bag could not be deleted; empty: all could.
    """

    bags: int = 0
    size: int = 0
    deleted: int = 0
    excess: int = 0
    failure: str = ""


class StoreThread:
    """Thread that deletes old bags of a cell's runs, so that a busy disk delays no messages.

    Args:
        bag: that the recorder writes.
        values: of STORE_PARAMETERS.
        tell: is given a line for each deleted bag.

    Raises:
        SloshBagError: the limits do not fit together, or the bag is in no folder of runs.
    """

    def __init__(
        self, bag: Path, values: Mapping[str, Any], tell: Callable[[str], object]
    ) -> None:
        self._retention = Retention(values[QUOTA], values[DAYS], values[EVENT_DAYS])
        self._runs, self._tell = runs_folder(bag), tell
        self._state = StoreState()
        self._ending = threading.Event()
        self._thread: threading.Thread | None = None
        if not self._retention.is_limited:
            return
        if self._runs is None:
            raise SloshBagError(
                f"{QUOTA}, {DAYS}, {EVENT_DAYS}: {bag} is in no folder of runs, such as "
                "out/cell/2026-11-22T10-15-00/bag"
            )
        self._thread = threading.Thread(target=self._run, name="bag store", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Ends the thread that deletes old bags."""
        self._ending.set()
        if self._thread is not None:
            self._thread.join()

    @property
    def complaint(self) -> str:
        """A sentence on bags that could not be deleted although they should be; empty if none."""
        state = self._state
        if state.failure:
            return f"old bags are not deleted: {state.failure}"
        if state.excess:
            return (
                f"the running recording alone exceeds {QUOTA} by {1e-6 * state.excess:.0f} MB: "
                "raise it, or record events only"
            )
        return ""

    def facts(self) -> dict[str, Any]:
        """Returns diagnostics values of the stored bags; empty if no limit for deletion is set."""
        if self._thread is None:
            return {}
        return {
            "stored bags": self._state.bags,
            "stored [MB]": round(1e-6 * self._state.size),
            "deleted bags": self._state.deleted,
        }

    def look(self, now: float) -> None:
        """Deletes bags that are too old, or beyond the quota, at the time `now` [s since 1970]."""
        if self._runs is None:
            return
        deleted, failure, gone = self._state.deleted, "", set()
        try:
            bags = stored_bags(self._runs, now)
        except SloshBagError as error:
            self._state = self._state._replace(failure=str(error))
            return
        found = surplus(bags, self._retention, now)
        for bag in found.bags:
            try:
                delete(bag)
            except SloshBagError as error:
                failure = str(error)
                continue
            gone.add(bag.folder)
            kind = "event bag" if bag.kind is BagKind.EVENT else "bag"
            self._tell(f"deleted the old {kind} {bag.folder}, {1e-6 * bag.size:.0f} MB")
        kept = [bag for bag in bags if bag.folder not in gone]
        self._state = StoreState(
            len(kept), sum(bag.size for bag in kept), deleted + len(gone), found.excess, failure
        )

    def _run(self) -> None:
        while True:
            self.look(time.time())
            if self._ending.wait(PERIOD):
                return
