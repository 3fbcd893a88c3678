"""Node base class for nodes that must compile code before they can work."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any

from slosh_msgs_py.journal_format import BEGIN
from slosh_msgs_py.node.diagnostics import DiagnosticsReporter, Health
from slosh_msgs_py.node.guarded import GuardedNode
from slosh_msgs_py.node.readiness import COMPILING, STARTING, Progress, Readiness


class PreparedNode(GuardedNode, ABC):
    """A node that becomes ready when its compiled code is available.

    The constructor does what is quick and what can be refused: parameters, files, publishers. All
    that is compiled or loaded happens in `prepare`, while the diagnostics already go out; `begin`
    takes up the work: what hears messages is made there, not before.

    A node made by itself is ready when its constructor returns; with `later` it is so after
    `run_node` has prepared it.
    """

    def __init__(self, name: str, *, journaled: bool = False) -> None:
        super().__init__(name, journaled=journaled)
        self.readiness = Readiness(STARTING)

    @abstractmethod
    def prepare(self, progress: Progress) -> None:
        """Compiles or loads the code that the node needs, in a separate thread.

        Args:
            progress: is told what is compiled, where something is.

        Raises:
            ValueError: of ours: what it was given cannot be used.
        """

    @abstractmethod
    def begin(self) -> None:
        """Starts the node's work; called in the executor's thread."""

    def _watch(
        self, health: Callable[[], Health], facts: Callable[[], Mapping[str, Any]]
    ) -> DiagnosticsReporter:
        """Creates the diagnostics; `health` and `facts` are called only when the node is ready."""
        self._report = DiagnosticsReporter(self, health, facts, self.readiness)
        return self._report

    def _get_ready(self, *, later: bool) -> None:
        """Finishes the constructor; prepares the node now unless `later` is set."""
        if not later:
            self.prepare(self.compiles)
            self.is_prepared()

    def compiles(self, what: str) -> None:
        """Reports the function that is being compiled; logs only the first function."""
        if not self.readiness.doing:
            self.get_logger().warning(f"not ready yet: {what}")
        self.readiness.compiles(what)

    def waits(self, what: str) -> None:
        """Reports and logs why the node has to wait."""
        self.get_logger().warning(f"not ready: {what}")
        self.readiness.waits(what)

    def is_prepared(self) -> None:
        """Starts the node's work after preparation and publishes diagnostics at once."""
        if self.journal is not None:
            self.journal.take(self.journal.source(BEGIN))
        self.begin()
        if self.readiness.doing:
            did = "compiled; " if self.readiness.state == COMPILING else ""
            self.get_logger().info(f"{did}ready")
        self.readiness.is_ready()
        self._report.report()

    def tell_news(self) -> None:
        """Publishes diagnostics at once if the start-up state has changed."""
        if self.readiness.news():
            self._report.report()


class Preparation:
    """Thread in which a node's compiled code is prepared.

    Attributes:
        error: why it cannot be prepared; None: it can, or it is not known yet.
    """

    def __init__(self, node: PreparedNode) -> None:
        self.error: BaseException | None = None
        self._node = node
        self._thread = threading.Thread(target=self._run, name="prepare", daemon=True)
        self._thread.start()

    @property
    def runs(self) -> bool:
        """Whether the preparation thread is still running."""
        return self._thread.is_alive()

    def _run(self) -> None:
        try:
            self._node.prepare(self._node.compiles)
        except BaseException as error:
            self.error = error
