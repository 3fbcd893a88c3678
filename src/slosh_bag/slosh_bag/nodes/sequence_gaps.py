"""Messages that were sent and did not arrive, by the numbers that their publishers give them.

Each publisher counts its messages. The middleware hands the number over, though not whose it is:
where several publish on a topic, a number belongs to the one whose next number it is, or else to
the one that comes nearest before it. (The middleware's own event for lost messages is not asked
for: in a process that was stopped and goes on, its query may wait for ever for a lock.)
"""

from __future__ import annotations

FORGIVEN = 1_000_000
"""A larger leap is no loss, but another publisher."""


class SequenceGaps:
    """Follows the numbers of a topic's messages.

    Attributes:
        lost: numbers that were left out, so far as `settle` has confirmed them.
        turns: how often a publisher went on after another one had spoken. Where one took the
            place of another there is none; where two speak, there are many.
    """

    def __init__(self) -> None:
        self.lost = self.turns = 0
        self._unconfirmed = 0
        self._newest: int | None = None
        self._last: list[int] = []  # of each publisher

    def take(self, number: int | None, publishers: int = 1) -> None:
        """Takes the number of a message that came.

        Args:
            number: None: the middleware gives none.
            publishers: how many there are on the topic.
        """
        if number is None:
            return
        newest, self._newest = self._newest, number
        last = self._last
        if number - 1 in last:
            last[last.index(number - 1)] = number
            self.turns += newest != number - 1
            return
        before = max((one for one in last if one < number), default=None)
        if before is None or len(last) < publishers or number - before > FORGIVEN:
            # One that is new here, or has begun to count anew.
            last.append(number)
            del last[: max(len(last) - max(publishers, 1), 0)]
            return
        self._unconfirmed += number - before - 1
        last[last.index(before)] = number

    def settle(self, *, new_publishers: bool) -> None:
        """Confirms what was counted since the last call, or drops it.

        Args:
            new_publishers: whether publishers have come that were never there before. Numbers of
                theirs may have been taken for gaps of another.
        """
        if new_publishers:
            self._last.clear()
        else:
            self.lost += self._unconfirmed
        self._unconfirmed = 0
