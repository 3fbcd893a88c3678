"""How a node that has ended is started again, whoever looks after it.

An end with EXIT_WRONG_INPUT means that the node refuses its parameters or files: to start it again
would be of no use.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from slosh_bringup.processes import LAST, NodeProcess

EXIT_WRONG_INPUT = 2
LONGEST_PAUSE = 30.0
"""Between two starts of a node [s]."""


def pause(recent: int) -> float:
    """How long to wait before a node is started again [s]: twice as long each time.

    Args:
        recent: how often it has ended of late, this time included.
    """
    return min(2.0 ** (recent - 1), LONGEST_PAUSE)


def restarted(process: NodeProcess, ends: int) -> NodeProcess:
    """How a node is started that has missed something of the motion.

    Args:
        process: how it was started first.
        ends: how often it has ended so far.
    """
    own: Mapping[str, str] = process.parameters
    if process.name == "estimator":
        own = {**own, "starts_at_rest": "false"}
    if process.name == LAST:
        # What has been recorded stays as it is.
        own = {**own, "output": f"{own['output']}_{ends + 1}"}
    return replace(process, parameters=own)
