"""Compiles all Numba functions of slosh in advance.

    python -m slosh_bringup.compiling [ADD-ON ...]

The set-up does this once. A process that comes later loads the code in a fraction of a second;
where the cache is gone it compiles what it needs itself, and says so. The set-up names the
packages of add-ons, which are not installed yet.
"""

from __future__ import annotations

import importlib
import multiprocessing
import os
import sys
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool

from slosh_base.addons import add_ons
from slosh_base.compiled.compilation import CompileProgress, entry_points, load_all
from slosh_base.compiled.compile_cache import cache_folder
from slosh_model.errors import SloshModelError

MODULES = (
    "slosh_model",
    "slosh_camera.detection.detectors",
    "slosh_estimator.estimator",
    "slosh_estimator.observer.observer",
    "slosh_motion.inputs.pose_input",
    "slosh_bag.mcap_files.chunk_scan",
    "slosh_bag.columns.cdr_columns",
    "slosh_discovery.discover",
)
"""Modules of the core that import all compiled functions; a test compares."""


def import_all(packages: Iterable[str] = ()) -> None:
    """Imports the modules that define compiled functions, so that these are registered.

    Args:
        packages: of add-ons beside those that are installed.
    """
    named = tuple(importlib.import_module(f"{name}.addon").ADDON for name in packages)
    for name in (*MODULES, *(name for one in (*add_ons(), *named) for name in one.compiled)):
        importlib.import_module(name)


def load_everything(tell: Callable[[CompileProgress], None] | None = None) -> str:
    """Compiles or loads all Numba functions and checks those that compute heights.

    Args:
        tell: told before each of them.

    Returns:
        how many, how long it took and where they are kept, for people.

    Raises:
        SloshModelError: one does not do what its source says.
    """
    import_all()
    waiting = sum(not one.cached for one in entry_points())
    seconds = load_all(tell)
    made = f"{waiting} of them compiled now, " if waiting else ""
    return (
        f"{len(entry_points())} compiled functions agree with their sources, "
        f"{made}{seconds:.1f} s, in {cache_folder()}"
    )


def compile_missing(packages: Sequence[str]) -> None:
    """Compiles all uncached functions in parallel, package by package, and prints one line.

    The functions of a package share what they call: one process compiles that once.

    Args:
        packages: of add-ons beside those that are installed.

    Raises:
        SloshModelError: one does not do what its source says, or a compiling process ended.
    """
    import_all(packages)
    missing = [one.name.partition(".")[0] for one in entry_points() if not one.cached]
    if missing:
        print(f"compiling {len(missing)} functions, once on this machine", flush=True)
    workers = min(len(set(missing)), len(os.sched_getaffinity(0)))
    if workers < 2:
        return
    # Not forked: a compiler that was copied in the middle of its work is in no known state.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, context, import_all, (packages,)) as executor:
        largest = sorted(set(missing), key=missing.count, reverse=True)
        try:
            list(executor.map(_compile, largest))
        except BrokenProcessPool:
            raise SloshModelError(
                "a compiling process was killed, perhaps for lack of memory; start again, "
                "finished functions are kept"
            ) from None


def _compile(package: str) -> None:
    load_all(_tell, package)


def _tell(step: CompileProgress) -> None:
    """Shows on a terminal which Numba function is being compiled."""
    if sys.stdout.isatty():
        shown = f"compiling {step.name}" if step.name and not step.cached else ""
        print(f"\r\033[K{shown}", end="", flush=True)


def main() -> int:
    """Compiles Numba functions that are not cached yet; returns the exit code."""
    try:
        compile_missing(sys.argv[1:])
        print(f"compiled code: {load_everything(_tell)}")
    except SloshModelError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
