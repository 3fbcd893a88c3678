"""Finds the topic of a bag that a user means by a name."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import SequenceMatcher
from pathlib import Path

from slosh_bag.errors import SloshBagError


def find_topic(bag: Path, topics: Iterable[str], name: str) -> str:
    """Finds a topic by its full name or by an ending that only one topic has.

    Args:
        bag: where the topics are; for what is said of it.
        topics: the topics that there are.
        name: as typed: '/slosh/cell/truth', 'cell/truth' or 'truth'.

    Raises:
        SloshBagError: there is no such topic, or several; the line lists those there are, the
            most alike first.
    """
    known = sorted(topics)
    if name in known:
        return name
    ending = f"/{name.strip('/')}"
    ends = [topic for topic in known if topic.endswith(ending)]
    if len(ends) == 1:
        return ends[0]
    if ends:
        raise SloshBagError(f"{bag}: {name!r} may be {' or '.join(ends)}; give the whole name")
    alike = sorted(known, key=lambda topic: -SequenceMatcher(None, name, topic).ratio())
    raise SloshBagError(
        f"{bag}: has no topic {name!r}; its topics: {', '.join(alike) if alike else 'none'}"
    )
