"""State of a node's start-up, for diagnostics and for waiting processes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

STATE: Final = "state"
"""The key in the diagnostics."""
STARTING: Final = "starting"
COMPILING: Final = "compiling"
WAITING: Final = "waiting"
"""For something that somebody else has to send."""
READY: Final = "ready"
RECORDED: Final = "recorded settings of"
"""The key of the recorder's diagnostics that lists the nodes whose settings are in the bag."""

Progress = Callable[[str], None]
"""Is told what is being compiled; not called where all of it is compiled already."""


class Readiness:
    """State of a node's start-up: compiling, waiting or ready.

    Attributes:
        state: STARTING, COMPILING, WAITING or READY.
        doing: what takes so long, in words; empty: nothing does.
    """

    def __init__(self, state: str = READY) -> None:
        self.state = state
        self.doing = ""
        self._told = state, ""

    def compiles(self, doing: str) -> None:
        """Sets the state to compiling, with a description of what is compiled."""
        self.state, self.doing = COMPILING, doing

    def waits(self, doing: str) -> None:
        """Sets the state to waiting, with a description of what is missing."""
        self.state, self.doing = WAITING, doing

    def is_ready(self) -> None:
        """Sets the state to ready."""
        self.state, self.doing = READY, ""

    def news(self) -> bool:
        """Whether the state has changed since the last call."""
        before, self._told = self._told, (self.state, self.doing)
        return self._told != before

    @property
    def sentence(self) -> str:
        """The state and its description, as one text."""
        return f"{self.state}: {self.doing}" if self.doing else self.state
