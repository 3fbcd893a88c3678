"""Reads and writes the text of a `model.yaml`.

The text comes and goes as a string: whoever opens the file names it in the errors.
"""

from __future__ import annotations

import math
import re
from collections.abc import Hashable, Mapping
from dataclasses import fields
from typing import Any

import yaml

from slosh_model.bounded_yaml import load_yaml
from slosh_model.containers import Cylinder
from slosh_model.errors import SloshModelError
from slosh_model.liquid import Liquid
from slosh_model.model import EffectUse, Model, ValidityLimits

INT_TAG, FLOAT_TAG = "tag:yaml.org,2002:int", "tag:yaml.org,2002:float"
KEYS = ("container", "liquid", "damping_ratio", "modes", "limits", "effects")
SHAPES = ("cylinder",)
AUTO = "auto"
LONGEST = 64_000
"""Characters of a model, at most; it is a page of text."""
# What PyYAML lets through where an explicit tag does not fit its value, as in `!!bool 5`.
_YAML_FAILURES = (
    yaml.YAMLError, ArithmeticError, AttributeError, LookupError, RecursionError, TypeError,
    ValueError,
)  # fmt: skip


class _Loader(yaml.SafeLoader):
    """A safe loader without the silent surprises of YAML 1.1.

    Numbers are those of YAML 1.2: 1e-6 is one, 1:30 (ninety) and 010 (eight) are not that. A key
    that stands twice is refused; plain YAML keeps the last in silence.
    """

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        keys = [self.construct_object(key, deep=True) for key, _ in node.value]
        seen = set()
        for key in keys:
            if not isinstance(key, Hashable):
                raise SloshModelError("a key is a collection; keys are names")
            if key in seen:
                raise SloshModelError(f"key {_shown(key)} stands twice")
            seen.add(key)
        return super().construct_mapping(node, deep)

    def construct_whole(self, node: yaml.ScalarNode) -> int:
        """An int; decimal, also with leading zeros."""
        return int(node.value)


_Loader.yaml_implicit_resolvers = {
    first: [pair for pair in pairs if pair[0] not in (INT_TAG, FLOAT_TAG)]
    for first, pairs in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
_Loader.add_constructor(INT_TAG, _Loader.construct_whole)
_Loader.add_implicit_resolver(INT_TAG, re.compile(r"[-+]?[0-9]+$"), list("-+0123456789"))
_Loader.add_implicit_resolver(
    FLOAT_TAG,
    re.compile(
        r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?$|[-+]?\.(inf|Inf|INF)$"
        r"|\.(nan|NaN|NAN)$"
    ),
    list("-+.0123456789"),
)


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
        document = load_yaml(text, _Loader, LONGEST)
    except yaml.MarkedYAMLError as error:
        where = f"line {error.problem_mark.line + 1}: " if error.problem_mark else ""
        raise SloshModelError(f"not YAML: {where}{error.problem}") from None
    except SloshModelError:
        raise
    except _YAML_FAILURES as error:
        raise SloshModelError(f"not YAML: {str(error) or type(error).__name__}") from None
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
        known = ", ".join(SHAPES)
        raise SloshModelError(f"container.shape = {_shown(shape)} (known: {known})")
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
        raise SloshModelError(f"effects must be a list, not {_shown(section)}")
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
        raise SloshModelError(f"{path} must be a mapping of keys to values, not {_shown(value)}")
    return value


def _refuse_unknown(
    section: Mapping[str, Any], known: tuple[str, ...], prefix: str, also: tuple[str, ...] = ()
) -> None:
    for key in section:
        if key not in known:
            names = ", ".join((*also, *known))
            shown = f"'{prefix}{key}'" if isinstance(key, str) else _shown(key)
            raise SloshModelError(f"unknown key {shown[:60]} (known: {names})")


def _number(value: Any, path: str) -> float:
    """A finite number."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise SloshModelError(f"{path} = {_shown(value)} must be a number")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise SloshModelError(f"{path} = {_shown(value)} must be a finite number")
    return number


def _whole(value: Any, path: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise SloshModelError(f"{path} = {_shown(value)} must be a whole number")
    return value


def _shown(value: Any) -> str:
    """A value as errors show it; aliases can make a short text's lists endless."""
    if isinstance(value, (list, dict, set, tuple)):
        return {list: "a list", dict: "a mapping"}.get(type(value), "a collection")
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:60]}…"
