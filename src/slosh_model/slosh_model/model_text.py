"""Reads and writes a `model.yaml`, as a file or a text."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any, cast

from slosh_base.files import write_text
from slosh_base.files.bounded_text import read_text
from slosh_base.files.errors import TextFileError, YamlError
from slosh_base.files.file_version import MODEL, parse_versioned
from slosh_base.files.nearest import did_you_mean
from slosh_base.files.yaml_document import KeyPath, dotted, format_yaml, shown
from slosh_model.containers import SHAPES, Container
from slosh_model.covariance import Covariance
from slosh_model.errors import ModelFileError, SloshModelError
from slosh_model.limits import ValidityLimits
from slosh_model.liquid import Liquid
from slosh_model.model import EffectUse, Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.shapes.table_text import points_of, solved_section, with_solved

KEYS = (
    "container", "liquid", "damping_ratio", "natural_frequency", "modes", "modes_of",
    "modes_in_use", "limits", "effects", "covariance",
)  # fmt: skip
AUTO = "auto"
LONGEST = 64_000
"""Characters of a model, at most; it is a page of text."""


def parse_model(text: str, source: str = "model.yaml") -> Model:
    """Parses a model from YAML text.

    >>> from slosh_model import parse_model
    >>> text = "container: {shape: cylinder, radius: 0.04, fill_height: 0.06}"
    >>> parse_model(text)
    Model(2D-L, radius 40 mm, filled to 60 mm, 3.369 Hz, damping ratio 0.00603)

    Args:
        text: the content of a `model.yaml`.
        source: how errors name it.

    Raises:
        SloshModelError: no YAML, an unknown key, a wrong type or an impossible value; one line
            with the source, the line, the key and the value.
    """
    try:
        document = parse_versioned(text, source, MODEL, LONGEST)
    except YamlError as error:
        raise SloshModelError(str(error)) from None
    if document.value is None:
        raise SloshModelError(f"{source}: is empty; `slosh new` writes a model.yaml to begin with")
    try:
        return _model(_mapping(document.value, ()), Path(source).parent)
    except SloshModelError as error:
        problem = " ".join(str(error).split())
        raise SloshModelError(f"{document.where(*error.keys)}: {problem}", error.keys) from None


def format_model(model: Model) -> str:
    """Formats a model as YAML text; `parse_model` returns an equal model.

    >>> import slosh
    >>> from slosh_model import format_model
    >>> print(format_model(slosh.Model.from_cup(diameter=0.08, fill_height=0.06)))
    version: 1
    container: {shape: cylinder, radius: 0.04, fill_height: 0.06}
    liquid: {density: 998.2, kinematic_viscosity: 1.0e-06}
    damping_ratio: auto
    effects:
    - {name: vertical_acceleration}
    - {name: surface_nonlinearity, alpha: 0.58}
    """
    count = model.modes
    document: dict[str, Any] = {
        "container": container_section(model.container),
        "liquid": _given_fields(model.liquid),
        "damping_ratio": AUTO if model.damping_ratio is None else model.damping_ratio,
    }
    if model.natural_frequency is not None:
        document["natural_frequency"] = model.natural_frequency
    if model.container.digest:
        highest = max(m.number for m in model.mode_constants())
        along = (highest + 1) // 2 if model.container.one_directional else highest
        document |= solved_section(model.container, max(count, along))
        document["modes_in_use"] = count
    elif count != 1:
        document["modes"] = count
    if model.limits != model.container.validated:
        document["limits"] = _given_fields(model.limits)
    document["effects"] = [{"name": use.name, **use.parameters} for use in model.effects]
    if model.covariance is not None:
        document["covariance"] = {
            "parameters": list(model.covariance.parameters),
            "matrix": [list(row) for row in model.covariance.matrix],
        }
    return format_yaml(MODEL.versioned(document), sort_keys=False, default_flow_style=None)


def container_section(container: Container) -> dict[str, Any]:
    """Returns a container's shape and dimensions as they are written to YAML."""
    found: dict[str, Any] = {"shape": container.shape}
    for item in _keys(type(container)):
        value = getattr(container, item.name)
        if value is not None and value is not False:
            found[item.name] = [list(p) for p in value] if isinstance(value, tuple) else value
    return found


def _keys(kind: Any) -> tuple[Any, ...]:
    """Returns the fields of a type of container that a model file contains."""
    return tuple(item for item in fields(kind) if item.compare)


def _given_fields(value: Any) -> dict[str, float]:
    pairs = ((item.name, getattr(value, item.name)) for item in fields(value))
    return {name: number for name, number in pairs if number is not None}


def _model(document: Mapping[str, Any], folder: Path) -> Model:
    if "containers" in document:
        raise SloshModelError(
            "a tray of containers: here the model of one is wanted", ("containers",)
        )
    _refuse_unknown(document, KEYS, ())
    if "container" not in document:
        raise SloshModelError("key 'container' is missing")
    container = parse_container(_mapping(document["container"], ("container",)), folder)
    container, modes = with_solved(container, document)
    limits = _mapping(document.get("limits", {}), ("limits",))
    return Model(
        container=container,
        liquid=_numbers(Liquid, document.get("liquid", {}), ("liquid",)),
        damping_ratio=_auto(document, "damping_ratio"),
        natural_frequency=_auto(document, "natural_frequency"),
        effects=_effects(document.get("effects", [])),
        modes=_whole(*modes),
        limits=_numbers(
            ValidityLimits, {**_given_fields(container.validated), **limits}, ("limits",)
        ),
        covariance=_covariance(document.get("covariance")),
    )


def _auto(document: Mapping[str, Any], key: str) -> float | None:
    """Parses a number; returns None for `auto`, which means that the model computes it."""
    value = document.get(key, AUTO)
    return None if value == AUTO else _number(value, (key,))


def _covariance(section: Any) -> Covariance | None:
    if section is None:
        return None
    path: KeyPath = ("covariance",)
    mapping = _mapping(section, path)
    keys = ("parameters", "matrix")
    _refuse_unknown(mapping, keys, path)
    names, rows = (_list(mapping.get(key), (*path, key)) for key in keys)
    for index, name in enumerate(names):
        if not isinstance(name, str):
            raise _refusal((*path, "parameters", index), name, "must be a text")
    matrix = tuple(
        tuple(
            _number(value, (*path, "matrix", row, column))
            for column, value in enumerate(_list(values, (*path, "matrix", row)))
        )
        for row, values in enumerate(rows)
    )
    return Covariance(tuple(names), matrix)


def parse_container(section: Mapping[str, Any], folder: Path) -> Container:
    """Creates a container from the container entry of a model file.

    Args:
        section: its shape and dimensions.
        folder: to which names of files in it are relative.

    Raises:
        SloshModelError: an unknown or missing key, or an impossible container.
    """
    shape = section.get("shape", Cylinder.shape)
    kind = SHAPES.get(shape) if isinstance(shape, str) else None
    if kind is None:
        raise _refusal(("container", "shape"), shape, f"(known: {', '.join(SHAPES)})")
    keys = _keys(kind)
    names = tuple(item.name for item in keys)
    _refuse_unknown(section, ("shape", *names), ("container",))
    for item in keys:
        if item.default is MISSING and item.name not in section:
            raise SloshModelError(f"key 'container.{item.name}' is missing", ("container",))
    made: Any = kind
    values = {
        item.name: _dimension(section[item.name], item, folder)
        for item in keys
        if item.name in section
    }
    try:
        container: Container = made(**values)
    except SloshModelError as error:
        raise SloshModelError(str(error), error.keys or ("container",)) from None
    return container


def _dimension(value: Any, item: Any, folder: Path) -> Any:
    """Parses one value of a container: a number, points, or true or false."""
    path, kind = ("container", item.name), item.metadata.get("kind")
    if kind == "points":
        return points_of(value, path, folder)
    return _flag(value, path) if kind == "flag" else _number(value, path)


def _flag(value: Any, path: KeyPath) -> bool:
    if not isinstance(value, bool):
        raise _refusal(path, value, "must be true or false")
    return value


def _effects(section: Any) -> tuple[EffectUse, ...]:
    if section is None:
        return ()
    listed = _list(section, ("effects",))
    return tuple(_effect(item, ("effects", index)) for index, item in enumerate(listed))


def _effect(item: Any, path: KeyPath) -> EffectUse:
    if isinstance(item, str):
        raise _refusal(path, item, f"must be a mapping; did you mean - name: {item:.60}?")
    entry = _mapping(item, path)
    if not isinstance(entry.get("name"), str):
        raise SloshModelError(f"{dotted(path)}.name is missing or not a text", (*path, "name"))
    given = {key: _number(value, (*path, key)) for key, value in entry.items() if key != "name"}
    try:
        return EffectUse(entry["name"], given)
    except SloshModelError as error:
        raise SloshModelError(str(error), (*path, *error.keys)) from None


def _numbers(kind: Any, section: Any, path: KeyPath, also: tuple[str, ...] = ()) -> Any:
    """Parses a dataclass of numbers from a mapping."""
    mapping = _mapping(section, path)
    _refuse_unknown(mapping, tuple(item.name for item in fields(cast(Any, kind))), path, also)
    return kind(**{key: _number(value, (*path, key)) for key, value in mapping.items()})


def _list(value: Any, path: KeyPath) -> list[Any]:
    if not isinstance(value, list):
        raise SloshModelError(f"{dotted(path)} must be a list, not {shown(value)}", path)
    return value


def _mapping(value: Any, path: KeyPath) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        name = dotted(path) or "the document"
        raise SloshModelError(
            f"{name} must be a mapping of keys to values, not {shown(value)}", path
        )
    return value


def _refuse_unknown(
    section: Mapping[str, Any], known: tuple[str, ...], path: KeyPath, also: tuple[str, ...] = ()
) -> None:
    for key in section:
        if key not in known:
            names = ", ".join((*also, *known))
            place = (*path, key)
            meant = did_you_mean(key, (*also, *known))
            raise SloshModelError(f"unknown key '{dotted(place)}' (known: {names}){meant}", place)


def _number(value: Any, path: KeyPath) -> float:
    """Returns a value as a float; raises an error if it is not a finite number."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise _refusal(path, value, "must be a number, in SI units and without the unit")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise _refusal(path, value, "must be a finite number")
    return number


def _whole(value: Any, path: KeyPath) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise _refusal(path, value, "must be a whole number")
    return value


def _refusal(path: KeyPath, value: Any, why: str) -> SloshModelError:
    return SloshModelError(f"{dotted(path)} = {shown(value)} {why}", path)


def read_model(path: str | Path) -> Model:
    """Reads a model from a file.

    >>> from slosh_model import read_model
    >>> read_model("cup/model.yaml")
    Model(3D-NL, radius 40 mm, filled to 60 mm, 3.369 Hz, damping ratio 0.00603)

    Raises:
        ModelFileError: the file is no regular file, too large, or not readable text.
        SloshModelError: its content is no model; the text names the file, the line and the key.
    """
    if not str(path):
        raise ModelFileError("model: no file given; name a model.yaml")
    try:
        text = read_text(path, LONGEST)
    except TextFileError as error:
        raise ModelFileError(str(error)) from None
    return parse_model(text, str(path))


def write_model(path: str | Path, model: Model) -> None:
    """Writes a model to a file; `read_model` returns an equal model.

    Raises:
        OSError: the file cannot be written; what was there is as it was.

    >>> model = read_model("cup/model.yaml")
    >>> write_model("copy.yaml", model)
    >>> read_model("copy.yaml") == model
    True
    """
    write_text(Path(path), format_model(model))
