"""A tray that carries several containers, each with its own place and limit."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from slosh_base.files.bounded_text import read_text
from slosh_base.files.errors import TextFileError, YamlError
from slosh_base.files.file_version import MODEL, parse_versioned
from slosh_base.files.yaml_document import YamlDocument, format_yaml, shown
from slosh_base.types import Array
from slosh_model.errors import ModelFileError, SloshModelError
from slosh_model.model import Model
from slosh_model.model_text import LONGEST, format_model, parse_model, read_model
from slosh_model.standing import BOUNDS, Standing

MOST = 16
"""Containers of a tray, at most."""
ARM = "lever_arm"
TRAY = "tray"
"""Name of a tray's text among the recorded settings of a node."""
FARTHEST = 2.0
"""Largest coordinate of a place [m]."""
_KEY = "containers"
HIGHEST_LIMIT = 10.0
"""Greatest limit of a container's heights [m], in files, requests and recordings alike."""
_KEYS = ("name", "model", "place", "limit", "standing", "empty")
_NAME = re.compile(r"[\w-][\w.-]{0,39}")


@dataclass(frozen=True, slots=True)
class TrayContainer:
    """One container on a tray: name, model, position and limit.

    Attributes:
        name: of the container.
        model: its own.
        place: centre of its still surface in the tray's frame [m].
        limit: of its height [m]; NaN: none of its own.
        standing: how it stands on the tray; None: it is held.
        empty: whether its place is empty; the model is that of the last container there.
    """

    name: str
    model: Model
    place: tuple[float, float, float] = (0.0, 0.0, 0.0)
    limit: float = math.nan
    standing: Standing | None = None
    empty: bool = False

    @property
    def placed(self) -> Model:
        """The container's model driven by the tray's motion, with a lever arm to its place."""
        own = next((use.parameters for use in self.model.effects if use.name == ARM), None)
        arm = dict(zip("xyz", self.place, strict=True))
        if own is not None:
            arm = {axis: value + own[axis] for axis, value in arm.items()}
        elif not any(self.place):
            return self.model
        return self.model.with_effect(ARM, **arm)

    @property
    def bound(self) -> float:
        """Lower one of height limit and rim above the still level [m]; infinite without both."""
        rim = self.model.container.freeboard
        return float(np.fmin(np.fmin(self.limit, math.inf), math.inf if rim is None else rim))


@dataclass(frozen=True)
class Tray:
    """A tray with several containers, or a single container without a tray.

    Attributes:
        containers: at least one; of a plain model that alone, at the frame's origin.
    """

    containers: tuple[TrayContainer, ...]

    @property
    def is_tray(self) -> bool:
        """Whether this is a real tray, not a single container given by a model."""
        return bool(self.first.name)

    def of(self, changed: Callable[[Model], Model]) -> Tray:
        """Returns the tray with each container's model changed by a function."""
        return Tray(tuple(replace(one, model=changed(one.model)) for one in self.containers))

    def with_container(self, index: int, container: TrayContainer) -> Tray:
        """Returns the tray with the container at an index (from 0) replaced."""
        listed = list(self.containers)
        listed[index] = container
        return Tray(tuple(listed))

    @property
    def present(self) -> tuple[TrayContainer, ...]:
        """The containers that are on the tray, without empty places."""
        return tuple(one for one in self.containers if not one.empty)

    @property
    def first(self) -> TrayContainer:
        """The first container, which is the one that the camera observes."""
        return self.containers[0]

    @property
    def turning(self) -> TrayContainer:
        """First container whose liquid rotates with it, as in a box; else the first container."""
        boxes = (one for one in self.present if one.model.container.follows_yaw)
        return next(boxes, self.first)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the containers on the tray."""
        return tuple(one.name for one in self.containers)

    @cached_property
    def bounds(self) -> Array:
        """Greatest allowed heights (N,) [m]; 1 m for containers without limit and rim height."""
        bounds = np.array([one.bound for one in self.containers])
        return np.where(np.isfinite(bounds), bounds, 1.0)

    def worst(self, heights: Array) -> int:
        """Returns the index of the container nearest to its limit, or farthest above it.

        Args:
            heights: (N,) [m]; NaN: unknown.
        """
        return int(np.argmax(np.nan_to_num(np.asarray(heights) / self.bounds, nan=-1.0)))


def read_tray(path: str | Path) -> Tray:
    """Reads a tray from a file, or a single model as a tray with one container.

    Raises:
        ModelFileError: the file is no regular file, too large, or not readable text.
        SloshModelError: its content is neither; the text names the file, the line and the key.
    """
    if not str(path):
        raise ModelFileError("model: no file given; name a model.yaml or a tray.yaml")
    try:
        text = read_text(path, LONGEST)
    except TextFileError as error:
        raise ModelFileError(str(error)) from None
    return parse_tray(text, str(path))


def parse_tray(text: str, source: str = "tray.yaml") -> Tray:
    """Parses a tray from YAML text, or a single model as a tray with one container.

    Args:
        text: YAML; a tray's has the key `containers`, a list of mappings with name, model (a path
            relative to the source, or a model's keys), place, limit and standing.
        source: how errors name it.

    Raises:
        SloshModelError: one line with the source, the line, the key and the value.
    """
    try:
        document = parse_versioned(text, source, MODEL, LONGEST)
    except YamlError as error:
        raise SloshModelError(str(error)) from None
    value = document.value
    if not isinstance(value, dict) or _KEY not in value:
        return Tray((TrayContainer("", parse_model(text, source)),))
    listed = value[_KEY]
    if set(value) != {_KEY}:
        other = next(key for key in value if key != _KEY)
        raise SloshModelError(f"{document.where(other)}: unknown key {shown(other)} in a tray")
    if not isinstance(listed, list) or not 1 <= len(listed) <= MOST:
        raise SloshModelError(
            f"{document.where(_KEY)}: {_KEY} must be a list of 1 to {MOST} containers"
        )
    tray = Tray(tuple(_container(document, index) for index in range(len(listed))))
    for index, name in enumerate(tray.names):
        if name in tray.names[:index]:
            raise SloshModelError(f"{document.where(_KEY, index)}: name {name} is there twice")
    return tray


def format_tray(tray: Tray) -> str:
    """Formats a tray as text, with its models; `parse_tray` returns an equal tray."""
    listed = []
    for one in tray.containers:
        entry: dict[str, Any] = {"name": one.name, "place": list(one.place)}
        if not math.isnan(one.limit):
            entry["limit"] = one.limit
        if one.standing is not None:
            entry["standing"] = asdict(one.standing)
        if one.empty:
            entry["empty"] = True
        entry["model"] = parse_versioned(format_model(one.model), "model", MODEL).value
        listed.append(entry)
    document = MODEL.versioned({_KEY: listed})
    return format_yaml(document, sort_keys=False, default_flow_style=None)


def _container(document: YamlDocument, index: int) -> TrayContainer:
    entry, path = document.value[_KEY][index], (_KEY, index)
    if not isinstance(entry, dict):
        raise SloshModelError(f"{document.where(*path)}: must be a mapping, not {shown(entry)}")
    for key in entry:
        if key not in _KEYS:
            raise SloshModelError(
                f"{document.where(*path, key)}: unknown key {shown(key)} (known: "
                f"{', '.join(_KEYS)})"
            )
    name = entry.get("name")
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise SloshModelError(
            f"{document.where(*path)}: name = {shown(name)} must be letters, digits, '_', '-', '.'"
        )
    empty = entry.get("empty", False)
    if not isinstance(empty, bool):
        raise SloshModelError(
            f"{document.where(*path)}: empty = {shown(empty)} must be true or false"
        )
    return TrayContainer(
        name, _model(document, index, entry), _place(document, index, entry),
        _limit(document, index, entry), _standing(document, index, entry), empty,
    )  # fmt: skip


def _model(document: YamlDocument, index: int, entry: Mapping[str, Any]) -> Model:
    given = entry.get("model")
    if isinstance(given, dict):
        text = format_yaml(given, sort_keys=False, default_flow_style=None)
        return parse_model(text, f"{document.source}: {_KEY}[{index}].model")
    if not isinstance(given, str) or "\0" in given:
        raise SloshModelError(
            f"{document.where(_KEY, index)}: model = {shown(given)} must be a path or a model"
        )
    return read_model(Path(document.source).parent / given)


def _place(
    document: YamlDocument, index: int, entry: Mapping[str, Any]
) -> tuple[float, float, float]:
    given = entry.get("place", [0.0, 0.0, 0.0])
    if not (
        isinstance(given, list)
        and len(given) == 3
        and all(_is_number(value) and abs(value) <= FARTHEST for value in given)
    ):
        raise SloshModelError(
            f"{document.where(_KEY, index)}: place = {shown(given)} must be three numbers "
            f"x, y, z [m] within ±{FARTHEST:g}"
        )
    x, y, z = map(float, given)
    return x, y, z


def _limit(document: YamlDocument, index: int, entry: Mapping[str, Any]) -> float:
    given = entry.get("limit", math.nan)
    if not _is_number(given) or not (math.isnan(given) or 0.0 < given <= HIGHEST_LIMIT):
        raise SloshModelError(
            f"{document.where(_KEY, index)}: limit = {shown(given)} must be a height in metres, "
            f"up to {HIGHEST_LIMIT:g}"
        )
    return float(given)


def _standing(document: YamlDocument, index: int, entry: Mapping[str, Any]) -> Standing | None:
    given, names = entry.get("standing"), tuple(BOUNDS)
    if given is None:
        return None
    where = document.where(_KEY, index)
    if not isinstance(given, dict) or sorted(map(str, given)) != sorted(names):
        raise SloshModelError(f"{where}: standing must be a mapping with {', '.join(names)}")
    for name, value in given.items():
        if not _is_number(value):
            raise SloshModelError(f"{where}: standing.{name} = {shown(value)} must be a number")
    try:
        return Standing(**{name: float(value) for name, value in given.items()})
    except SloshModelError as error:
        raise SloshModelError(f"{where}: {error}") from None


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
