"""Text of the first configuration files of a user's new cup."""

from __future__ import annotations

import json
import math
import re
import shlex
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from pathlib import Path
from typing import Any, cast

from slosh_base.files import file_version
from slosh_bringup.errors import SloshBringupError
from slosh_model.containers import SHAPES, CupLengths
from slosh_model.effects.registry import find_effect
from slosh_model.liquid import Liquid
from slosh_model.model import EffectUse, Model

MODEL, CELL, CAMERA, PROFILE = "model.yaml", "cell.yaml", "camera.yaml", "profile.csv"
CURVED = 5
"""Points of a profile from which on a smooth curve goes through them."""

_LENGTHS = {"mm": 1e-3, "cm": 1e-2}

_NAMESPACE = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")


def texts_of(cup: NewCup, folder: Path) -> dict[str, str]:
    """Returns the texts of the cup's files by file name."""
    texts = {MODEL: _model(cup), CELL: _cell(cup, folder)}
    if cup.profile:
        texts[PROFILE] = "r,z\n" + "".join(f"{r!r},{z!r}\n" for r, z in cup.profile)
    return {**texts, CAMERA: _camera(cup, folder)} if cup.camera else texts


def next_steps(cup: NewCup, folder: Path) -> list[str]:
    """Returns the commands that calibrate the camera and start the cell, in order."""
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
    """Quotes a path for use in a shell command."""
    return shlex.quote(str(path)) if str(path).isprintable() else path.name


def _calibrate(cup: NewCup, lens: str, model: str) -> str:
    if not cup.is_round:
        return f"slosh calibrate STILL --page clicks.html --model {model}"
    wall = "" if cup.wall is None else f" --wall {cup.wall:g}"
    return f"slosh calibrate STILL --camera {lens} --model {model}{wall}"


def _container(cup: NewCup, *, wall: bool) -> str:
    """Returns the lines of a YAML file that describe the container."""
    words = {
        "radius": "inner radius [m]",
        "width": "inner width, along the container's x [m]",
        "depth": "inner depth, along its y [m]",
    }
    rows = [(key, value, words.get(key, "inner [m]")) for key, value in cup.lengths.items()]
    rows.append(("fill_height", cup.fill_height, "of the liquid at rest, above the floor [m]"))
    lines = [f"  shape: {cup.shape}"]
    if cup.profile:
        lines.append(f"  profile: {PROFILE}  # inner wall from the floor's centre to the rim [m]")
        lines.append(
            f"  smooth: {'true' if cup.smooth else 'false'}  # a curve, or straight lines"
        )
    lines += [f"  {key}: {value!r}  # {meaning}" for key, value, meaning in rows]
    rim = "of the rim, above the floor [m]: beyond it liquid spills"
    if cup.rim_height is None and cup.by_contour and cup.model.container.rim_height:
        pass  # the contour's end
    elif cup.rim_height is None:
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
    if cup.model.container.cornered and not cup.by_contour:
        effects += "  # - name: pendulum_nonlinearity  # for large surface angles\n"
    return f"""\
# The container and its liquid: used by estimator, replay, planning and discovery.
# All values are in SI units; every key is explained in docs/files.md.
version: {file_version.MODEL.current}
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
    """Returns the lines of model.yaml that describe one modelled effect."""
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
version: {file_version.CELL.current}
model: {MODEL}
{camera}
# Namespace of all nodes and topics.
namespace: {cup.namespace}
# ROS parameters that differ from the nodes' defaults, such as the limits (docs/robot.md).
# parameters: parameters.yaml
# Where the robot's topics have other names: relative topic -> the robot's topic.
# remap:
#   accel: /arm/tcp_acceleration
{images}# What drives the models (docs/robot.md): accel, imu, pose, joints, odometry, twist or tf.
{_drives(cup)}"""


def _drives(cup: NewCup) -> str:
    """Returns the lines of cell.yaml that describe the robot."""
    if cup.urdf is None:
        return "# input: joints\n# urdf: robot.urdf\n# tool_frame: tool0\n"
    urdf, tool = json.dumps(str(cup.urdf.absolute())), json.dumps(cup.tool_frame)
    return f"input: joints\nurdf: {urdf}\ntool_frame: {tool}\n"


def _camera(cup: NewCup, folder: Path) -> str:
    width, height = cup.image_size
    steps = "\n".join(f"#   {step}" for step in next_steps(cup, folder)[:-1])
    return f"""\
# The camera is not calibrated yet: the matrix is zero, and `pose` and `still_image` are missing.
# STILL is an image of the liquid at rest. These commands overwrite this file (docs/start.md):
{steps}
version: {file_version.CAMERA.current}
image_width: {width}
image_height: {height}
camera_name: camera
camera_matrix: {{rows: 3, cols: 3, data: [0, 0, 0, 0, 0, 0, 0, 0, 1]}}
distortion_model: plumb_bob
distortion_coefficients: {{rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}}
container:
{_container(cup, wall=True)}
"""


@dataclass(frozen=True, slots=True)
class QuantityKind:
    """Allowed range and accepted units of one kind of quantity.

    Attributes:
        words: what it is, for people.
        unit: SI.
        least: smallest value that is taken.
        most: largest value that is taken.
        typical: of two units that a refused value may be in, the one nearer to this is proposed.
        others: units that people type by mistake, in SI.
        or_none: 0 is taken, too: there is none.
    """

    words: str
    unit: str
    least: float
    most: float
    typical: float
    others: Mapping[str, float]
    or_none: bool = False

    def check(self, name: str, value: float) -> float:
        """Returns the value if it is in the allowed range, otherwise raises an error.

        Args:
            name: how the refusal calls it.
            value: in SI.

        Raises:
            SloshBringupError: it is outside the limits; with the unit that it looks like.
        """
        if value == 0.0 and self.or_none:
            return value
        if math.isfinite(value) and self.least <= value <= self.most:
            return value
        told = f"{name} = {value:g} {self.unit}"
        guess = self._guess(value)
        if guess is not None:
            raise SloshBringupError(
                f"{told}: did you mean {value * self.others[guess]:g} ({value:g} {guess})?"
            )
        raise SloshBringupError(f"{told}: must be {self.least:g} to {self.most:g} {self.unit}")

    def _guess(self, value: float) -> str | None:
        """Guesses in which unit a value out of range was meant; None if no unit fits."""
        likely = [
            unit for unit, size in self.others.items() if self.least <= value * size <= self.most
        ]
        return min(
            likely, key=lambda unit: self._distance(value * self.others[unit]), default=None
        )

    def _distance(self, value: float) -> float:
        return abs(math.log(value / self.typical)) if value > 0.0 else math.inf


def _length(
    words: str, least: float, most: float, typical: float, *, or_none: bool = False
) -> QuantityKind:
    return QuantityKind(words, "m", least, most, typical, _LENGTHS, or_none)


# From a test tube to a tank on wheels.
LENGTH = _length("inner length", 1e-4, 4.0, 0.05)
"""Of a container by its contour, whatever it is called."""
QUANTITIES: Mapping[str, QuantityKind] = {
    "radius": _length("inner radius", 2e-3, 2.0, 0.05),
    "diameter": _length("inner diameter", 4e-3, 4.0, 0.1),
    "width": _length("inner width along x", 4e-3, 4.0, 0.1),
    "depth": _length("inner depth along y", 4e-3, 4.0, 0.1),
    "fill_height": _length("height of the liquid at rest above the inner floor", 2e-3, 4.0, 0.07),
    "rim_height": _length("height of the rim above the inner floor", 2e-3, 4.0, 0.12),
    "wall": _length("thickness of the wall", 1e-5, 0.05, 2e-3, or_none=True),
    "density": QuantityKind("density", "kg/m3", 100.0, 2e4, 1e3, {"g/cm3": 1e3}),
    "viscosity": QuantityKind(
        "kinematic viscosity", "m2/s", 1e-8, 0.02, 1e-6, {"mm2/s": 1e-6, "cm2/s": 1e-4}
    ),
}
"""By the option's name."""


@dataclass(frozen=True, slots=True)
class NewCup:
    """Description of a new cup, from which its first files are made.

    Attributes:
        lengths: inner dimensions by their key in the files: `radius`, or `width` and `depth` [m].
        fill_height: height of the liquid at rest above the inner floor [m].
        liquid: what is in it.
        rim_height: above the inner floor [m]; None: unknown.
        wall: thickness [m]; None: unknown.
        namespace: of the nodes.
        image_size: width and height of the camera's images [px].
        camera: whether the cell has one.
        by_contour: the shape of one that is neither cylinder nor rectangle; empty: it is.
        urdf: the robot's description, by whose joints the cup is moved; None: it is not.
        tool_frame: link of the robot that is the cup.
        profile: (r, z) of a body of revolution by its points [m]; empty: another shape.
    """

    lengths: dict[str, float]
    fill_height: float
    liquid: Liquid
    rim_height: float | None
    wall: float | None
    namespace: str
    image_size: tuple[int, int]
    camera: bool = True
    by_contour: str = ""
    urdf: Path | None = None
    tool_frame: str = ""
    profile: tuple[tuple[float, float], ...] = ()

    def __post_init__(self) -> None:
        """Raises an error for a rim below the liquid or an invalid namespace."""
        if self.rim_height is not None and self.rim_height <= self.fill_height:
            raise SloshBringupError(
                f"rim_height = {self.rim_height:g} m: must lie above the liquid, whose "
                f"fill_height is {self.fill_height:g} m"
            )
        if not _NAMESPACE.fullmatch(self.namespace):
            raise SloshBringupError(
                f"namespace = {self.namespace!r}: must be names after slashes, such as /slosh"
            )

    @property
    def model(self) -> Model:
        """Returns the first model of the cup, before any identification."""
        heights = {"fill_height": self.fill_height, "rim_height": self.rim_height}
        if self.by_contour:
            made: Any = SHAPES[self.by_contour]
            points = {"profile": self.profile, "smooth": self.smooth} if self.profile else {}
            return Model(made(**self.lengths, **points, **heights), self.liquid).spatial()
        return Model.from_cup(liquid=self.liquid, **cast(CupLengths, {**self.lengths, **heights}))

    @property
    def smooth(self) -> bool:
        """Whether the cup's wall is a smooth curve through its points."""
        return len(self.profile) >= CURVED

    @property
    def is_round(self) -> bool:
        """Whether the cup is a cylinder."""
        return "radius" in self.lengths and not self.by_contour

    @property
    def shape(self) -> str:
        """Name of the container shape in the files."""
        if self.by_contour:
            return self.by_contour
        return "cylinder" if self.is_round else "rectangle"


def lengths_of(shape: str) -> tuple[str, ...]:
    """Returns the dimensions that a contour shape needs besides the fill height.

    Raises:
        SloshBringupError: no such shape, or one whose contour takes more than lengths.
    """
    known = {
        name: [item for item in fields(cast(Any, kind)) if item.name not in _HEIGHTS]
        for name, kind in SHAPES.items()
        if name not in _ALREADY
    }
    simple = [
        name for name, items in known.items() if not any("kind" in i.metadata for i in items)
    ]
    if shape not in simple:
        more = f"; the points of a {shape} are written into model.yaml by hand" * (shape in known)
        raise SloshBringupError(f"--shape {shape!r:.40} (known: {', '.join(simple)}){more}")
    return tuple(
        item.name for item in known[shape]
        if item.metadata.get("asked", item.default is MISSING)
    )  # fmt: skip


_HEIGHTS = ("fill_height", "rim_height", "table")
_ALREADY = ("cylinder", "rectangle")
