"""`slosh play`: publishes a bag over DDS with /clock, for nodes with use_sim_time."""

from __future__ import annotations

import argparse
import signal
from pathlib import Path
from typing import Any

from slosh_bag.playing.play_plan import PlayRequest, make_plan
from slosh_bag.playing.playback import PlaybackSettings
from slosh_bag.reader import BagReader
from slosh_bringup.cli.progress import IN_SECONDS, Progress
from slosh_bringup.cli.quantities import RATE, time
from slosh_bringup.errors import SloshBringupError
from slosh_bringup.stop_request import READER_GONE, forget_readers
from slosh_motion.recorded.sources import CellTopics
from slosh_msgs_py.topics import TOPICS, TopicRole


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `slosh play` to the argument parser."""
    parser.add_argument("bag", type=Path, metavar="BAG", help="folder of the bag, or MCAP file")
    parser.add_argument(
        "--rate",
        type=float,
        default=1.0,
        metavar="R",
        help="playback speed factor, 0.01 to 1000 (default 1)",
    )
    parser.add_argument(
        "--start",
        type=time(),
        default=0.0,
        metavar="S",
        help="start S seconds after the bag's beginning (default 0)",
    )
    parser.add_argument(
        "--duration",
        type=time(),
        default=0.0,
        metavar="S",
        help="play only S seconds (default: to the end)",
    )
    parser.add_argument("--loop", action="store_true", help="restart at the end, until Ctrl-C")
    parser.add_argument(
        "--topics",
        default=".*",
        metavar="REGEX",
        help="play only topics whose names contain a match of REGEX (default: all)",
    )
    parser.add_argument(
        "--exclude",
        default="",
        metavar="REGEX",
        help="skip topics whose names contain a match of REGEX",
    )
    parser.add_argument(
        "--inputs", action="store_true",
        help="play only what the robot, its planner and its camera publish: "
        f"{', '.join(row.name for row in TOPICS if row.role is TopicRole.INPUT)}",
    )  # fmt: skip
    parser.add_argument(
        "--clock", type=RATE, default=0.0, metavar="HZ",
        help="rate of /clock messages [Hz] (default: one per message, 100 Hz in pauses)",
    )  # fmt: skip
    parser.add_argument(
        "--namespace",
        default="",
        metavar="NS",
        help="publish the cell's topics in namespace NS (default: as recorded)",
    )
    parser.add_argument(
        "--subscribers", type=int, default=0, metavar="N",
        help="wait for N subscribers before the start (default: for any one)",
    )  # fmt: skip
    parser.add_argument(
        "--wait",
        type=time(3600.0),
        default=10.0,
        metavar="S",
        help="longest wait for subscribers [s]; playback then starts without them (default 10)",
    )


def _told_inputs(bag: Path) -> frozenset[str]:
    """Returns what the nodes of a bag's cells read of a robot, by the names that they told."""
    reader = BagReader(bag)
    cells = [CellTopics(reader, cell) for cell in CellTopics(reader).cells]
    inputs = (row.name for row in TOPICS if row.role is TopicRole.INPUT)
    return frozenset(cell.told(name) for name in inputs for cell in cells)


def run(arguments: argparse.Namespace) -> int:
    """Plays the bag until its end or until Ctrl-C is pressed."""
    if not 0.0 <= arguments.wait <= 3600.0:
        raise SloshBringupError(f"--wait {arguments.wait:g}: must be from 0 to 3600 s")
    if not 0 <= arguments.subscribers <= 1000:
        raise SloshBringupError(f"--subscribers {arguments.subscribers}: must be from 0 to 1000")
    settings = PlaybackSettings(
        arguments.rate, arguments.start, arguments.duration, arguments.loop, arguments.clock
    )
    plan = make_plan(
        PlayRequest(
            arguments.bag, settings, arguments.topics, arguments.exclude, arguments.inputs,
            arguments.namespace, _told_inputs(arguments.bag) if arguments.inputs else frozenset(),
        )
    )  # fmt: skip
    from slosh_bag.nodes.player_node import (
        play,
    )  # with ROS, which a wrong option need not wait for

    ros = ["--ros-args", "-p", f"patience:={arguments.wait:f}"]
    ros += ["-p", f"subscribers:={arguments.subscribers}"]
    length = None if settings.loop else plan.playback.length
    title = "playing, Ctrl-C to stop" if settings.loop else f"play {arguments.bag.name}"
    with Progress(title, length, IN_SECONDS, delay=0.0) as progress:

        def watch(node: Any) -> None:
            played: float = node.played
            if node.finished and not node.failure and length is not None:
                played = length
            try:
                progress.reach(played)
            except OSError as error:
                if error.errno in READER_GONE:  # without a word, as a terminal does with one
                    forget_readers()
                    signal.raise_signal(signal.SIGHUP)

        return play(plan, ros, watch)
