"""Compiles everything that the product runs compiled, so that nothing else has to wait for it.

    python -m slosh_bringup.compiling

The set-up does this once. A process that comes later loads the code in a fraction of a second;
where the cache is gone it compiles what it needs itself, and says so.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterable

from slosh_model.compilation import Progress, load_all
from slosh_model.compile_cache import cache_folder
from slosh_model.errors import SloshModelError

MODULES = (
    "slosh_model",
    "slosh_camera.detector",
    "slosh_camera.container_edges",
    "slosh_estimator.estimator",
    "slosh_estimator.pose_input",
    "slosh_bag.mcap_files.chunk_scan",
    "slosh_bag.columns.cdr_columns",
    "slosh_discovery.discover",
)
"""Modules that import all compiled functions; a test compares."""


def import_all(modules: Iterable[str] = MODULES) -> None:
    """Imports the modules, which makes their compiled functions known."""
    for name in modules:
        importlib.import_module(name)


def main() -> int:
    """Compiles what is missing, a line for each function; returns the exit code."""
    import_all()

    def tell(step: Progress) -> None:
        if step.name and not step.cached:
            print(f"compiling {step.done + 1} of {step.total}: {step.name}", flush=True)

    try:
        seconds = load_all(tell)
    except SloshModelError as error:
        print(error, file=sys.stderr)
        return 1
    print(f"compiled code ready after {seconds:.1f} s, in {cache_folder()}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
