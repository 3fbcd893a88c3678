"""Base class of all inputs, with a check whether the samples are plausible."""

from __future__ import annotations

from collections.abc import Sequence

from slosh_motion.checks.beginning import Beginning, began_doubt
from slosh_motion.checks.constancy import Vector
from slosh_motion.checks.constant_meaning import Doubt
from slosh_motion.checks.input_checks import Check
from slosh_motion.errors import SloshMotionError


class CheckedInput:
    """An input whose samples are checked for plausibility.

    Args:
        check: of its samples.
        checks: whether doubts are told and flagged; None: as before these checks existed, so
            that recordings of that time have the flags of that time.

    Attributes:
        check: of its samples.
        flags: whether a doubt makes samples doubtful.
        began: what shows that the container moved when the input began; None: nothing.
    """

    def __init__(self, check: Check, checks: bool | None) -> None:
        self.check = check
        self.flags = bool(checks)
        self._remembers = checks is not None
        self.began: Doubt | None = None
        self._beginning = Beginning()

    @property
    def doubt(self) -> Doubt | None:
        """The current fault of the input, or None if no fault is known."""
        return self.check.doubt if self.flags else None

    def assume_rest(self) -> None:
        """Takes the container as at rest before the first sample, or as known from elsewhere."""
        self._beginning.open = False

    def _began(self, stamp_ns: int, acceleration: Vector) -> bool:
        """Returns whether an acceleration shows that the input began in motion."""
        if not self._beginning.take(stamp_ns, acceleration) or not self.flags:
            return False
        self.began = began_doubt(f"{self._beginning.size:.2g} m/s² along the floor")
        return True

    def message_doubts(self) -> tuple[Doubt, ...]:
        """Returns what messages that contradict themselves or each other show."""
        return ()

    @property
    def contested(self) -> bool:
        """Whether successive messages show two publishers."""
        return False

    @property
    def contradicted(self) -> bool:
        """Whether messages contradict themselves, so that what follows from them is wrong."""
        return False

    def remark(self) -> str | None:
        """Returns a remark about settings without effect, or None if there are none."""
        return None

    def refusal(self) -> str | None:
        """Returns why samples in a wrong coordinate frame were dropped; None if none were."""
        return None

    def checked_memory(self, stamp_ns: int) -> list[float]:
        """Returns the plausibility check's state at a sample's stamp [ns] as numbers."""
        return self.check.memory(stamp_ns) if self._remembers else []

    def take_up_check(self, stamp_ns: int, memory: Sequence[float]) -> Sequence[float]:
        """Restores the plausibility check from saved numbers; returns the numbers left."""
        self.assume_rest()
        count = self.check.MEMORY
        if not self._remembers or len(memory) < count:
            return memory
        self.check.take_up(stamp_ns, memory[-count:])
        return memory[:-count]


def remembered(memory: Sequence[float], count: int, rate: int = 0) -> Sequence[float]:
    """Checks the length of an input reader's saved state, and returns that state.

    Args:
        memory: all of it.
        count: numbers of the reader's own.
        rate: numbers about the input's rate that follow them, but in recordings of old.

    Raises:
        SloshMotionError: it does not consist of so many numbers.
    """
    if len(memory) not in (count, count + rate):
        raise SloshMotionError(
            f"saved state of an input with {len(memory)} values, must have {count + rate}"
        )
    return memory
