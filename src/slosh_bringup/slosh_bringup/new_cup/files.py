"""The text of the first `model.yaml`, `cell.yaml` and `camera.yaml` of a cup."""

from __future__ import annotations

import shlex
from pathlib import Path

from slosh_bringup.new_cup.cup import NewCup
from slosh_model.effects.registry import find_effect
from slosh_model.model import EffectUse

MODEL, CELL, CAMERA = "model.yaml", "cell.yaml", "camera.yaml"


def texts_of(cup: NewCup, folder: Path) -> dict[str, str]:
    """The files' texts by their names; commands in them name `folder` as it was given."""
    texts = {MODEL: _model(cup), CELL: _cell(cup, folder)}
    return {**texts, CAMERA: _camera(cup, folder)} if cup.camera else texts


def next_steps(cup: NewCup, folder: Path) -> list[str]:
    """The commands that make the camera's calibration and start the cell, in their order."""
    names = ("ost.yaml", MODEL, CAMERA, CELL)
    lens, model, camera, cell = (_word(folder / name) for name in names)
    steps = [
        "slosh intrinsics --board 9x6 --square 0.025 --print-board board.pdf",
        f"slosh intrinsics IMAGES --board 9x6 --square 0.025 -o {lens}",
        f"{_calibrate(cup, lens, model)} -o {camera}",
        f"slosh cell --config {cell}",
    ]
    if not cup.camera:
        return steps[-1:]
    return steps if cup.is_round else steps[2:]


def _word(path: Path) -> str:
    """A path as a shell takes it, in one line."""
    return shlex.quote(str(path)) if str(path).isprintable() else path.name


def _calibrate(cup: NewCup, lens: str, model: str) -> str:
    if not cup.is_round:
        return f"slosh calibrate STILL --page clicks.html --model {model}"
    wall = "" if cup.wall is None else f" --wall {cup.wall:g}"
    return f"slosh calibrate STILL --camera {lens} --model {model}{wall}"


def _container(cup: NewCup, *, wall: bool) -> str:
    """The container's keys, a line each."""
    words = {
        "radius": "inner radius [m]",
        "width": "inner width, along the container's x [m]",
        "depth": "inner depth, along its y [m]",
    }
    rows = [(key, value, words[key]) for key, value in cup.lengths.items()]
    rows.append(("fill_height", cup.fill_height, "of the liquid at rest, above the floor [m]"))
    lines = [f"  shape: {cup.shape}"]
    lines += [f"  {key}: {value!r}  # {meaning}" for key, value, meaning in rows]
    rim = "of the rim, above the floor [m]: beyond it liquid spills"
    if cup.rim_height is None:
        lines.append(f"  # rim_height: 0.12  # {rim}")
    else:
        lines.append(f"  rim_height: {cup.rim_height!r}  # {rim}")
    if wall:
        lines.append(f"  wall_thickness: {cup.wall or 0.0!r}  # [m]; it refracts light")
        lines.append("  wall_refractive_index: 1.49  # acrylic glass; 1.47 borosilicate")
    return "\n".join(lines)


def _model(cup: NewCup) -> str:
    effects = "".join(_effect(use) for use in cup.model.effects)
    liquid = cup.liquid
    if not cup.is_round:
        effects += "  # - name: pendulum_nonlinearity  # for large surface angles\n"
    return f"""\
# The container and its liquid: used by estimator, replay, planning and discovery.
# All values are in SI units; every key is explained in docs/files.md.
container:
{_container(cup, wall=False)}
liquid:
  density: {liquid.density!r}  # [kg/m3]
  kinematic_viscosity: {liquid.kinematic_viscosity!r}  # [m2/s]; water 1e-6, milk 2e-6, oil 7e-5
# auto: by formula. `slosh identify` measures it; it determines how long waves last.
damping_ratio: auto
# Effects added to the planar linear model; `slosh discover` finds missing ones.
effects:
{effects}"""


def _effect(use: EffectUse) -> str:
    """An effect's lines."""
    lines = [f"  - name: {use.name}  # {find_effect(use.name).title}"]
    lines += [f"    {name}: {value!r}" for name, value in use.parameters.items()]
    return "\n".join(lines) + "\n"


def _cell(cup: NewCup, folder: Path) -> str:
    images = "#   camera/image_raw: /camera/image_raw\n" if cup.camera else ""
    camera = (
        f"calibration: {CAMERA}"
        if cup.camera
        else "# Only the estimate is monitored. With a camera: `calibration: camera.yaml`.\n"
        "camera: none"
    )
    return f"""\
# Configuration of a running cell: slosh cell --config {_word(folder / CELL)}
# Paths are relative to this file.
model: {MODEL}
{camera}
# Namespace of all nodes and topics.
namespace: {cup.namespace}
# ROS parameters that differ from the nodes' defaults, such as the limits (docs/robot.md).
# parameters: parameters.yaml
# Where the robot's topics have other names: relative topic -> the robot's topic.
# remap:
#   accel: /arm/tcp_acceleration
{images}"""


def _camera(cup: NewCup, folder: Path) -> str:
    width, height = cup.image_size
    steps = "\n".join(f"#   {step}" for step in next_steps(cup, folder)[:-1])
    return f"""\
# The camera is not calibrated yet: the matrix is zero, and `pose` and `still_image` are missing.
# STILL is an image of the liquid at rest. These commands overwrite this file (docs/start.md):
{steps}
image_width: {width}
image_height: {height}
camera_name: camera
camera_matrix: {{rows: 3, cols: 3, data: [0, 0, 0, 0, 0, 0, 0, 0, 1]}}
distortion_model: plumb_bob
distortion_coefficients: {{rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}}
container:
{_container(cup, wall=True)}
"""
