"""`slosh explain`: what an effect or a flag means."""

from __future__ import annotations

import argparse
import heapq
import json
from difflib import SequenceMatcher

from slosh_bringup.errors import SloshBringupError
from slosh_bringup.explain.effect import explain_effect
from slosh_bringup.explain.flags import flags
from slosh_model.effects.registry import EFFECTS

_FLAG_PAGES = "docs/camera.md, docs/interfaces.md"
_NEAR, _ALIKE = 3, 0.6
"""Most names that are told, and how like they must be to be worth it."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the subcommand's options."""
    parser.add_argument(
        "name", nargs="?", help="name of an effect, a flag or a state (default: list all)"
    )
    parser.add_argument("--json", action="store_true", help="print names and meanings as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Prints what it means, or all names with a line each."""
    if arguments.json:
        print(json.dumps(_facts(arguments.name), ensure_ascii=False))
    else:
        print(_all() if arguments.name is None else _one(arguments.name))
    return 0


def _facts(name: str | None) -> list[dict[str, str]]:
    """Kind, name and meaning of what is asked for, or of all."""
    found = [
        *(
            {"kind": "effect", "name": one.name, "meaning": one.meaning}
            for one in EFFECTS.values()
        ),
        *({"kind": one.kind, "name": one.name, "meaning": one.meaning} for one in flags()),
    ]
    if name is None:
        return found
    _one(name)  # refuses what there is not
    plain = _plain(name)
    return [one for one in found if _plain(one["name"]) == plain]


def _plain(name: str) -> str:
    return name.lower().replace("-", "_").removeprefix("state_")


def _all() -> str:
    width = max(map(len, [*EFFECTS, *(flag.name for flag in flags())])) + 2
    lines = [f"{effect.name:<{width}}{effect.meaning}" for effect in EFFECTS.values()]
    kind = ""
    for flag in flags():
        if flag.kind != kind:
            kind = flag.kind
            lines += ["", f"{kind}:"]
        lines.append(f"{flag.name:<{width}}{flag.meaning}")
    return "\n".join(["effects:", *lines])


def _one(name: str) -> str:
    effect = EFFECTS.get(name.lower().replace("-", "_"))
    if effect is not None:
        return explain_effect(effect)
    found = [flag for flag in flags() if flag.name == name.upper().removeprefix("STATE_")]
    if found:
        lines = [f"{flag.name}: {flag.kind}\n{flag.meaning}" for flag in found]
        return "\n".join([*lines, f"pages       {_FLAG_PAGES}"])
    raise SloshBringupError(f"{name!r:.60} is neither an effect nor a flag; {_nearest(name)}")


def _nearest(name: str) -> str:
    """The names that are most like it, or of which it is a part."""
    word = name.lower().replace("-", "_")
    known = dict.fromkeys([*EFFECTS, *(flag.name for flag in flags())])
    near = heapq.nlargest(_NEAR, known, key=lambda one: _likeness(word, one.lower()))
    near = [one for one in near if _likeness(word, one.lower()) > _ALIKE]
    return f"nearest: {', '.join(near)}" if near else "`slosh explain` lists them"


def _likeness(word: str, name: str) -> float:
    return max(SequenceMatcher(None, word, part).ratio() for part in (name, *name.split("_")))
