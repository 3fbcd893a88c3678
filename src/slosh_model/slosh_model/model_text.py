"""Reads and writes the text of a `model.yaml`.

The text comes and goes as a string: whoever opens the file names it in the errors.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import yaml

from slosh_model.containers import Cylinder
from slosh_model.errors import SloshModelError
from slosh_model.liquid import Liquid
from slosh_model.model import EffectUse, Model, ValidityLimits

KEYS = ("container", "liquid", "damping_ratio", "modes", "limits", "effects")
SHAPES = ("cylinder",)
AUTO = "auto"


class _UniqueKeyLoader(yaml.SafeLoader):
    """Refuses a key that stands twice in a mapping; plain YAML keeps the last in silence."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        keys = [self.construct_object(key, deep=True) for key, _ in node.value]
        for key in keys:
            if keys.count(key) > 1:
                raise SloshModelError(f"key {key!r} stands twice")
        return super().construct_mapping(node, deep)


def parse_model(text: str, source: str = "model.yaml") -> Model:
    """Reads a model.

    Args:
        text: the content of a `model.yaml`.
        source: how errors name it.

    Raises:
        SloshModelError: no YAML, an unknown key, a wrong type or an impossible value; one line
            with the source, the key and the value.
    """
    try:
        return _model(_load(text))
    except SloshModelError as error:
        raise SloshModelError(f"{source}: {' '.join(str(error).split())}") from None


def format_model(model: Model) -> str:
    """The text of a `model.yaml` that `parse_model` reads back to an equal model."""
    container = {"shape": "cylinder", **_given_fields(model.container)}
    document: dict[str, Any] = {
        "container": container,
        "liquid": _given_fields(model.liquid),
        "damping_ratio": AUTO if model.damping_ratio is None else model.damping_ratio,
    }
    if model.modes != 1:
        document["modes"] = model.modes
    if model.limits != ValidityLimits():
        document["limits"] = _given_fields(model.limits)
    document["effects"] = [{"name": use.name, **use.parameters} for use in model.effects]
    text: str = yaml.safe_dump(document, sort_keys=False, default_flow_style=None)
    return text


def _given_fields(value: Any) -> dict[str, float]:
    pairs = ((item.name, getattr(value, item.name)) for item in fields(value))
    return {name: number for name, number in pairs if number is not None}


def _load(text: str) -> Mapping[str, Any]:
    try:
        # The loader is a SafeLoader.
        document = yaml.load(text, _UniqueKeyLoader)
    except yaml.MarkedYAMLError as error:
        where = f"line {error.problem_mark.line + 1}: " if error.problem_mark else ""
        raise SloshModelError(f"not YAML: {where}{error.problem}") from None
    except SloshModelError:
        raise
    except (yaml.YAMLError, ValueError, TypeError, RecursionError) as error:
        raise SloshModelError(f"not YAML: {str(error).splitlines()[0]}") from None
    return _mapping(document, "the document")


def _model(document: Mapping[str, Any]) -> Model:
    _refuse_unknown(document, KEYS, "")
    if "container" not in document:
        raise SloshModelError("key 'container' is missing")
    damping = document.get("damping_ratio", AUTO)
    return Model(
        container=_container(_mapping(document["container"], "container")),
        liquid=_numbers(Liquid, document.get("liquid", {}), "liquid"),
        damping_ratio=None if damping == AUTO else _number(damping, "damping_ratio"),
        effects=_effects(document.get("effects", [])),
        modes=_whole(document.get("modes", 1), "modes"),
        limits=_numbers(ValidityLimits, document.get("limits", {}), "limits"),
    )


def _container(section: Mapping[str, Any]) -> Cylinder:
    shape = section.get("shape", "cylinder")
    if shape not in SHAPES:
        raise SloshModelError(f"container.shape = {shape!r} (known: {', '.join(SHAPES)})")
    for key in ("radius", "fill_height"):
        if key not in section:
            raise SloshModelError(f"key 'container.{key}' is missing")
    dimensions = {key: value for key, value in section.items() if key != "shape"}
    container: Cylinder = _numbers(Cylinder, dimensions, "container", also=("shape",))
    return container


def _effects(section: Any) -> tuple[EffectUse, ...]:
    if section is None:
        return ()
    if not isinstance(section, list):
        raise SloshModelError(f"effects must be a list, not {section!r}")
    uses = []
    for index, item in enumerate(section):
        path = f"effects[{index}]"
        entry = _mapping(item, path)
        if not isinstance(entry.get("name"), str):
            raise SloshModelError(f"{path}.name is missing or no text")
        given = {
            str(key): _number(value, f"{path}.{key}")
            for key, value in entry.items()
            if key != "name"
        }
        uses.append(EffectUse(entry["name"], given))
    return tuple(uses)


def _numbers(kind: Any, section: Any, path: str, also: tuple[str, ...] = ()) -> Any:
    """A dataclass of numbers from a mapping."""
    mapping = _mapping(section, path)
    names = tuple(item.name for item in fields(kind))
    _refuse_unknown(mapping, names, f"{path}.", also)
    return kind(**{key: _number(value, f"{path}.{key}") for key, value in mapping.items()})


def _mapping(value: Any, path: str) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise SloshModelError(f"{path} must be a mapping of keys to values, not {value!r}"[:200])
    return value


def _refuse_unknown(
    section: Mapping[str, Any], known: tuple[str, ...], prefix: str, also: tuple[str, ...] = ()
) -> None:
    for key in section:
        if key not in known:
            names = ", ".join((*also, *known))
            raise SloshModelError(f"unknown key '{prefix}{key}' (known: {names})")


def _number(value: Any, path: str) -> float:
    """A finite number; '1e-6' too, which YAML 1.1 takes for text."""
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise SloshModelError(f"{path} = {value!r} must be a number")
    try:
        number = float(value)
    except (ValueError, OverflowError):
        raise SloshModelError(f"{path} = {value!r} must be a number"[:200]) from None
    if not math.isfinite(number):
        raise SloshModelError(f"{path} = {value!r} must be a finite number")
    return number


def _whole(value: Any, path: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise SloshModelError(f"{path} = {value!r} must be a whole number")
    return value
