"""What an identification's page and text show."""

from __future__ import annotations

from dataclasses import dataclass

from slosh_discovery.identify.result import FoundParameter, Identification, IdentifiedModel
from slosh_model.model import Model


@dataclass(frozen=True, slots=True)
class Beside:
    """What an earlier identification found, of this container or another.

    Attributes:
        name: for people; its folder.
        model: its model.
        frequency, damping: of the first mode, with standard errors [rad/s, 1].
    """

    name: str
    model: Model
    frequency: tuple[float, float]
    damping: tuple[float, float]


@dataclass(frozen=True, slots=True)
class IdentificationReport:
    """An identification and what its reader must know beside it.

    Attributes:
        found: what was found.
        subtitle: where the data come from; may be empty.
        notes: how the data were read, a sentence each.
        beside: earlier identifications that are shown with it.
        model_files: names of the models of the operating points, in their order; empty: none.
        help_files: names of the tables of motions that would tell of the parameters held, by
            parameter.
    """

    found: Identification
    subtitle: str = ""
    notes: tuple[str, ...] = ()
    beside: tuple[Beside, ...] = ()
    model_files: tuple[str, ...] = ()
    help_files: tuple[tuple[str, str], ...] = ()

    @property
    def remarks(self) -> tuple[str, ...]:
        """Notes and remarks, each once."""
        return tuple(dict.fromkeys((*self.notes, *self.found.remarks)))


def first_mode(result: IdentifiedModel, name: str) -> FoundParameter:
    """Natural frequency or damping ratio of the first mode, fitted or following from the fit."""
    entries = (*result.parameters, *result.derived)
    return next(entry for entry in entries if entry.name == name)
