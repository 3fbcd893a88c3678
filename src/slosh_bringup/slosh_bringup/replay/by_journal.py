"""Checks a recording by the journals of its nodes: their own code, in the recorded order."""

from __future__ import annotations

from dataclasses import replace
from importlib.util import find_spec

from slosh_replay.recorded_run import RecordedRun
from slosh_replay.replay.replay_bag import IN_LOG_ORDER
from slosh_replay.replay.result import ReplayResult

MIXED = "two processes of one node ran at once, as when two cells share a namespace"


def checked_by_journal(
    result: ReplayResult, run: RecordedRun, cell: str | None = None
) -> ReplayResult:
    """Returns the result with what the nodes' own code gives by their journals.

    Without ROS 2, or without journals, the estimates of the replay alone are compared.

    Args:
        result: of the replay.
        run: the recording.
        cell: namespace of the topics; None: the first cell that has journals.

    Raises:
        SloshBagError: the bag cannot be read.
    """
    if find_spec("rclpy") is None:
        return result
    # They need ROS 2, and take a second to import.
    from slosh_replay.journaled.replay import replay_journals

    found = replay_journals(run.reader, cell)
    verified = dict(result.verified)
    causes = [f"{MIXED}: {node}" for node in found.mixed]
    before = result.verification
    if before is not None:
        causes += [cause for cause in before.causes if cause != IN_LOG_ORDER]
    rounds_otherwise = before is not None and before.rounds_otherwise
    for name, one in found.verified.items():
        # What no journal can tell, as in the middle of a run, the replay may know all the same.
        if one.total or name not in verified or not verified[name].exact:
            verified[name] = replace(one, causes=tuple(causes), rounds_otherwise=rounds_otherwise)
    return replace(result, verified=verified)
