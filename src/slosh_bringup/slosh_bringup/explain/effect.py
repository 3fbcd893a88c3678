"""What the registry knows of an effect, as text."""

from __future__ import annotations

from slosh_bringup.explain.plain_equation import plain_equation
from slosh_model.containers import SHAPES
from slosh_model.effects.base import Effect, Parameter

_MARGIN = 12


def explain_effect(effect: Effect) -> str:
    """All of it: meaning, equation, parameters, source, containers, page; a line or more each."""
    rows = [
        ("acts on", ", ".join(stage.value for stage in effect.stages)),
        ("equation", plain_equation(effect.equation)),
        *(("parameter", parameter_words(parameter)) for parameter in effect.parameters),
        ("source", in_unicode(effect.source)),
        ("containers", _containers(effect)),
        *([("belongs to", _owner(effect))] if effect.parameters else []),
        *([("needs", "a motion with attitude")] if effect.needs_rotation else []),
        ("model.yaml", _use(effect)),
        ("page", f"docs/effects/{effect.name}.md"),
    ]
    if not effect.parameters:
        rows.insert(2, ("parameters", "none"))
    head = f"{effect.name}: {effect.title}\n{effect.meaning}\n"
    return head + "\n".join(f"{label:<{_MARGIN}}{text}" for label, text in rows)


def in_unicode(text: str) -> str:
    """A sentence in which formulae stand between dollar signs, with these as Unicode."""
    parts = text.split("$")
    return "".join(
        plain_equation(part) if number % 2 else part for number, part in enumerate(parts)
    )


def parameter_words(parameter: Parameter) -> str:
    """Name, meaning, unit, bounds and values of a parameter."""
    unit = "" if parameter.unit == "1" else f" {parameter.unit}"
    words = [f"{bounds(parameter)}{unit}"]
    if parameter.default is None:
        words.append("must be given")
    else:
        words.append(f"default {parameter.default:g}")
    if parameter.neutral is not None:
        words.append(f"{parameter.neutral:g} has no effect")
    if usually(parameter):
        words.append(f"usually {usually(parameter)}")
    return f"{parameter.name}: {in_unicode(parameter.description)}; {', '.join(words)}"


def bounds(parameter: Parameter) -> str:
    """The values that it may have."""
    if parameter.choices is not None:
        return " or ".join(f"{choice:g}" for choice in parameter.choices)
    return f"{parameter.lower:g} … {parameter.upper:g}"


def usually(parameter: Parameter) -> str:
    """How far people and rigs have it wrong, or else where it lies; empty: it is not known."""
    expected = parameter.neutral if parameter.expected is None else parameter.expected
    if parameter.spread is not None and expected is not None:
        return f"{expected:g} ± {parameter.spread:g}"
    usual = parameter.plausible
    return "" if usual is None else f"{usual[0]:.3g} … {usual[1]:.3g}"


def _owner(effect: Effect) -> str:
    if effect.of_rig:
        return "sensors and rig: it may change when they are set up again"
    return "the liquid and its container"


def _use(effect: Effect) -> str:
    """As `effects:` of a model.yaml lists it."""
    given = [parameter.name for parameter in effect.parameters if parameter.default is None]
    values = ", ".join([f"name: {effect.name}", *(f"{name}: …" for name in given)])
    return f"effects: [{{{values}}}]"


def _containers(effect: Effect) -> str:
    """Shapes of the containers for which an effect has a meaning."""
    fitting = [name for name, kind in SHAPES.items() if effect.fits(kind.section)]
    return "of every shape" if len(fitting) == len(SHAPES) else ", ".join(fitting)
