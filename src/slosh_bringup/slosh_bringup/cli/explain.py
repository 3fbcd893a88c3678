"""`slosh explain`: explains effects, flags, columns, model names and units."""

from __future__ import annotations

import argparse
import heapq
import json
from collections.abc import Iterator
from difflib import SequenceMatcher

from slosh_bringup.cli.quantities import QUANTITIES
from slosh_bringup.errors import SloshBringupError
from slosh_bringup.explain import terms
from slosh_bringup.explain.effect import NAMES, explain_effect, model_name
from slosh_bringup.explain.terms import by_number, fields, flags
from slosh_model.effects.registry import EFFECTS

_FLAG_PAGES = "docs/camera.md, docs/interfaces.md"
_NEAR, _ALIKE = 3, 0.6
"""Most names that are told, and how like they must be to be worth it."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `slosh explain` to the argument parser."""
    parser.add_argument(
        "name", nargs="*",
        help="name of an effect, a flag, a state, a column, a model or a unit, or a sum of flags "
        "(0x3) (default: list all)",
    )  # fmt: skip
    parser.add_argument("--json", action="store_true", help="print names and meanings as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Prints the explanation of a name, or all names with one line each."""
    name = " ".join(arguments.name)
    if arguments.json:
        print(json.dumps(_facts(name), ensure_ascii=False))
    else:
        print("\n\n".join(_told(name)) if name else _all())
    return 0


def _facts(name: str) -> list[dict[str, str]]:
    """Returns the kind, name and meaning of one term, or of all terms."""
    found = [
        *(
            {"kind": "effect", "name": one.name, "meaning": one.meaning}
            for one in EFFECTS.values()
        ),
        *({"kind": one.kind, "name": one.name, "meaning": one.meaning} for one in flags()),
        *({"kind": "column", "name": n, "meaning": m} for n, m in terms.columns().items()),
        *({"kind": "model", "name": n, "meaning": "; ".join(model_name(n))} for n in NAMES),
        *({"kind": "unit", "name": n, "meaning": m} for n, m in terms.UNITS.items()),
    ]
    if not name:
        return found
    told = _told(name)  # refuses what there is not
    plain = _plain(name)
    exact = [one for one in found if _plain(one["name"]) == plain]
    return exact or [{"kind": "term", "name": name, "meaning": "\n\n".join(told)}]


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
    lines += ["", "columns and figures:"]
    lines += [f"{name:<{width}}{meaning}" for name, meaning in terms.COLUMNS.items()]
    lines += ["", "models:", *(f"{name:<{width}}{'; '.join(model_name(name))}" for name in NAMES)]
    lines += ["", "units:", *(f"{name:<{width}}{text}" for name, text in terms.UNITS.items())]
    return "\n".join(["effects:", *lines])


def _told(name: str) -> list[str]:
    """Returns all meanings of a term, one text for each."""
    found = list(_meanings(name)) or list(_figure_of_model(name))
    if found:
        return found
    raise SloshBringupError(
        f"{name!r:.60} is no effect, flag, column, model or unit; {_nearest(name)}"
    )


def _meanings(name: str) -> Iterator[str]:
    effect = EFFECTS.get(name.lower().replace("-", "_"))
    if effect is not None:
        yield explain_effect(effect)
    wanted = terms.plain(name).upper().removeprefix("STATE_")
    same = [flag for flag in flags() if flag.name == wanted]
    if same:
        lines = [f"{flag.name}: {flag.kind}\n{flag.meaning}" for flag in same]
        yield "\n".join([*lines, f"pages       {_FLAG_PAGES}"])
    column = terms.column(name)
    if column:
        yield f"{name}: column or figure\n{column}"
    else:
        yield from fields().get(terms.plain(name), ())
    for kind, lines in (("model", model_name(name)), ("number", by_number(name))):
        if lines:
            yield "\n".join([f"{name}: {kind}", *lines])
    bare = name.strip("[]")
    unit = terms.unit(bare) or next((q.meaning(bare) for q in QUANTITIES if bare in q.units), "")
    if unit:
        yield f"{name}: unit\n{unit}"


def _figure_of_model(name: str) -> Iterator[str]:
    """Explains a column name such as `MAE 3D-NL`: first the metric, then the model."""
    figure, _, model = name.rpartition(" ")
    if figure and terms.column(figure) and model_name(model):
        yield from (*_meanings(figure), *_meanings(model))


def _nearest(name: str) -> str:
    """Suggests known terms that are similar to an unknown word, as part of a sentence."""
    word = name.lower().replace("-", "_")
    known = dict.fromkeys([*EFFECTS, *(flag.name for flag in flags()), *terms.columns()])
    near = heapq.nlargest(_NEAR, known, key=lambda one: _likeness(word, one.lower()))
    near = [one for one in near if _likeness(word, one.lower()) > _ALIKE]
    return f"nearest: {', '.join(near)}" if near else "`slosh explain` lists them"


def _likeness(word: str, name: str) -> float:
    return max(SequenceMatcher(None, word, part).ratio() for part in (name, *name.split("_")))
