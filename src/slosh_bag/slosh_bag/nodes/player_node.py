"""Player node: publishes a bag's messages and /clock at the recorded times."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from rclpy.qos import QoSDurabilityPolicy as Durability
from rclpy.qos import QoSHistoryPolicy as History
from rclpy.qos import QoSProfile
from rclpy.qos import QoSReliabilityPolicy as Reliability
from rosgraph_msgs.msg import Clock

from slosh_bag.bag_writer import Qos
from slosh_bag.nodes.player_thread import BEHIND_NS, PlayerThread
from slosh_bag.playing.play_plan import (
    CLOCK,
    STREAM_DEPTH,
    PlayPlan,
    PlayRequest,
    make_plan,
    without,
)
from slosh_bag.playing.playback import CLOCK_RATES, RATES, PlaybackSettings
from slosh_msgs_py.conversions import find_type
from slosh_msgs_py.node.diagnostics import ERROR, OK, WARN, DiagnosticsReporter, Health
from slosh_msgs_py.node.guarded import GuardedNode
from slosh_msgs_py.node.parameters import ParameterSpec, declare
from slosh_msgs_py.node.run import EXIT_WRONG_INPUT, run_node

PARAMETERS = (
    ParameterSpec("bag", "", "folder of the bag, or an MCAP file"),
    ParameterSpec("rate", 1.0, "playback speed factor", RATES),
    ParameterSpec("start", 0.0, "start this long after the bag's beginning [s]", (0.0, 1e9)),
    ParameterSpec("duration", 0.0, "duration to play [s]; 0: to the end", (0.0, 1e9)),
    ParameterSpec("loop", False, "restart at the end, until the node is stopped"),
    ParameterSpec("topics", ".*", "regular expression of the topics to play"),
    ParameterSpec("exclude", "", "regular expression of the topics to skip; empty: none"),
    ParameterSpec("inputs", False, "play only what the robot, its planner and its camera publish"),
    ParameterSpec(
        "clock", 0.0,
        "rate of /clock messages [Hz]; 0: one for all messages of a millisecond, 100 Hz in pauses",
        (0.0, CLOCK_RATES[1]),
    ),
    ParameterSpec("into", "", "namespace of the published topics; empty: as recorded"),
    ParameterSpec("subscribers", 0, "number of subscribers to wait for before the start; 0: "
                                    "any", (0, 1000)),
    ParameterSpec("patience", 10.0, "longest wait for subscribers [s]; playback then starts "
                                    "without them", (0.0, 3600.0)),
)  # fmt: skip


class PlayerNode(GuardedNode):
    """Node that publishes a bag from a separate thread and reports the progress.

    Args:
        plan: what is played; None: what the parameters say.
    """

    failure_code = EXIT_WRONG_INPUT

    def __init__(self, plan: PlayPlan | None = None) -> None:
        super().__init__("player")
        given = declare(self, PARAMETERS)
        self._plan, kinds = playable(plan or make_plan(request(given)))
        publishers = {
            topic: self.create_publisher(kinds[topic], entry.name, profile(entry.qos))
            for topic, entry in self._plan.topics.items()
        }
        clock = self.create_publisher(Clock, CLOCK, profile(Qos(depth=STREAM_DEPTH)))
        for warning in self._plan.warnings:
            self.get_logger().warning(warning)
        self._thread = PlayerThread(self._plan, publishers, clock, self.get_logger().warning)
        self._report = DiagnosticsReporter(self, self._health, self._facts)
        self._thread.start(given["subscribers"], given["patience"])

    def close(self) -> None:
        """Stops the publishing thread and reports the result."""
        self._thread.stop()
        count, latest = self._thread.count, 1e-6 * self._thread.latest_ns
        self.get_logger().info(f"{count} messages played, up to {latest:.1f} ms late")

    @property
    def finished(self) -> bool:
        """Whether all messages have been published and delivered."""
        return self._thread.finished

    @property
    def failure(self) -> str:
        """The reason why playback stopped; empty if it did not fail."""
        return self._thread.failure if self._thread.finished else ""

    @property
    def played(self) -> float:
        """Time span of the bag that has been played so far [s]."""
        return (self._thread.bag_ns - self._plan.playback.first_ns) * 1e-9

    def _health(self) -> Health:
        late = self._thread.late_ns
        if self.failure:
            return ERROR, self.failure
        if not self._thread.began_ns:
            return OK, "waiting for subscribers to play"
        if late > BEHIND_NS:
            return WARN, f"{1e-9 * late:.1f} s behind: this machine is too slow for the rate"
        return OK, f"playing at {self.played:.1f} of {self._plan.playback.length:.1f} s"

    def _facts(self) -> dict[str, Any]:
        return {
            "bag": self._plan.reader.path,
            "topics": len(self._plan.topics),
            "messages": self._thread.count,
            "late maximum [ms]": f"{1e-6 * self._thread.latest_ns:.2f}",
        }


def request(given: Mapping[str, Any]) -> PlayRequest:
    """Creates the play request from the node's parameters.

    Raises:
        SloshBagError: a value does not fit.
    """
    settings = PlaybackSettings(
        given["rate"], given["start"], given["duration"], given["loop"], given["clock"]
    )
    return PlayRequest(
        Path(given["bag"]), settings, given["topics"], given["exclude"], given["inputs"],
        given["into"],
    )  # fmt: skip


def playable(plan: PlayPlan) -> tuple[PlayPlan, dict[str, Any]]:
    """Returns the plan without topics of uninstalled types, and the types by topic.

    Raises:
        SloshBagError: nothing is left.
    """
    kinds: dict[str, Any] = {}
    for topic, entry in plan.topics.items():
        with contextlib.suppress(AttributeError, ImportError, ValueError):
            kinds[topic] = find_type(entry.message_type)
    return without(plan, [topic for topic in plan.topics if topic not in kinds]), kinds


def profile(qos: Qos) -> QoSProfile:
    """Converts a recorded publisher's QoS to an rclpy QoS profile."""
    reliable, latched = qos.reliability == "reliable", qos.durability == "transient_local"
    return QoSProfile(
        history=History.KEEP_LAST,
        depth=qos.depth,
        reliability=Reliability.RELIABLE if reliable else Reliability.BEST_EFFORT,
        durability=Durability.TRANSIENT_LOCAL if latched else Durability.VOLATILE,
    )


def play(
    plan: PlayPlan | None = None,
    arguments: Sequence[str] | None = None,
    watch: Callable[[PlayerNode], None] = lambda node: None,
) -> int:
    """Runs the player node until the bag's end or SIGINT.

    Args:
        plan: what is played; None: what the parameters say.
        arguments: ROS arguments; None: the process's own.
        watch: gets the node about ten times a second.

    Returns:
        exit code: 0 done or stopped, 2 a wrong parameter or bag (one line on stderr).
    """

    def finished(node: PlayerNode) -> bool:
        watch(node)
        return node.finished

    return run_node(lambda: PlayerNode(plan), arguments, finished)


def main() -> int:
    """Runs the player node."""
    return play()


if __name__ == "__main__":
    sys.exit(main())
