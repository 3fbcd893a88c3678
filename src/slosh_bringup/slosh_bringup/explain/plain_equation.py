"""Equations as text that a terminal shows: Unicode in place of LaTeX."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping

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


def plain_equation(latex: str) -> str:
    """The equation in Unicode, in one line; a command that is not known becomes its name."""
    text = "".join(_Reader(latex).all())
    text = re.sub(r"(?<=[(\[]) +", "", re.sub(r" {2,}", " ", text))
    return unicodedata.normalize("NFC", re.sub(rf" *{_GAP} *", "   ", text)).strip()


class _Reader:
    """Reads LaTeX from left to right."""

    def __init__(self, latex: str) -> None:
        self._tokens = _TOKEN.findall(latex)
        self._at = 0

    def all(self) -> list[str]:
        """The pieces up to the end of the group, or of everything."""
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
        """In brackets where a factor follows, which would else stand below the line."""
        rest = (token for token in self._tokens[self._at :] if token not in (" ", "\\,"))
        return text if next(rest, "") in _ENDS_A_FACTOR else f"({text})"

    def _function(self, name: str) -> str:
        lead = " " if self._at > 1 else ""
        if self._next() == "_":
            return f"{lead}{name}{self._piece()} "
        return f"{lead}{name}" + ("" if self._next() in ("^", "(", "\\left") else " ")


def _factor(text: str) -> str:
    """In brackets where it is more than one factor."""
    one = text.startswith("√(") or not re.search(r"[\s/·]", text.strip())
    return text if one else f"({text})"


def _shifted(text: str, sign: str) -> str:
    """Raised or lowered, or behind the sign where Unicode lacks a letter for it."""
    letters: Mapping[str, str] = _RAISED if sign == "^" else _LOWERED
    if all(letter in letters for letter in text):
        return "".join(letters[letter] for letter in text)
    return f"{sign}{text}" if text.isalpha() else f"{sign}({text.strip()})"
