"""Reads a group of joints from MoveIt's semantic robot description (SRDF)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from slosh_motion.inputs.robot import read_urdf
from slosh_plan.errors import SloshPlanError

_MOVING = ("revolute", "continuous", "prismatic")


class Group(NamedTuple):
    """A group of joints that MoveIt plans for; all others are held or carried along.

    Attributes:
        name: of the group.
        joints: that move by themselves, in the order of the SRDF.
    """

    name: str
    joints: tuple[str, ...]


class _Joint(NamedTuple):
    """A joint of the robot description: its name, its parent link, and whether it is driven."""

    name: str
    parent: str
    driven: bool


def read_group(path: str | Path, name: str, urdf: str) -> Group:
    """Reads the joints of a planning group from an SRDF file.

    Joints, links, chains and groups in a group count as MoveIt counts them: a link stands for the
    joint above it, a chain for all joints between its links. Fixed joints, and those that mimic
    others, do not count.

    Args:
        path: SRDF file, or xacro of one.
        name: of the group.
        urdf: text of the robot description.

    Raises:
        SloshEstimatorError: the file cannot be read.
        SloshPlanError: no SRDF, no such group, a group without joints, or one with names that the
            robot description does not have.
    """
    text = read_urdf(path)
    try:
        root = ElementTree.fromstring(text)
        above = _joints(urdf)
    except ElementTree.ParseError as error:
        raise SloshPlanError(f"{path}: is no SRDF: {error}") from None
    groups = {one.get("name", ""): one for one in root.findall("group")}
    passive = {one.get("name", "") for one in root.findall("passive_joint")}
    reader = _Reader(str(path), groups, above)
    found = dict.fromkeys(one.name for one in reader.joints(name, ()) if one.driven)
    joints = tuple(joint for joint in found if joint not in passive)
    if not joints:
        raise SloshPlanError(f"{path}: the group {name!r} has no joint that moves")
    return Group(name, joints)


def _joints(urdf: str) -> dict[str, _Joint]:
    """Returns the joint above each link, by the link's name."""
    found = {}
    for joint in ElementTree.fromstring(urdf).iter("joint"):
        parent, child = joint.find("parent"), joint.find("child")
        if parent is not None and child is not None:
            driven = joint.get("type") in _MOVING and joint.find("mimic") is None
            found[child.get("link", "")] = _Joint(
                joint.get("name", ""), parent.get("link", ""), driven
            )
    return found


class _Reader:
    """Finds the joints of the groups in one SRDF file."""

    def __init__(
        self, path: str, groups: Mapping[str, ElementTree.Element], above: Mapping[str, _Joint]
    ) -> None:
        self._path, self._groups, self._above = path, groups, above
        self._by_name = {joint.name: joint for joint in above.values()}

    def joints(self, name: str, within: tuple[str, ...]) -> Iterator[_Joint]:
        """Yields the joints of a group; `within` names the groups that contain this group."""
        if name not in self._groups:
            known = ", ".join(self._groups) or "none"
            raise SloshPlanError(f"{self._path}: no group {name!r:.60} (known: {known:.200})")
        if name in within:
            raise SloshPlanError(f"{self._path}: the group {name!r} contains itself")
        for part in self._groups[name]:
            what, own = part.tag, part.get("name", "")
            if what == "group":
                yield from self.joints(own, (*within, name))
            elif what == "chain":
                yield from self._chain(name, part.get("base_link", ""), part.get("tip_link", ""))
            elif what == "joint":
                if own not in self._by_name:
                    raise self._unknown(name, "joint", own)
                yield self._by_name[own]
            elif what == "link" and own in self._above:
                yield self._above[own]

    def _chain(self, group: str, base: str, tip: str) -> list[_Joint]:
        """Returns the joints from one link down to another."""
        found, link = [], tip
        while link != base:
            joint = self._above.get(link)
            if joint is None or joint in found:
                raise self._unknown(group, "chain", f"{base} to {tip}")
            found.append(joint)
            link = joint.parent
        return found[::-1]

    def _unknown(self, group: str, what: str, name: str) -> SloshPlanError:
        return SloshPlanError(
            f"{self._path}: group {group!r}: the robot's description has no {what} {name!r:.80}"
        )
