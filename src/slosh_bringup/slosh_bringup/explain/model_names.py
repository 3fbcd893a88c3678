"""What the name of a model says: 3D-NL, 2D-L+fill_level."""

from __future__ import annotations

import re

from slosh_model.effects.registry import EFFECTS

_NAME = re.compile(r"(?P<space>[23]d)?-?(?P<surface>nl|l)?(?P<others>(?:\+\w+)*)", re.I)
_PARTS = {
    "2d": "2D: without the effect of vertical acceleration on the liquid",
    "3d": "3D: vertical acceleration changes the liquid's stiffness (vertical_acceleration)",
    "l": "L: linear; the surface is a plane (DL22, eqs. (12), (15))",
    "nl": "NL: nonlinear; the surface is curved (effect surface_nonlinearity, or the container's "
    "own; DL22, eqs. (11), (14))",
}
NAMES = ("2D-L", "3D-L", "2D-NL", "3D-NL", "2D", "3D", "L", "NL")


def model_name(name: str) -> list[str]:
    """What it says, a line for each part; none: it is no model's name."""
    match = _NAME.fullmatch(name.strip())
    if match is None or not (match["space"] or match["surface"]):
        return []
    others = [one for one in match["others"].split("+") if one]
    if any(one not in EFFECTS for one in others):
        return []
    parts = [_PARTS[part.lower()] for part in (match["space"], match["surface"]) if part]
    return [*parts, *(f"{one}: {EFFECTS[one].meaning}" for one in others)]
