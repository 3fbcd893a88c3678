"""What a discovery's page and text show."""

from __future__ import annotations

from dataclasses import dataclass

from slosh_discovery.discover.finding import Finding
from slosh_report.page.frame import Frame


@dataclass(frozen=True, slots=True)
class Command:
    """Something to type next.

    Attributes:
        purpose: what it does, a few words.
        line: the command.
    """

    purpose: str
    line: str


@dataclass(frozen=True, slots=True)
class DiscoveryReport:
    """A finding and what its reader must know beside it.

    Attributes:
        finding: what was found.
        subtitle: where the data come from; may be empty.
        notes: how the data were used, a sentence each; shown before the finding's own remarks.
        commands: to type next, in order.
        separating_files: names of the tables of the separating motions, in their order; empty:
            they were not written.
        frames: camera images of the worst moments.
    """

    finding: Finding
    subtitle: str = ""
    notes: tuple[str, ...] = ()
    commands: tuple[Command, ...] = ()
    separating_files: tuple[str, ...] = ()
    frames: tuple[Frame, ...] = ()

    @property
    def remarks(self) -> tuple[str, ...]:
        """Notes and remarks, each once."""
        return tuple(dict.fromkeys((*self.notes, *self.finding.remarks)))
