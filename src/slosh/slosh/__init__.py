"""Python interface to slosh: simulate, predict, plan, replay, identify and discover.

Things: `Container`, `Model`, `Motion`, `Recording`. What is done with them: `simulate`, `predict`,
`plan`, `replay`, `identify`, `discover`. Motions and data may be objects, pandas tables or paths.
All values are in SI units (m, s, rad); charts and the lines that results print show millimetres.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

from slosh_base.files.lazy_names import lazy_names

if TYPE_CHECKING:
    from slosh.data import Container, Model, Motion, Recording
    from slosh.evaluation import discover, identify, replay
    from slosh.simulation import plan, predict, simulate

__all__ = [
    "Container",
    "Model",
    "Motion",
    "Recording",
    "discover",
    "identify",
    "plan",
    "predict",
    "replay",
    "simulate",
]

# Where NumPy is not loaded yet: on matrices as small as a fit's, OpenBLAS spends many times the
# work on waking its threads. A number that is set stays.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

_loaded = lazy_names(
    __name__,
    {
        **dict.fromkeys(("Container", "Model", "Motion", "Recording"), "data"),
        **dict.fromkeys(("plan", "predict", "simulate"), "simulation"),
        **dict.fromkeys(("discover", "identify", "replay"), "evaluation"),
    },
)


def __getattr__(name: str) -> Any:
    if name != "__version__":
        return _loaded(name)
    from importlib.metadata import version

    return version(__name__)


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
