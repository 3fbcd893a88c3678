"""Diagnostics of the recorder node."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping

from slosh_bag.recorded_topics import TopicSelection
from slosh_bag.recorder import RecorderStatus
from slosh_msgs_py.node.diagnostics import ERROR, OK, STALE, WARN, Health

SOON_FULL = 600.0
"""How long before the disk is full the recorder warns [s]."""
MOST_NAMED = 10
"""Topics nobody asked for that are named."""


class Traffic:
    """Counts received bytes per topic."""

    def __init__(self) -> None:
        self._bytes: dict[str, int] = {}
        self._since: float | None = None

    def add(self, topic: str, size: int) -> None:
        """Adds the size of a received message [bytes] to its topic's count."""
        self._bytes[topic] = self._bytes.get(topic, 0) + size

    def text(self, topics: Iterable[str], now: float) -> str:
        """Formats each topic's data rate since the last call [kB/s], largest first.

        Args:
            topics: all that are recorded.
            now: steady time [s].
        """
        before, self._since = self._since, now
        elapsed = now - before if before is not None else 0.0
        came, self._bytes = self._bytes, {}
        rates = {
            topic: 1e-3 * came.get(topic, 0) / elapsed if elapsed > 0.0 else 0.0
            for topic in topics
        }
        ordered = sorted(rates.items(), key=lambda item: (-item[1], item[0]))
        return ", ".join(f"{topic} {rate:.1f}" for topic, rate in ordered)


def left_out_text(choice: TopicSelection) -> str:
    """Describes which topics are not recorded, and why."""
    parts = [f"{topic}: {reason}" for topic, reason in choice.left_out.items()]
    if choice.others:
        names = ", ".join(choice.others[:MOST_NAMED])
        more = ", ..." if len(choice.others) > MOST_NAMED else ""
        parts.append(
            f"{len(choice.others)} outside this cell, which the parameter topics can add: "
            f"{names}{more}"
        )
    return "; ".join(parts)


def findings(
    status: RecorderStatus,
    absent: Mapping[str, float],
    lost_on_the_way: int,
    left_out: Mapping[str, str],
    silent: bool,
    shared: Collection[str] = (),
    other_types: Mapping[str, str] | None = None,
    shortage: str = "",
) -> Health:
    """Returns the worst diagnostic level of the recorder and a line with all problems.

    Args:
        status: how the recording goes.
        absent: topics without a publisher, and since when that is so [s].
        lost_on_the_way: messages that the middleware lost since the last report.
        left_out: topics that cannot be recorded, and why.
        silent: whether no message has been written since the last report.
        shared: topics of one node on which several have spoken since the last report.
        other_types: in which other type a topic is published, by topic.
        shortage: that the quota of events is too small, in one line; empty if it is not.
    """
    errors, warnings = _errors(status), [*filter(None, [shortage]), *_warnings(status)]
    if absent:
        names = ", ".join(f"{topic} (for {since:.0f} s)" for topic, since in absent.items())
        warnings.append(f"publisher lost: {names}")
    if lost_on_the_way:
        warnings.append(f"{lost_on_the_way} messages lost before they reached the recorder")
    if shared:
        warnings.append(
            f"several publishers on {', '.join(shared)}: is another cell in this namespace? "
            "Their recorded messages cannot be replayed; stop one cell or give it another "
            "namespace"
        )
    for topic, kind in (other_types or {}).items():
        warnings.append(f"{topic} is also published as {kind}, which is not recorded")
    if left_out:
        topic, reason = next(iter(left_out.items()))
        warnings.append(f"{len(left_out)} topics are not recorded, such as {topic}: {reason}")
    if errors or warnings:
        return (ERROR if errors else WARN), "; ".join(errors + warnings)
    if silent:
        return STALE, "nothing to record"
    return OK, f"{sum(status.written.values())} messages recorded"


def _errors(status: RecorderStatus) -> list[str]:
    found = []
    if status.failure:
        found.append(
            f"nothing has been written for {status.since:.0f} s: {status.failure}; "
            f"{1e-6 * status.free:.0f} MB free: free some space, and recording resumes; "
            f"{status.waiting} messages are waiting, {status.lost_meanwhile} are lost"
        )
    slow = status.unkept - status.lost_meanwhile
    if slow:
        found.append(f"{slow} messages lost: the disk is too slow")
    return found


def _warnings(status: RecorderStatus) -> list[str]:
    found = []
    if status.time_left < SOON_FULL and not status.failure:
        found.append(
            f"the disk of {status.path.parent} will be full in {status.time_left / 60.0:.1f} min "
            f"at {1e-6 * status.rate:.1f} MB/s, {1e-6 * status.free:.0f} MB are left"
        )
    if status.interruptions and not status.failure:
        found.append(
            f"recording resumed in {status.path.name}: writing failed {status.interruptions} "
            f"times, {status.lost_meanwhile} messages were lost meanwhile"
        )
    return found
