"""Tests that colours have sufficient contrast and suit colour-blind readers."""

import re
from importlib.resources import files
from itertools import combinations, product

import numpy as np
import pytest

STYLE = files("slosh_report.page").joinpath("report.css").read_text(encoding="utf-8")
THEMES = dict(
    zip(
        ("light", "dark", "print"),
        (
            dict(re.findall(r"--([a-z-]+): (#[0-9a-f]{6})", block))
            for block in re.findall(r":root \{(.*?)\}", STYLE, flags=re.DOTALL)
        ),
        strict=True,
    )
)
GROUNDS = ("page", "card")
TEXTS = [
    *product(("ink", "ink-soft", "limit", "passed", "failed"), GROUNDS),
    ("ink", "passed-back"), ("ink", "failed-back"), ("ink", "warning-back"),
    ("passed", "passed-back"), ("failed", "failed-back"), ("warning", "warning-back"),
]  # fmt: skip
LINES = list(product(("measured", "linear", "nonlinear", "limit"), ("card", "span", "gap")))
# Machado, Oliveira, Fernandes (2009): how the colour-blind see linear RGB, no cones of a kind.
BLINDNESS = {
    "protanopia": ((0.152286, 1.052583, -0.204868), (0.114503, 0.786281, 0.099216),
                   (-0.003882, -0.048116, 1.051998)),
    "deuteranopia": ((0.367322, 0.860646, -0.227968), (0.280085, 0.672501, 0.047413),
                     (-0.011820, 0.042940, 0.968881)),
    "tritanopia": ((1.255528, -0.076749, -0.178779), (-0.078411, 0.930809, 0.147602),
                   (0.004733, 0.691367, 0.303900)),
}  # fmt: skip
TO_XYZ = ((0.4124, 0.3576, 0.1805), (0.2126, 0.7152, 0.0722), (0.0193, 0.1192, 0.9505))


def linear(colour):
    """Converts sRGB text to linear RGB from 0 to 1."""
    values = np.array([int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5)])
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def contrast(one, other):
    """Returns the contrast ratio of two colours as defined by WCAG 2."""
    bright, dark = sorted((linear(c) @ TO_XYZ[1] for c in (one, other)), reverse=True)
    return (bright + 0.05) / (dark + 0.05)


def lab(rgb):
    """Converts linear RGB to CIE L*a*b*."""
    f = np.cbrt(np.clip(np.array(TO_XYZ) @ rgb / (0.9505, 1.0, 1.089), 1e-6, None))
    return np.array([116.0 * f[1] - 16.0, 500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2])])


@pytest.mark.parametrize("theme", THEMES)
@pytest.mark.parametrize(("text", "ground"), TEXTS)
def test_texts_stand_out_from_their_ground(theme, text, ground):
    assert contrast(THEMES[theme][text], THEMES[theme][ground]) >= 4.5


@pytest.mark.parametrize("theme", THEMES)
@pytest.mark.parametrize(("line", "ground"), LINES)
def test_lines_stand_out_from_their_ground(theme, line, ground):
    assert contrast(THEMES[theme][line], THEMES[theme][ground]) >= 3.0


@pytest.mark.parametrize("theme", THEMES)
@pytest.mark.parametrize("eyes", BLINDNESS)
def test_the_three_lines_are_told_apart_by_all_eyes(theme, eyes):
    seen = [np.array(BLINDNESS[eyes]) @ linear(THEMES[theme][name])
            for name in ("measured", "linear", "nonlinear")]  # fmt: skip
    distances = [np.linalg.norm(lab(a) - lab(b)) for a, b in combinations(seen, 2)]
    assert min(distances) > 20.0  # two is just visible side by side
