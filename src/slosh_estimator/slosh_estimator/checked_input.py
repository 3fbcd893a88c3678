"""What all inputs share: the check of what they claim to be."""

from __future__ import annotations

from collections.abc import Sequence

from slosh_metrics.input_checks.constant_meaning import Doubt
from slosh_metrics.input_checks.input_checks import Check


class CheckedInput:
    """An input with its check.

    Args:
        check: of its samples.
        checks: whether doubts are told and flagged; None: as before these checks existed, so
            that recordings of that time have the flags of that time.

    Attributes:
        check: of its samples.
        flags: whether a doubt makes samples doubtful.
    """

    def __init__(self, check: Check, checks: bool | None) -> None:
        self.check = check
        self.flags = bool(checks)
        self._remembers = checks is not None

    @property
    def doubt(self) -> Doubt | None:
        """What is wrong with the input now; None: nothing is known to be."""
        return self.check.doubt if self.flags else None

    def remark(self) -> str | None:
        """What is worth a look; None: nothing."""
        return None

    def refusal(self) -> str | None:
        """Why samples were refused by their frame; None: none was."""
        return None

    def checked_memory(self, stamp_ns: int) -> list[float]:
        """The check's part of a memory, behind the sample of this stamp [ns]."""
        return self.check.memory(stamp_ns) if self._remembers else []

    def take_up_check(self, stamp_ns: int, memory: Sequence[float]) -> Sequence[float]:
        """Takes the check's part from the end of a memory; returns the rest."""
        count = self.check.MEMORY
        if not self._remembers or len(memory) < count:
            return memory
        self.check.take_up(stamp_ns, memory[-count:])
        return memory[:-count]
