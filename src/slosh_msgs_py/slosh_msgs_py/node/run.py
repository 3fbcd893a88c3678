"""Runs a node's process from start to end."""

from __future__ import annotations

import contextlib
import gc
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Sequence
from functools import partial
from types import FrameType
from typing import Any, TypeVar

import rclpy
from rclpy.exceptions import InvalidHandle
from rclpy.executors import (
    ExternalShutdownException,
    MultiThreadedExecutor,
    SingleThreadedExecutor,
)
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from slosh_base.files.new_file import keep_others_from_writing
from slosh_base.files.plain_text import plain_line
from slosh_msgs_py.errors import SloshMessageError
from slosh_msgs_py.node.dead_ports import free_dead_ports, hold_dead_ports
from slosh_msgs_py.node.guarded import GuardedNode
from slosh_msgs_py.node.lifeline import watch_lifelines
from slosh_msgs_py.node.network import bound
from slosh_msgs_py.node.prepared import Preparation, PreparedNode
from slosh_msgs_py.node.readiness import READY
from slosh_msgs_py.node.shared_memory import is_deaf

EXIT_DONE, EXIT_FAILED, EXIT_WRONG_INPUT = 0, 1, 2
EXECUTORS = ("events", "single")
ATTEMPTS, PAUSE = 20, 0.25  # s; what holds a dead port open is found out within a second or two
SURE = 3
"""So many looks, one after the other, that find a process deaf are believed."""
HEARING_PERIOD = 2.0  # s
_Node = TypeVar("_Node", bound=Node)
_POLL = 0.1  # s; how long an idle executor waits before it looks whether to stop

PERIOD = 0.25
"""How long it takes at most until a step is noticed [s]."""
STEP_NS = 50_000_000
"""From here on it is a step [ns]: a clock that is slewed goes wrong by a thousandth at most."""


def run_node(
    factory: Callable[[], Node],
    arguments: Sequence[str] | None = None,
    finished: Callable[[Any], bool] = lambda node: False,
    threads: int = 1,
) -> int:
    """Runs a node until a signal arrives, the node has finished or the parent process ends.

    A node that has not got what it needs yet is prepared first; see `PreparedNode`. One that has
    an attribute `failure` when it is finished, a text, has failed.

    Args:
        factory: makes the node; a ValueError of ours is a wrong parameter or file.
        arguments: the command line; None: the process's own.
        finished: asks the node whether its work is done.
        threads: of the executor; more than one for a node whose callbacks take seconds.

    Returns:
        exit code: 0 done; 2 a wrong parameter or file; where the node has failed its attribute
        `failure_code`, or 1. All but 0 come with one line on stderr.
    """
    keep_others_from_writing()
    stop = _StopFlag()
    watch_lifelines(stop.starter_ended)
    preparation = None
    try:
        initialise(arguments)
        executor = make_executor() if threads == 1 else MultiThreadedExecutor(threads)
        node = make_heard(factory)
        executor.add_node(node)
        watch_clock(partial(wake_timers, node))
        if isinstance(node, PreparedNode) and node.readiness.state != READY:
            preparation = Preparation(node)
            _prepare(node, preparation, executor, stop)
    except (ValueError, OSError) as error:
        rclpy.try_shutdown()
        if not isinstance(error, OSError) and not type(error).__module__.startswith("slosh_"):
            raise
        print(plain_line(f"{type(error).__name__}: {error}"), file=sys.stderr)
        return EXIT_WRONG_INPUT
    # A full collection takes 100 ms with SciPy, Numba and OpenCV loaded: exempt what is there.
    gc.collect()
    gc.freeze()
    with contextlib.suppress(ExternalShutdownException):
        hearing = _Hearing()
        while not (stop.requested or finished(node) or hearing.is_lost()):
            _spin_once(node, executor)
        if hearing.lost:
            node.failure = (
                "its shared-memory port was taken over by another process; no messages can be "
                "received, exiting"
            )
    close = getattr(node, "close", None)
    if close is not None:
        close()
    code = _exit_code(node)
    node.destroy_node()
    rclpy.try_shutdown()
    if preparation is not None and preparation.runs:
        # A compiler cannot be interrupted, and whoever stops a node does not wait for one.
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    return code


def _prepare(node: PreparedNode, preparation: Preparation, executor: Any, stop: _StopFlag) -> None:
    """Runs a node's preparation while diagnostics are published; a stop request ends it."""
    with contextlib.suppress(ExternalShutdownException):
        while preparation.runs and not stop.requested:
            executor.spin_once(timeout_sec=_POLL)
            node.tell_news()
    if preparation.error is not None:
        raise preparation.error
    if not preparation.runs:
        node.is_prepared()


def _spin_once(node: Node, executor: Any) -> None:
    """Runs waiting callbacks; counts exceptions, such as those of invalid messages."""
    try:
        executor.spin_once(timeout_sec=_POLL)
    except ExternalShutdownException:
        raise
    except Exception as error:
        if not isinstance(node, GuardedNode):
            raise
        node.faults.add("a message", error)


def _exit_code(node: Node) -> int:
    failure = getattr(node, "failure", "")
    if not failure:
        return EXIT_DONE
    print(plain_line(f"{node.get_name()}: {failure}"), file=sys.stderr)
    return int(getattr(node, "failure_code", EXIT_FAILED))


def initialise(arguments: Sequence[str] | None) -> None:
    """Starts ROS in this process, restricted to this machine by default.

    Raises:
        SloshMessageError: a command line or parameter file that it cannot read.
    """
    bound()
    free_dead_ports()
    hold_dead_ports()
    try:
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:
        # What follows are places in the sources of rcl.
        reason = " ".join(str(error).split()).split(", at /")[0]
        reason = reason.removeprefix("failed to initialize rcl: ")
        if "log directory" in reason:
            reason += "; set ROS_LOG_DIR to a writable folder"
        raise SloshMessageError(f"ROS cannot start: {reason}") from None


def make_heard(factory: Callable[[], _Node]) -> _Node:
    """Creates a process's first node so that other processes can reach it over shared memory."""
    # What hears is the participant: it lives from the first node of the process to the last.
    first = _participant()
    for _ in range(ATTEMPTS):
        if not is_deaf():
            break
        print("shared-memory port still taken by a killed process; trying again", file=sys.stderr)
        first.destroy_node()
        time.sleep(PAUSE)
        first = _participant()
    try:
        return factory()
    finally:
        first.destroy_node()


class _Hearing:
    """Checks whether other processes can still reach this process; see `shared_memory`.

    Attributes:
        lost: whether they do no more.
    """

    def __init__(self) -> None:
        self.lost = False
        self._suspected = 0
        self._look_at = time.monotonic() + HEARING_PERIOD

    def is_lost(self) -> bool:
        """Whether two successive checks have found that this process cannot be reached."""
        if time.monotonic() >= self._look_at:
            # From now on: who stood still for long does not look three times at once.
            self._look_at = time.monotonic() + HEARING_PERIOD
            self._suspected = self._suspected + 1 if is_deaf() else 0
            self.lost = self._suspected >= SURE
        return self.lost


def _participant() -> Node:
    """Creates a minimal node without services and logging."""
    return rclpy.create_node(
        f"_start_{os.getpid()}", start_parameter_services=False, enable_rosout=False
    )


class _StopFlag:
    """A flag that a signal sets, so that the node ends between two callbacks."""

    def __init__(self) -> None:
        self.requested = False
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            # nohup has SIGHUP ignored, and means it.
            if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:
                signal.signal(number, self._set)

    def starter_ended(self) -> None:
        """Requests a stop because the parent process has ended."""
        self.requested = True
        with contextlib.suppress(OSError):  # it may have been the reader
            print("parent process exited; shutting down", file=sys.stderr)

    def _set(self, number: int, frame: FrameType | None) -> None:
        self.requested = True


def make_executor() -> Any:
    """Creates the executor: event-based, or single-threaded if SLOSH_EXECUTOR=single.

    The events executor takes half the processor time of the single-threaded one. Its `spin()`
    delivers nothing in some releases, a loop of `spin_once()` works in all.

    Raises:
        SloshMessageError: SLOSH_EXECUTOR names no executor.
    """
    wanted = os.environ.get("SLOSH_EXECUTOR", "events")
    if wanted not in EXECUTORS:
        known = ", ".join(EXECUTORS)
        raise SloshMessageError(f"SLOSH_EXECUTOR = {wanted!r} must be one of {known}")
    if wanted == "single":
        return SingleThreadedExecutor()
    try:
        from rclpy.experimental import EventsExecutor
    except ImportError:
        return SingleThreadedExecutor()
    return EventsExecutor()


def watch_clock(set_back: Callable[[], None]) -> None:
    """Starts a thread that calls a function whenever the system clock is set back.

    Libraries built for old systems, rclpy and Fast DDS as wheels among them, wait until a moment
    of the system's clock: set back by an hour, the executor's timers would wait an hour longer.
    """
    threading.Thread(target=_watch, args=(set_back,), name="clock steps", daemon=True).start()


def wake_timers(node: Node) -> None:
    """Restarts all timers of a node with a full period."""
    for timer in list(node.timers):
        with contextlib.suppress(InvalidHandle):  # the node has ended meanwhile
            timer.reset()


def _watch(set_back: Callable[[], None]) -> None:
    never = threading.Event()
    before = _ahead()
    while not never.wait(PERIOD):
        now = _ahead()
        if now < before - STEP_NS:
            set_back()
        before = now


def _ahead() -> int:
    """Returns the system clock minus the monotonic clock [ns]."""
    return time.time_ns() - time.monotonic_ns()
