"""Forward kinematics of the robot that carries the container (URDF, Pinocchio)."""

from __future__ import annotations

import importlib
import importlib.util
import math
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

from slosh_base.files.bounded_text import read_text
from slosh_base.files.errors import TextFileError
from slosh_base.files.quiet_decoders import quiet_decoders
from slosh_motion.errors import SloshMotionError
from slosh_motion.inputs.frames import Quaternion, Vector
from slosh_motion.tuning import TUNING

HOW_TO_GET = (
    "a motion of joints needs Pinocchio, which is not installed "
    "(pip install -r requirements/joints.txt)"
)
SYSTEM_LIBRARY = "Debian and Ubuntu: `apt install libgomp1`"
"""What Pinocchio's wheel needs of the system; a compiler brings it."""
LONGEST = 10_000_000
"""Bytes of a description; a robot with its cell has some hundred kilobytes."""
_XACRO = "xacro:"
"""Begins the names of its elements; expanded files still name its namespace."""
_NO_ELEMENTS = re.compile(r"<!--.*?(?:-->|\Z)|<!\[CDATA\[.*?(?:\]\]>|\Z)", re.DOTALL)


def available() -> bool:
    """Returns whether Pinocchio is installed."""
    return importlib.util.find_spec("pinocchio") is not None


class Mimic(NamedTuple):
    """A joint that follows another one: multiplier · position + offset [rad or m]."""

    joint: str
    multiplier: float = 1.0
    offset: float = 0.0


class Robot:
    """A robot that carries the container, for forward kinematics from joint positions.

    Args:
        tool_frame: link that is the container, or carries it.
        world: link that is the world, z up; another name: the root of the description is it.
        name: of the description, for messages.

    Attributes:
        carrying: names of the joints that carry the link, from the root on; one that mimics
            another counts as that one.
        beyond: which position was far beyond its joint's limits, in a line; empty: none was.

    Raises:
        SloshMotionError: Pinocchio is missing, no such description, no such link, or a joint
            whose position is no number. As `error`, where that is given.
    """

    def __init__(
        self,
        urdf: str,
        tool_frame: str,
        world: str = "",
        name: str = "URDF",
        error: Callable[[str], ValueError] = SloshMotionError,
    ) -> None:
        if not available():
            raise error(HOW_TO_GET)
        try:
            self._pin: Any = importlib.import_module("pinocchio")
        except ImportError as cause:
            raise error(f"Pinocchio cannot be loaded: {cause}. {SYSTEM_LIBRARY}") from None
        try:
            urdf = _whole(urdf)
            with quiet_decoders():
                self._model = self._pin.buildModelFromXML(urdf)
            self._mimics = _mimics(urdf)
        except (ValueError, RuntimeError, IndexError, ElementTree.ParseError) as cause:
            reason = " ".join(str(cause).split()) or "cannot be read"
            raise error(f"{name}: is not a robot description: {reason[:200]}") from None
        links = [one.name for one in self._model.frames if one.type == self._pin.FrameType.BODY]
        if tool_frame not in links:
            known = ", ".join(links)
            raise error(f"{name}: no link {tool_frame!r} (it has {known:.200})")
        self._frame = self._link(tool_frame)
        self._name = name
        self._data = self._model.createData()
        self._rest = self._pin.neutral(self._model)
        self._placed = self._model.frames[self._frame].placement
        self._parent = self._model.frames[self._frame].parentJoint
        self._carriers = [number for number in self._model.supports[self._parent] if number]
        self._movers = [self._mover(number, error) for number in self._carriers]
        self.carrying = tuple(dict.fromkeys(mover.joint for mover in self._movers))
        self.beyond = ""
        self._world = self._fixed(world, error) if world in links else None

    def pose(self, positions: Mapping[str, float]) -> tuple[Vector, Quaternion]:
        """Returns position [m] and attitude (x, y, z, w) of the container's link in the world.

        Args:
            positions: of at least the joints that carry it [rad or m].
        """
        pin, q = self._pin, self._rest.copy()
        for mover in self._movers:
            value = mover.put(q, positions[mover.joint])
            if not mover.low <= value <= mover.high:
                self.beyond = (
                    f"joint {mover.joint} = {value:.4g} is far beyond its limits in {self._name}: "
                    "positions must be in rad and m"
                )
        pin.forwardKinematics(self._model, self._data, q)
        found = self._data.oMi[self._parent] * self._placed
        if self._world is not None:
            found = self._world * found
        x, y, z = found.translation.tolist()
        qx, qy, qz, qw = pin.Quaternion(found.rotation).coeffs().tolist()
        return (x, y, z), (qx, qy, qz, qw)

    def _mover(self, number: int, error: Callable[[str], ValueError]) -> Mover:
        joint, name = self._model.joints[number], self._model.names[number]
        if joint.nv != 1:
            raise error(
                f"{self._name}: joint {name!r} carries the container and has {joint.nv} degrees "
                "of freedom; a joint state gives one number: use input tf or pose"
            )
        followed, multiplier, offset, seen = name, 1.0, 0.0, {name}
        while followed in self._mimics:
            mimic = self._mimics[followed]
            offset += multiplier * mimic.offset
            multiplier *= mimic.multiplier
            followed = mimic.joint
            if followed in seen:
                raise error(f"{self._name}: joint {name!r} mimics itself")
            seen.add(followed)
        low, high = -math.inf, math.inf
        if joint.nq == 1:
            low = float(self._model.lowerPositionLimit[joint.idx_q]) - TUNING.beyond_limits
            high = float(self._model.upperPositionLimit[joint.idx_q]) + TUNING.beyond_limits
        return Mover(
            followed, joint.idx_q, joint.idx_v, joint.nq == 2, multiplier, offset, low, high
        )

    def _link(self, name: str) -> int:
        """Returns the number of a link's frame, also where a joint has the same name."""
        return int(self._model.getFrameId(name, self._pin.FrameType.BODY))

    def _fixed(self, world: str, error: Callable[[str], ValueError]) -> Any:
        """Returns the transform from the URDF's root to the world; None if both are the same."""
        frame = self._model.frames[self._link(world)]
        if frame.parentJoint:
            raise error(f"{self._name}: link {world!r} moves, so it cannot be the world")
        found = frame.placement.inverse()
        return None if found.isIdentity() else found


class Mover(NamedTuple):
    """A movable joint in the robot's description (URDF).

    Attributes:
        joint: whose position it follows, its own or that of one that it mimics: its own position
            is multiplier · position + offset [rad or m].
        at, rate_at: where its position and its velocity are kept.
        turns: whether it has no stops: then it is kept as cosine and sine.
        low, high: positions beyond these are none.
    """

    joint: str
    at: int
    rate_at: int
    turns: bool
    multiplier: float
    offset: float
    low: float
    high: float

    def put(self, q: Any, position: float) -> float:
        """Writes the joint's position into a configuration vector; returns the position."""
        value = self.multiplier * position + self.offset
        if self.turns:
            q[self.at], q[self.at + 1] = math.cos(value), math.sin(value)
        else:
            q[self.at] = value
        return value


def read_urdf(path: str | Path) -> str:
    """Reads a robot description: URDF, or xacro if it is installed.

    Raises:
        SloshMotionError: the file cannot be read; one line with what to do.
    """
    try:
        text = read_text(Path(path), LONGEST)
    except TextFileError as error:
        raise SloshMotionError(str(error)) from None
    if not (str(path).endswith(".xacro") or f"<{_XACRO}" in _NO_ELEMENTS.sub("", text)):
        return text
    if importlib.util.find_spec("xacro") is None:
        raise SloshMotionError(
            f"{path}: is xacro, and the package xacro is not installed; run "
            f"`xacro {path} > robot.urdf` on a machine that has it, and give robot.urdf"
        )
    try:
        return str(importlib.import_module("xacro").process_file(str(path)).toxml())
    except Exception as error:  # xacro lets through whatever its expressions raise
        reason = " ".join(str(error).split())
        raise SloshMotionError(f"{path}: xacro cannot be expanded: {reason:.200}") from None


def _whole(urdf: str) -> str:
    """Adds the root element `robot` that a robot description made of included files may lack.

    Raises:
        ValueError: it is none.
        xml.etree.ElementTree.ParseError: it is no XML.
    """
    body = re.sub(r"^\s*<\?xml.*?\?>", "", urdf, count=1, flags=re.DOTALL)
    root = ElementTree.fromstring(f"<robot name='robot'>{body}</robot>")
    inner = root.find("robot")
    if inner is None and root.find("link") is None:
        raise ValueError("it has no element <robot>, and no <link>")
    return f"<robot name='robot'>{body}</robot>" if inner is None else body


def _mimics(urdf: str) -> dict[str, Mimic]:
    """Returns multiplier and offset of each joint that follows another joint, by name."""
    found = {}
    for joint in ElementTree.fromstring(urdf).iter("joint"):
        mimic = joint.find("mimic")
        if mimic is not None:
            found[joint.get("name", "")] = Mimic(
                mimic.get("joint", ""),
                float(mimic.get("multiplier", 1.0)),
                float(mimic.get("offset", 0.0)),
            )
    return found
