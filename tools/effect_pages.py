"""Makes texts and pictures of the modelled effects for the pages in docs/effects.

tools/run python tools/effect_pages.py
"""

from __future__ import annotations

import io
import re
import sys
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.style import context
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from slosh_bringup.explain.effect import bounds, usually
from slosh_model.containers import SECTIONS
from slosh_model.effects.base import Effect, Parameter
from slosh_model.effects.registry import EFFECTS
from slosh_model.measure import predicted_heights
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.shapes.rectangle import Rectangle
from slosh_model.simulate import Inputs

Array = NDArray[np.float64]

FOLDER = Path(__file__).resolve().parent.parent / "docs" / "effects"

CUP = Cylinder(radius=0.05, fill_height=0.07)
TANK = Rectangle(width=0.1, depth=0.08, fill_height=0.07)
RATE = 500  # samples of the motion per second
FRAMES = 60  # heights per second
STYLE = {
    "svg.fonttype": "none",
    "svg.hashsalt": "effects",
    "font.size": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e4e4e4",
    "axes.axisbelow": True,
}


@dataclass(frozen=True, slots=True)
class Scene:
    """Parameters, motion and base model with which an effect's picture is simulated.

    Attributes:
        parameters: of the effect.
        motion: 'transfer' (upright) or 'turning' (it yaws and tilts as it goes).
        base: the model without the effect: '2D-L', '3D-L', '2D-NL' or '3D-NL'.
        others: effects that both models have, by name with parameters.
        azimuth: where the height is read [rad]; None: the maximum over the wall.
    """

    parameters: dict[str, float] = field(default_factory=dict)
    motion: str = "transfer"
    base: str = "3D-NL"
    others: dict[str, dict[str, float]] = field(default_factory=dict)
    azimuth: float | None = None


SCENES = {
    "accel_gain": Scene({"gain": 1.15}),
    "amplitude_damping": Scene({"gamma": 30.0}),
    "amplitude_stiffening": Scene({"kappa": 1.0}, base="3D-L"),
    "anisotropic_stiffness": Scene({"e": 0.06, "axis": 0.5}),
    "bound_modes": Scene({"kappa": 1.0}),
    "clock_drift": Scene({"rate": 0.015}),
    "contact_line_friction": Scene({"mu": 0.01}),
    "crest_asymmetry": Scene({"kappa": 0.6}, azimuth=0.0),
    "damping_mismatch": Scene({"factor": 5.0}),
    "draining_film": Scene({"speed": 0.04}),
    "fill_level": Scene({"delta": -0.03}),
    "fill_loss": Scene({"rate": 0.006}),
    "frame_saturation": Scene({"cap": 0.012}),
    "frequency_mismatch": Scene({"factor": 0.98}),
    "gravity_tilt": Scene(motion="turning"),
    "height_offset": Scene({"offset": 0.002}),
    "height_scale": Scene({"gain": 1.15}),
    "lever_arm": Scene({"x": 0.15, "y": 0.0, "z": 0.1}, motion="turning"),
    "pendulum_nonlinearity": Scene(base="3D-L"),
    "quadratic_damping": Scene({"beta": 0.4}),
    "quasi_static_modes": Scene({"kappa": 1.0}),
    "robot_dynamics": Scene({"frequency": 25.0, "damping_ratio": 0.5}),
    "second_mode": Scene({"damping_ratio": 0.01}),
    "sensor_lag": Scene({"time": 0.03}),
    "sensor_tilt": Scene({"e_x": 0.03, "e_y": -0.05}),
    "static_tilt": Scene({"roll": 0.03, "pitch": -0.02}),
    "surface_nonlinearity": Scene(base="3D-L"),
    "surface_tension": Scene(),
    "swirl_stiffening": Scene({"gamma": 2.0}),
    "time_offset": Scene({"tau": 0.05}),
    "vertical_acceleration": Scene(base="2D-NL"),
    "visible_arc": Scene({"centre": 0.0, "width": 2.0}),
    "yaw_coupling": Scene({"kappa": 0.4}, motion="turning"),
}


def main() -> int:
    """Draws the pictures of all modelled effects."""
    for name in EFFECTS:
        picture(name).write_text(drawn(name), encoding="utf-8")
    return 0


def picture(name: str) -> Path:
    """Returns the path of a modelled effect's picture."""
    return FOLDER / f"{name}.svg"


def part(effect: Effect) -> str:
    """Returns the generated Markdown part of a modelled effect's page."""
    stages = ", ".join(stage.value for stage in effect.stages)
    blocks = [
        f"$${effect.equation}$$",
        f"Acts on: {stages}. Source: {effect.source}.",
        only_for(effect),
        parameter_lines(effect),
        f"```yaml\n{use(effect)}\n```",
        f"![Heights with and without {effect.name}, and the difference]({effect.name}.svg)",
        f"*Base model {SCENES[effect.name].base}. {difference(effect.name)}*",
    ]
    return "\n\n".join(block for block in blocks if block) + "\n"


def only_for(effect: Effect) -> str:
    """Returns a sentence on the container shapes of an effect; empty if it applies to all."""
    kinds = " or a ".join(SECTIONS[section] for section in effect.sections)
    return f"Only for a {kinds}." if kinds else ""


def parameter_lines(effect: Effect) -> str:
    """Lists an effect's parameters, or says that there are none."""
    return "\n".join(map(parameter_line, effect.parameters)) or "It has no parameters."


def parameter_line(parameter: Parameter) -> str:
    """Formats one parameter of a modelled effect: name, unit, meaning, values."""
    unit = "" if parameter.unit == "1" else f" [{parameter.unit}]"
    values = [bounds(parameter)]
    for name, value in (("neutral", parameter.neutral), ("default", parameter.default)):
        values += [] if value is None else [f"{name} {value:g}"]
    values += [f"usually {usually(parameter)}"] if usually(parameter) else []
    return f"- `{parameter.name}`{unit}: {parameter.description}; {', '.join(values)}"


def use(effect: Effect) -> str:
    """Returns the lines of model.yaml that add an effect with its picture's parameters."""
    lines = ["effects:", f"  - name: {effect.name}"]
    lines += [f"    {key}: {value:g}" for key, value in SCENES[effect.name].parameters.items()]
    return "\n".join(lines)


def caption(name: str) -> str:
    """Returns the full caption of an effect's picture, which is kept in its file."""
    scene = SCENES[name]
    what = "Maximum over the wall" if scene.azimuth is None else "Height at the container's +x"
    moves = "there and back, with a lift"
    if scene.motion == "turning":
        moves += ", while the container yaws and tilts"
    return (
        f"*{what} over a motion {moves}; {described(name)} filled "
        f"{1e3 * CUP.fill_height:g} mm high, base model {scene.base}. {difference(name)}*"
    )


def difference(name: str) -> str:
    """Returns a sentence on how much an effect changes the heights of its picture."""
    _, plain, changed = heights(name)
    gap = 1e3 * (changed - plain)
    rms, largest = np.sqrt(np.mean(gap**2)), np.max(np.abs(gap))
    return f"Difference: RMS {rms:.2f} mm, largest {largest:.1f} mm."


def container(name: str) -> Cylinder | Rectangle:
    """Returns the container of an effect's picture: a cup, or a tank for effects of rectangles."""
    return CUP if EFFECTS[name].fits(CUP.section) else TANK


def described(name: str) -> str:
    """Describes the container in a modelled effect's picture in words."""
    if container(name) is CUP:
        return f"cup of {1e3 * CUP.radius:g} mm radius"
    return f"tank of {1e3 * TANK.width:g} mm × {1e3 * TANK.depth:g} mm"


def table() -> str:
    """Formats all modelled effects as one Markdown table."""
    rows = ["| effect | acts on | what | parameters |", "|---|---|---|---|"]
    for effect in EFFECTS.values():
        parameters = ", ".join(
            f"`{p.name}`" + (f" [{p.unit}]" if p.unit != "1" else "") for p in effect.parameters
        )
        stages = ", ".join(stage.value for stage in effect.stages)
        link = f"[`{effect.name}`]({effect.name}.md)"
        rows.append(f"| {link} | {stages} | {effect.meaning} | {parameters or '–'} |")
    return "\n".join(rows) + "\n"


@cache
def heights(name: str) -> tuple[Array, Array, Array]:
    """Simulates a motion; returns times [s] and heights without and with an effect [m]."""
    scene = SCENES[name]
    base = Model(container(name))
    if "3D" in scene.base:
        base = base.spatial()
    if "NL" in scene.base:
        base = base.nonlinear()
    for other, parameters in scene.others.items():
        base = base.with_effect(other, **parameters)
    inputs = motion(scene.motion)
    times = np.arange(inputs.t[0], inputs.t[-1], 1.0 / FRAMES)
    azimuths = None if scene.azimuth is None else [scene.azimuth]
    plain, changed = (
        predicted_heights(model, inputs, times, azimuths)[:, 0]
        for model in (base, base.with_effect(name, **scene.parameters))
    )
    return times, plain, changed


@cache
def motion(kind: str) -> Inputs:
    """Returns a motion of a cup: lifted, moved to two places and brought back, then at rest."""
    t = np.arange(0.0, 5.0, 1.0 / RATE)
    moves = (
        (0.3, 0.75, (0.25, 0.07, 0.15)),
        (1.3, 0.65, (0.03, -0.20, 0.05)),
        (2.2, 0.85, (-0.28, 0.13, -0.20)),
    )
    acceleration = np.zeros((len(t), 3))
    for start, duration, path in moves:
        acceleration += np.outer(leap((t - start) / duration, 2) / duration**2, path)
    if kind == "transfer":
        return Inputs(t, acceleration)
    yaw = 1.6 * leap((t - 0.3) / 1.6, 0) - 1.0 * leap((t - 2.2) / 0.8, 0)
    tilt = np.stack(
        [
            -0.15 * leap((t - 0.4) / 0.6, 0) + 0.15 * leap((t - 1.4) / 0.8, 0),
            0.12 * leap((t - 1.3) / 0.5, 0) - 0.12 * leap((t - 2.2) / 0.8, 0),
            np.zeros_like(t),
        ],
        axis=1,
    )
    turn = np.column_stack([np.zeros((len(t), 2)), yaw])
    attitude = Rotation.from_rotvec(tilt) * Rotation.from_rotvec(turn)
    steps = (attitude[:-1].inv() * attitude[1:]).as_rotvec() * RATE
    middles = 0.5 * (t[1:] + t[:-1])
    rates = np.column_stack([np.interp(t, middles, column) for column in steps.T])
    return Inputs(t, acceleration, attitude.as_quat(), rates)


def leap(share: Array, order: int) -> Array:
    """Returns a minimum-jerk move from 0 to 1 at relative times, or its second derivative."""
    s = np.clip(share, 0.0, 1.0)
    if order == 0:
        return s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    return 60.0 * s - 180.0 * s**2 + 120.0 * s**3


def drawn(name: str) -> str:
    """Draws the picture of a modelled effect as SVG, always with the same content."""
    times, plain, changed = heights(name)
    with context(STYLE, after_reset=True):
        figure = Figure(figsize=(6.6, 3.7), layout="constrained")
        FigureCanvasSVG(figure)
        top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=[2.0, 1.0])
        top.plot(times, 1e3 * plain, color="#8a8a8a", linestyle="--", label="without")
        top.plot(times, 1e3 * changed, color="#0b5fa5", linewidth=1.4, label=f"with {name}")
        top.set_ylabel("height [mm]")
        top.legend(loc="upper right", fontsize=8.0, framealpha=0.8)
        bottom.plot(times, 1e3 * (changed - plain), color="#b3400e", linewidth=1.2)
        bottom.set_ylabel("difference [mm]")
        bottom.set_xlabel("t [s]")
        bottom.set_xlim(0.0, 5.0)
        figure.align_ylabels()
        file = io.StringIO()
        figure.savefig(
            file,
            format="svg",
            facecolor="white",
            metadata={"Date": None, "Creator": None, "Description": caption(name)},
        )
    # Hundredths of a point are enough; a path is one line.
    text = re.sub(r"(\.\d\d)\d+", r"\1", file.getvalue())
    text = re.sub(r' d="[^"]*"', lambda path: re.sub(r"\s+", " ", path.group()), text)
    return re.sub(r"[ \t]+\n", "\n", text)


if __name__ == "__main__":
    sys.exit(main())
