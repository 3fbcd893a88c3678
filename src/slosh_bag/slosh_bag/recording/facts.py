"""Facts about a whole bag that its metadata may note: their keys, and what they mean."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from slosh_bag.recorder import SEVERAL
from slosh_model.containers import Cylinder

CLOCKS: Final = "clocks"
UNRELATED: Final = "unrelated"
TABLE_COLUMNS: Final = "table_columns"
"""Names of the columns of the motion table that a bag was made of."""
TABLE_ORIGIN: Final = "table_origin_ns"
"""The stamp at that table's t = 0 [ns]."""
CONTAINER_RADIUS: Final = "container_radius"
CONTAINER_FILL_HEIGHT: Final = "container_fill_height"


def clocks_unrelated(facts: Mapping[str, str]) -> bool:
    """Whether the stamps of inputs and of heights have nothing to do with each other."""
    return facts.get(CLOCKS) == UNRELATED


def shared_topics_line(facts: Mapping[str, str]) -> str:
    """What several publishers on topics of one node mean for a bag; empty: there were none."""
    topics = facts.get(SEVERAL, "").replace(",", ", ")
    if not topics:
        return ""
    return (
        f"several publishers spoke on {topics}, as where two cells share a namespace: "
        "what was recorded is a mixture, and its estimates do not replay"
    )


def noted_container(facts: Mapping[str, str]) -> Cylinder | None:
    """The container that was recorded; None: the facts do not tell.

    Raises:
        SloshModelError: they tell of an impossible one.
    """
    try:
        radius, fill_height = float(facts[CONTAINER_RADIUS]), float(facts[CONTAINER_FILL_HEIGHT])
    except (KeyError, ValueError):
        return None
    return Cylinder(radius, fill_height)
