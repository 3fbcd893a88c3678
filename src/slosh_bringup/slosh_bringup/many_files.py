"""Runs a function on many files, on all cores of this machine or on a Dask cluster.

Outcomes come as they finish, with the item's number: a caller that wants them in order sorts what
it keeps. In order, one long file would hold back all that are done behind it, and with a bounded
number in flight the cores would wait for it too.
"""

from __future__ import annotations

import asyncio
import logging
import os
import signal
import time
import traceback
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from itertools import chain, count, islice
from multiprocessing import resource_tracker
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from slosh_bringup.errors import SloshBringupError
from slosh_bringup.task_batches import Batches

if TYPE_CHECKING:
    from distributed import Client, Future, LocalCluster

Item = TypeVar("Item")
Value = TypeVar("Value")

IN_FLIGHT = 2  # tasks per worker: the next one is there when one is done
CONNECT_TIMEOUT = 5.0
# What ends a process of a local cluster is told as its item's outcome, not as its traceback.
_PRELOAD = "import os; os.dup2(os.open(os.devnull, os.O_WRONLY), 2)"
_SETTINGS: dict[str, Any] = {
    # A task whose worker died is not tried again here and there: see _Farm.
    "distributed.scheduler.allowed-failures": 0,
    # A worker with more than this share of its memory is ended, and with it the item it works on;
    # one that only pauses, as Dask would have it, waits for ever for memory that its item holds.
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    "distributed.worker.memory.terminate": 0.95,
    "distributed.worker.preload": [_PRELOAD],
    "distributed.admin.log-length": 100,
    "distributed.admin.low-level-log-length": 100,
}
KILLED = "its process was killed, by a signal or for lack of memory"


@dataclass(frozen=True, slots=True)
class ItemOutcome(Generic[Item, Value]):
    """Result of processing one item: its value, or its error.

    Attributes:
        index: its number among the items, from 0.
        item: the item.
        value: what the function returned; None where it failed.
        error: why it failed, in one line; empty: it did not.
    """

    index: int
    item: Item
    value: Value | None
    error: str = ""


def map_files(
    function: Callable[[Item], Value],
    items: Iterable[Item],
    *,
    jobs: int | None = None,
    scheduler: str | None = None,
    sizes: Sequence[float] | None = None,
) -> Generator[ItemOutcome[Item, Value]]:
    """Calls a function for each item in parallel; continues if one call fails.

    A single item, or one job, is worked on in this process. Otherwise function and items must be
    picklable and the values small: they come over a socket. Only a few items per process are
    under way at a time, so memory does not grow with their number.

    Args:
        function: of one item, from a module that the workers can import.
        items: e.g. paths.
        jobs: processes on this machine; None: one for each core.
        scheduler: address of a Dask scheduler, in place of processes on this machine.
        sizes: of the items, in any unit, as many as there are: short items then share a task;
            None: each is a task.

    Yields:
        an outcome for each item, as they finish.

    Raises:
        SloshBringupError: `jobs` does not fit, or the scheduler cannot be reached.
    """
    if jobs is not None and jobs < 1:
        raise SloshBringupError(f"jobs = {jobs}: must be at least 1")
    if jobs is not None and scheduler is not None:
        raise SloshBringupError(f"jobs = {jobs}: the scheduler {scheduler} has its own workers")
    return _map(function, iter(items), jobs, scheduler, sizes)


def _map(
    function: Callable[[Item], Value],
    items: Iterator[Item],
    jobs: int | None,
    scheduler: str | None,
    sizes: Sequence[float] | None,
) -> Generator[ItemOutcome[Item, Value]]:
    first = list(islice(items, 2))
    everything = chain(first, items)
    workers = jobs or len(os.sched_getaffinity(0))
    if scheduler is None and (len(first) < 2 or workers == 1):
        for index, item in enumerate(everything):
            yield ItemOutcome(index, item, *attempt(function, item))
        return
    with _client(workers, scheduler) as client:
        yield from _Farm(client, function).run(Batches(everything, sizes))


def attempt(function: Callable[[Item], Value], item: Item) -> tuple[Value | None, str]:
    """Calls the function with an item; returns its value, or None and a one-line error."""
    try:
        return function(item), ""
    except (Exception, SystemExit) as error:
        return None, reason(error)


def _attempt_all(
    function: Callable[[Item], Value], items: Sequence[Item]
) -> tuple[list[tuple[Value | None, str]], float]:
    """Calls the function for each item; returns results or errors, and the duration [s]."""
    begin = time.perf_counter()
    return [attempt(function, item) for item in items], time.perf_counter() - begin


def reason(error: BaseException) -> str:
    """Formats an exception in one line, with type and position if it is not slosh's own."""
    if isinstance(error, OSError) and error.filename:
        return f"{error.filename}: {error.strerror}"
    text = " ".join(str(error).split())
    if type(error).__module__.startswith("slosh_"):
        return text
    frames = traceback.extract_tb(error.__traceback__)
    where = f" ({os.path.basename(frames[-1].filename)}:{frames[-1].lineno})" if frames else ""
    return f"{type(error).__name__}: {text}{where}"


class _Farm(Generic[Item, Value]):
    """Distributes items to the workers of a Dask client.

    A worker that dies takes with it what else it had been given: those items are worked on once
    more, each with no other under way. The one that ends its worker again is the one to blame.
    """

    def __init__(self, client: Client, function: Callable[[Item], Value]) -> None:
        from distributed import as_completed

        self._client = client
        self._function = function
        self._done = as_completed(loop=client.loop)
        self._under_way: dict[Future[Any], list[tuple[int, Item]]] = {}
        self._number = count()

    def run(self, batches: Batches[Item]) -> Iterator[ItemOutcome[Item, Value]]:
        """Processes all items in parallel and yields the outcome of each."""
        suspects: deque[tuple[int, Item]] = deque()
        workers = max(1, len(self._client.nthreads()))
        while True:
            # While there are suspects nothing new begins: each of them is to run alone.
            while not suspects and len(self._under_way) < IN_FLIGHT * workers:
                batch = batches.take(workers)
                if not batch:
                    break
                self._submit(batch)
            is_alone = not self._under_way
            if is_alone:
                if not suspects:
                    return
                self._submit([suspects.popleft()])
            batch, outcomes, seconds = self._next()
            if outcomes is not None:
                batches.learn(batch, seconds)
                yield from outcomes
            elif is_alone:
                yield from (ItemOutcome(index, item, None, KILLED) for index, item in batch)
            else:
                suspects += batch

    def _submit(self, batch: list[tuple[int, Item]]) -> None:
        # Names of their own: equal items are worked on each for itself.
        key = f"item-{next(self._number)}-{os.getpid()}"
        items = [item for _, item in batch]
        future = self._client.submit(_attempt_all, self._function, items, key=key, pure=False)
        self._under_way[future] = batch
        self._done.add(future)

    def _next(
        self,
    ) -> tuple[list[tuple[int, Item]], list[ItemOutcome[Item, Value]] | None, float]:
        """Returns the items of the next finished task, their outcomes and its duration [s].

        The outcomes are None if its items must be worked on one by one: their worker has died, or
        one of several spoils the task.

        Raises:
            SloshBringupError: the scheduler has gone.
        """
        from distributed import CancelledError, KilledWorker

        future = next(self._done)
        batch = self._under_way.pop(future)
        try:
            # Fetched here: where the worker dies with the result in its hands, this says so.
            found, seconds = future.result()
        except KilledWorker:
            return batch, None, 0.0
        except CancelledError:
            raise SloshBringupError(
                "lost the Dask scheduler; the remaining items were not processed"
            ) from None
        except Exception as error:
            # A worker that cannot import the function, a value that cannot be pickled.
            if len(batch) > 1:
                return batch, None, 0.0
            found, seconds = [(None, reason(error))], 0.0
        outcomes = [
            ItemOutcome(index, item, *one) for (index, item), one in zip(batch, found, strict=True)
        ]
        return batch, outcomes, seconds


@contextmanager
def _client(workers: int, scheduler: str | None) -> Iterator[Client]:
    """Creates a Dask client of a cluster, or of local processes that end with it."""
    try:
        import dask
        import distributed  # noqa: F401  # only then Dask's settings are complete
    except ImportError as error:
        raise SloshBringupError(
            f"several processes need Dask distributed ({error}): install it, or use one job"
        ) from None
    for name in list(logging.root.manager.loggerDict):
        if name.startswith("distributed"):
            logging.getLogger(name).setLevel(logging.CRITICAL)
    with dask.config.set(_SETTINGS):
        if scheduler is not None:
            with closing(_connect(scheduler)) as client:
                yield client
            return
        from distributed import Client

        with (
            _local_cluster(workers) as cluster,
            closing(Client(cluster, set_as_default=False)) as client,
        ):
            yield client


def _kill(cluster: LocalCluster) -> None:
    """Kills the cluster's processes at once, without waiting for running items."""
    for nanny in cluster.workers.values():
        nanny.close_gracefully()  # not started anew
        if nanny.pid:
            with suppress(ProcessLookupError):
                os.kill(nanny.pid, signal.SIGKILL)


@contextmanager
def _local_cluster(workers: int) -> Iterator[LocalCluster]:
    """Starts local worker processes that other hosts cannot reach and that ignore Ctrl-C.

    Threads and processes inherit from who starts them that SIGINT is held back. Here it comes once
    they have started: a half started cluster does not end in peace.
    """
    from distributed import LocalCluster

    # Started later, the tracker would let SIGINT through again.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        cluster = LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            host="127.0.0.1",
            # No dashboard; the server that would show it takes any free port, not a fixed one.
            dashboard_address=None,
            scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},
            silence_logs=logging.CRITICAL,
        )
    except BaseException:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        raise
    with cluster:
        try:
            # One that was held back comes here, where the cluster is ended with it.
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
            yield cluster
        except BaseException:
            _kill(cluster)
            raise


def _connect(scheduler: str) -> Client:
    """Connects to the Dask scheduler at an address.

    Raises:
        SloshBringupError: there is none at this address, or it has no workers.
    """
    from distributed import Client

    try:
        # Asked first: where nobody answers, a client takes long and many words to say so.
        workers = asyncio.run(asyncio.wait_for(_count_workers(scheduler), CONNECT_TIMEOUT))
    except (OSError, ValueError) as error:
        why = " ".join(str(error).split()) or f"no answer within {CONNECT_TIMEOUT:.0f} s"
        raise SloshBringupError(f"scheduler {scheduler}: cannot be reached: {why}") from None
    except Exception:
        raise SloshBringupError(f"scheduler {scheduler}: is not a Dask scheduler") from None
    if not workers:
        raise SloshBringupError(f"scheduler {scheduler}: has no workers")
    return Client(scheduler, timeout=CONNECT_TIMEOUT, set_as_default=False)


async def _count_workers(scheduler: str) -> int:
    from distributed import rpc

    async with rpc(scheduler) as remote:
        return len((await remote.identity())["workers"])
