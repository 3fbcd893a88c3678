"""Reads and writes `manifest.yaml`: the expected replay results of the bags in a folder.

    version: 1
    bags:
      c3:
        shows: DL22's 3D motion c, in the simulated cell
        estimates: exact
        images: 552
        drops: 0
        sigma: {3D-NL: {value: 0.000134, tolerance: 1.0e-6}}
        epsilon: {3D-NL: {value: -0.0139, tolerance: 0.001}}
        events:
          - {source: measured, peak: {value: 0.0245, tolerance: 1.0e-6}}
        warnings: []

Numbers are in SI units; ε is a fraction. `estimates` is `exact`: the recorded estimates must come
out again bit for bit; a number: within so much; or absent: not looked at. Everything else that is
absent is not looked at either, but for `warnings`: those that are not announced fail.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import count
from pathlib import Path, PurePosixPath
from typing import Any

from slosh_bag.errors import SloshBagError
from slosh_base.files import write_text
from slosh_base.files.errors import SloshFileError
from slosh_base.files.file_version import MANIFEST, read_versioned
from slosh_base.files.nearest import did_you_mean
from slosh_base.files.yaml_document import (
    Key,
    KeyPath,
    YamlDocument,
    dotted,
    format_yaml,
    shown,
)

NAME = "manifest.yaml"
MODELS = "models"
"""Folder beside the manifest for copies of model files that lie elsewhere."""
EXACT = "exact"
SOURCES = ("measured", "estimated", "disagreement")
_KEYS = (
    "shows", "model", "estimates", "images", "drops", "sigma", "epsilon", "events", "warnings",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class ExpectedNumber:
    """A number that a replay is expected to give, with its tolerance."""

    value: float
    tolerance: float

    @property
    def bounds(self) -> tuple[float, float]:
        """Lowest and highest accepted value of the number."""
        return self.value - self.tolerance, self.value + self.tolerance


@dataclass(frozen=True, slots=True)
class ExpectedEvent:
    """A limit violation that the replay is expected to reproduce.

    Attributes:
        source: one of SOURCES.
        peak: [m]; None: any.
        duration: [s]; None: any.
    """

    source: str
    peak: ExpectedNumber | None = None
    duration: ExpectedNumber | None = None


@dataclass(frozen=True, slots=True)
class Expectation:
    """Expected results of the replay of one bag; values that are None are not checked.

    Attributes:
        shows: what the bag is there for.
        model: file to replay with; None: the recorded model.
        tolerance: by how much replayed estimates may differ from recorded ones [SI units]; 0: not
            in a single bit; None: not looked at.
        images, drops: measurements, and input samples that were not used.
        sigma: mean absolute error by model [m].
        epsilon: relative error of the maximum by model [1].
        events: excesses of limits, in order.
        warnings: a part of each warning that must and may come; None: any may come.
    """

    shows: str = ""
    model: Path | None = None
    tolerance: float | None = None
    images: int | None = None
    drops: int | None = None
    sigma: Mapping[str, ExpectedNumber] = field(default_factory=dict)
    epsilon: Mapping[str, ExpectedNumber] = field(default_factory=dict)
    events: tuple[ExpectedEvent, ...] | None = None
    warnings: tuple[str, ...] | None = ()


def read_manifest(path: Path) -> dict[str, Expectation]:
    """Reads the expected results from a manifest, by bag name.

    Raises:
        SloshBagError: the file cannot be read, or a key or value is not known; one line that
            names the file, the line, the bag and the key.
    """
    try:
        source = read_versioned(path, MANIFEST)
    except SloshFileError as error:
        raise SloshBagError(str(error)) from None
    document = source.value
    bags = document.get("bags") if isinstance(document, dict) else None
    if not isinstance(bags, dict) or set(document) != {"bags"}:
        raise SloshBagError(f"{path}: must hold one key, bags, with the bags by name")
    for name in bags:
        if PurePosixPath(name).is_absolute() or ".." in PurePosixPath(name).parts:
            raise SloshBagError(
                f"{source.where('bags', name)}: {shown(name)}: a bag is named by its path below "
                "the manifest's folder"
            )
    return {
        name: _expectation(_Place(source, ("bags", name)), entry) for name, entry in bags.items()
    }


def write_manifest(path: Path, bags: Mapping[str, Expectation]) -> None:
    """Writes a manifest; keeps descriptions and tolerances of the existing file.

    What a bag shows, tolerances and the texts of warnings that still fit are kept.

    Args:
        path: the file; bags that it names and that are not given are kept as they are.
        bags: what their replays must give, by name.

    Raises:
        SloshBagError: the file that is there is no manifest.
        OSError: it cannot be written; what was there is as it was.
    """
    old = read_manifest(path) if path.is_file() else {}
    merged = {**old, **{name: _kept(old.get(name), new) for name, new in bags.items()}}
    document = MANIFEST.versioned(
        {"bags": {name: _document(path, merged[name]) for name in sorted(merged)}}
    )
    text = format_yaml(
        document, sort_keys=False, allow_unicode=True, width=99, default_flow_style=None
    )
    write_text(path, text)


def _kept(old: Expectation | None, new: Expectation) -> Expectation:
    """Returns new expected results with the descriptions and tolerances of the old ones."""
    if old is None:
        return new
    texts = tuple(
        next((text for text in old.warnings or () if text in warning), warning)
        for warning in new.warnings or ()
    )
    return replace(
        new,
        shows=new.shows or old.shows,
        tolerance=new.tolerance if new.tolerance is None else (old.tolerance or new.tolerance),
        sigma=_tolerant(old.sigma, new.sigma),
        epsilon=_tolerant(old.epsilon, new.epsilon),
        warnings=texts,
    )


def _tolerant(
    old: Mapping[str, ExpectedNumber], new: Mapping[str, ExpectedNumber]
) -> dict[str, ExpectedNumber]:
    return {
        name: replace(found, tolerance=old[name].tolerance) if name in old else found
        for name, found in new.items()
    }


def _document(path: Path, bag: Expectation) -> dict[str, Any]:
    model = None
    if bag.model is not None:
        model = Path(os.path.relpath(_beside(path, bag.model), path.parent)).as_posix()
    estimates = None if bag.tolerance is None else (bag.tolerance or EXACT)
    document: dict[str, Any] = {
        "shows": bag.shows, "model": model, "estimates": estimates, "images": bag.images,
        "drops": bag.drops,
        "sigma": {name: _pair(value) for name, value in bag.sigma.items()},
        "epsilon": {name: _pair(value) for name, value in bag.epsilon.items()},
        "events": None if bag.events is None else [_event_document(e) for e in bag.events],
        "warnings": list(bag.warnings or ()),
    }  # fmt: skip
    return {key: value for key, value in document.items() if value not in (None, {}, "")}


def _beside(path: Path, model: Path) -> Path:
    """Returns a model file below the manifest's folder; copies one that lies elsewhere.

    So the folder can be copied to another machine.
    """
    if model.resolve().is_relative_to(path.parent.resolve()) or not model.is_file():
        return model
    text = model.read_text(encoding="utf-8")
    folder = path.parent / MODELS
    folder.mkdir(exist_ok=True)
    for number in count(1):
        end = "" if number == 1 else f"_{number}"
        place = folder / f"{model.stem}{end}{model.suffix}"
        if not place.exists():
            write_text(place, text)
        if place.read_text(encoding="utf-8") == text:
            break
    return place


def _event_document(event: ExpectedEvent) -> dict[str, Any]:
    found = {"peak": event.peak, "duration": event.duration}
    return {"source": event.source, **{k: _pair(v) for k, v in found.items() if v is not None}}


def _pair(value: ExpectedNumber) -> dict[str, float]:
    """Returns expected value and tolerance; rounds the value to a hundredth of the tolerance."""
    if value.tolerance == 0.0:
        return {"value": value.value, "tolerance": 0.0}
    digits = 2 - math.floor(math.log10(value.tolerance))
    return {"value": round(value.value, digits), "tolerance": value.tolerance}


@dataclass(frozen=True, slots=True)
class _Place:
    """Position of a key in a manifest, for error messages."""

    document: YamlDocument
    keys: KeyPath

    @property
    def folder(self) -> Path:
        return Path(self.document.source).parent

    def under(self, key: Key) -> _Place:
        return _Place(self.document, (*self.keys, key))

    def error(self, problem: str, *below: Key) -> SloshBagError:
        """Creates an error that names file, line and key of a manifest entry."""
        line = self.document.where(*self.keys, *below)
        return SloshBagError(f"{line}: {dotted(self.keys)}: {problem}")


def _expectation(place: _Place, entry: Any) -> Expectation:
    _check_keys(place, entry, _KEYS)
    shows, model = entry.get("shows", ""), entry.get("model")
    if not isinstance(shows, str):
        raise place.under("shows").error(f"{shown(shows)} is not a text")
    if model is not None and not (isinstance(model, str) and model):
        raise place.under("model").error(f"{shown(model)} is not a file name")
    return Expectation(
        shows=shows,
        model=None if model is None else place.folder / model,
        tolerance=_tolerance(place.under("estimates"), entry.get("estimates")),
        images=_count(place.under("images"), entry.get("images")),
        drops=_count(place.under("drops"), entry.get("drops")),
        sigma=_by_model(place.under("sigma"), entry.get("sigma", {})),
        epsilon=_by_model(place.under("epsilon"), entry.get("epsilon", {})),
        events=_events(place.under("events"), entry.get("events")),
        warnings=_texts(place.under("warnings"), entry.get("warnings", [])),
    )


def _check_keys(place: _Place, entry: Any, known: tuple[str, ...]) -> None:
    if not isinstance(entry, dict):
        raise place.error(f"must be a mapping with keys of {', '.join(known)}")
    for key in entry:
        if key not in known:
            meant = did_you_mean(key, known)
            raise place.error(f"unknown key {shown(key)} (known: {', '.join(known)}){meant}", key)


def _tolerance(place: _Place, value: Any) -> float | None:
    if value is None or value == EXACT:
        return None if value is None else 0.0
    return _number(place, value, least=0.0)


def _number(place: _Place, value: Any, least: float = -math.inf) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise place.error(f"{shown(value)} is not a number")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not (math.isfinite(number) and number >= least):
        raise place.error(f"{shown(value)} must be finite and at least {least:g}")
    return number


def _count(place: _Place, value: Any) -> int | None:
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise place.error(f"{shown(value)} is not a number of messages")
    return value


def _expected(place: _Place, entry: Any) -> ExpectedNumber:
    _check_keys(place, entry, ("value", "tolerance"))
    for key in ("value", "tolerance"):
        if key not in entry:
            raise place.error(f"{key} is missing")
    return ExpectedNumber(
        _number(place.under("value"), entry["value"]),
        _number(place.under("tolerance"), entry["tolerance"], least=0.0),
    )


def _by_model(place: _Place, entry: Any) -> dict[str, ExpectedNumber]:
    if not isinstance(entry, dict):
        raise place.error("must be a mapping from the model's name, such as 3D-NL")
    return {name: _expected(place.under(name), value) for name, value in entry.items()}


def _events(place: _Place, entries: Any) -> tuple[ExpectedEvent, ...] | None:
    if entries is None:
        return None
    if not isinstance(entries, list):
        raise place.error("must be a list")
    return tuple(_event(place.under(index), entry) for index, entry in enumerate(entries))


def _event(place: _Place, entry: Any) -> ExpectedEvent:
    _check_keys(place, entry, ("source", "peak", "duration"))
    if entry.get("source") not in SOURCES:
        raise place.under("source").error(f"must be one of {', '.join(SOURCES)}")
    return ExpectedEvent(
        entry["source"],
        *(
            _expected(place.under(key), entry[key]) if key in entry else None
            for key in ("peak", "duration")
        ),
    )


def _texts(place: _Place, value: Any) -> tuple[str, ...]:
    if not isinstance(value, list) or not all(isinstance(text, str) for text in value):
        raise place.error("must be a list of texts")
    return tuple(value)
