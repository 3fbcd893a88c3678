"""Explains effects and model names as text for a terminal."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping

from slosh_model.containers import SECTIONS
from slosh_model.effects.base import Effect, Parameter
from slosh_model.effects.registry import EFFECTS

_MARGIN = 12

_NAME = re.compile(r"(?P<space>[23]d)?-?(?P<surface>nl|l)?(?P<others>(?:\+\w+)*)", re.I)
_PARTS = {
    "2d": "2D: without the effect of vertical acceleration on the liquid",
    "3d": "3D: vertical acceleration changes the liquid's stiffness (vertical_acceleration)",
    "l": "L: linear; the surface is a plane (DL22, eqs. (12), (15))",
    "nl": "NL: nonlinear; the surface is curved (effect surface_nonlinearity, or the container's "
    "own; DL22, eqs. (11), (14))",
}
NAMES = ("2D-L", "3D-L", "2D-NL", "3D-NL", "2D", "3D", "L", "NL")

_TOKEN = re.compile(r"\\[a-zA-Z]+|\\.|.", re.S)
_ACCENTS = {"dot": "\u0307", "ddot": "\u0308", "hat": "\u0302", "bar": "\u0304"}
_FUNCTIONS = ("cos", "sin", "tan", "tanh", "min", "max")
_GAP = "\0"
_SIGNS = {
    "alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "zeta": "ζ", "eta": "η", "theta": "θ",
    "kappa": "κ", "mu": "μ", "nu": "ν", "xi": "ξ", "rho": "ρ", "sigma": "σ", "tau": "τ",
    "phi": "ϕ", "varphi": "φ", "psi": "ψ", "omega": "ω",
    "to": " → ", "le": " ≤ ", "ge": " ≥ ", "times": " × ", "cdot": "·", "perp": " ⊥ ",
    "dots": "…", "sum": "Σ", "lVert": "‖", "rVert": "‖", "left": "", "right": "",
    "quad": _GAP, ",": " ", " ": " ",
}  # fmt: skip
_ENDS_A_FACTOR = ("", "+", "-", "=", ",", ")", "}", "\\right", "\\quad")
_RAISED = dict(zip("0123456789+-=()nT", "⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻⁼⁽⁾ⁿᵀ", strict=True))
_LOWERED = dict(zip("0123456789+-=()aehklmnoprstx", "₀₁₂₃₄₅₆₇₈₉₊₋₌₍₎ₐₑₕₖₗₘₙₒₚᵣₛₜₓ", strict=True))


def explain_effect(effect: Effect) -> str:
    """Explains an effect: its meaning, equation, parameters, source and containers."""
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
    """Converts formulae between dollar signs in a sentence to Unicode."""
    parts = text.split("$")
    return "".join(
        plain_equation(part) if number % 2 else part for number, part in enumerate(parts)
    )


def parameter_words(parameter: Parameter) -> str:
    """Describes a parameter: name, meaning, unit, bounds and values."""
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
    """Formats the allowed values of a parameter."""
    if parameter.choices is not None:
        return " or ".join(f"{choice:g}" for choice in parameter.choices)
    return f"{parameter.lower:g} … {parameter.upper:g}"


def usually(parameter: Parameter) -> str:
    """Describes a parameter's typical error or value; empty if neither is known."""
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
    """Formats an effect as an entry of the `effects:` list in model.yaml."""
    given = [parameter.name for parameter in effect.parameters if parameter.default is None]
    values = ", ".join([f"name: {effect.name}", *(f"{name}: …" for name in given)])
    return f"effects: [{{{values}}}]"


def _containers(effect: Effect) -> str:
    """Lists the container shapes to which an effect applies."""
    fitting = [name for section, name in SECTIONS.items() if effect.fits(section)]
    return "of every shape" if len(fitting) == len(SECTIONS) else ", ".join(fitting)


def model_name(name: str) -> list[str]:
    """Explains a model name, one line per part; empty if it is not a model name."""
    match = _NAME.fullmatch(name.strip())
    if match is None or not (match["space"] or match["surface"]):
        return []
    others = [one for one in match["others"].split("+") if one]
    if any(one not in EFFECTS for one in others):
        return []
    parts = [_PARTS[part.lower()] for part in (match["space"], match["surface"]) if part]
    return [*parts, *(f"{one}: {EFFECTS[one].meaning}" for one in others)]


def plain_equation(latex: str) -> str:
    """Converts a LaTeX equation to one line of Unicode; unknown commands become plain names."""
    text = "".join(_Reader(latex).all())
    text = re.sub(r"(?<=[(\[]) +", "", re.sub(r" {2,}", " ", text))
    return unicodedata.normalize("NFC", re.sub(rf" *{_GAP} *", "   ", text)).strip()


class _Reader:
    """Parser of LaTeX formulae, which produces Unicode text."""

    def __init__(self, latex: str) -> None:
        self._tokens = _TOKEN.findall(latex)
        self._at = 0

    def all(self) -> list[str]:
        """Parses LaTeX up to the end of the current group or of the text."""
        pieces: list[str] = []
        while self._at < len(self._tokens) and self._next() != "}":
            pieces.append(self._piece())
        return pieces

    def _next(self) -> str:
        return self._tokens[self._at] if self._at < len(self._tokens) else ""

    def _take(self) -> str:
        self._at += 1
        return str(self._tokens[self._at - 1])

    def _piece(self) -> str:
        token = self._take()
        if token.startswith("\\"):
            return self._command(token[1:])
        if token == "{":
            inner = "".join(self.all())
            self._at += 1
            return inner
        if token in "^_":
            return _shifted(self._argument(), token)
        return "−" if token == "-" else token

    def _argument(self) -> str:
        while self._next() == " ":
            self._at += 1
        return self._piece() if self._next() else ""

    def _command(self, name: str) -> str:
        if name in _ACCENTS:
            letter = self._argument()
            return letter[:1] + _ACCENTS[name] + letter[1:]
        if name == "frac":
            above, below = self._argument(), self._argument()
            return self._fraction(f"{_factor(above)}/{_factor(below)}")
        if name == "sqrt":
            return f"√({self._argument()})"
        if name == "mathrm":
            return self._argument()
        if name in _FUNCTIONS:
            return self._function(name)
        return _SIGNS.get(name, name)

    def _fraction(self, text: str) -> str:
        """Encloses a LaTeX fraction in brackets if another factor follows."""
        rest = (token for token in self._tokens[self._at :] if token not in (" ", "\\,"))
        return text if next(rest, "") in _ENDS_A_FACTOR else f"({text})"

    def _function(self, name: str) -> str:
        lead = " " if self._at > 1 else ""
        if self._next() == "_":
            return f"{lead}{name}{self._piece()} "
        return f"{lead}{name}" + ("" if self._next() in ("^", "(", "\\left") else " ")


def _factor(text: str) -> str:
    """Encloses a text in brackets if it consists of more than one factor."""
    one = text.startswith("√(") or not re.search(r"[\s/·]", text.strip())
    return text if one else f"({text})"


def _shifted(text: str, sign: str) -> str:
    """Converts a text to superscript or subscript letters, or keeps ^ or _ in front of it."""
    letters: Mapping[str, str] = _RAISED if sign == "^" else _LOWERED
    if all(letter in letters for letter in text):
        return "".join(letters[letter] for letter in text)
    return f"{sign}{text}" if text.isalpha() else f"{sign}({text.strip()})"
