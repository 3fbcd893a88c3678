"""Runs an identification that reads its data from files and writes its results to files."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from slosh_base.files import write_text
from slosh_base.files.bounded_text import read_text
from slosh_base.files.errors import TextFileError
from slosh_discovery.discovering import (
    Motions,
    check_apart,
    read_all,
    recorded_model,
    tell_ignored_tilt,
    unique_names,
)
from slosh_discovery.errors import SloshDiscoveryError
from slosh_discovery.identification_report import (
    Beside,
    IdentificationReport,
    identification_document,
)
from slosh_discovery.identify.parameters import DEFAULT, free_parameters
from slosh_discovery.identify.result import Identification, Strategy
from slosh_model.model import Model
from slosh_model.model_text import format_model, read_model
from slosh_model.parameters import DAMPING, FREQUENCY
from slosh_motion.tables.columns import FOUND_OUT, TableOptions
from slosh_motion.tables.motion_table import MotionTable, write_motion_table
from slosh_report.document import Document
from slosh_report.text import write_document

MODEL, DOCUMENT, PAGE = "model.yaml", "identification.json", "report.html"
POINT_MODEL, HELP = "model_{}.yaml", "helps_{}.csv"
LONGEST_DOCUMENT = 64_000_000
"""Characters of an earlier identification, at most."""

Tell = Callable[[str], object]


@dataclass(frozen=True, slots=True)
class IdentificationRequest:
    """Data, model and options of an identification.

    Attributes:
        data: bags, motion tables, folders of these.
        output: folder of the results.
        model: file of the model; None: the one that the first bag's estimator ran.
        holdout: motions that the fit does not see.
        names: parameters to fit.
        strategy: one model for all operating points, or one for each beside it.
        ratio: b, share of a cycle in which the container moves.
        tolerance: greatest ε̄ of a surface that is taken for a line [m].
        beside: folders of earlier identifications that are shown with it.
        tables: how motion tables are to be read.
    """

    data: tuple[Path, ...]
    output: Path
    model: Path | None = None
    holdout: tuple[Path, ...] = ()
    names: tuple[str, ...] = DEFAULT
    strategy: Strategy = Strategy.MOSM
    ratio: float = 0.4
    tolerance: float = 0.0005
    beside: tuple[Path, ...] = ()
    tables: TableOptions = FOUND_OUT


@dataclass(frozen=True, slots=True, eq=False)
class PreparedIdentification:
    """Model, motions and earlier results that an identification starts from.

    Attributes:
        base: the model that came in.
        fit, holdout: the motions.
        beside: earlier identifications.
    """

    base: Model
    fit: Motions
    holdout: Motions
    beside: tuple[Beside, ...]


def prepare(request: IdentificationRequest, tell: Tell) -> PreparedIdentification:
    """Reads the model, the motions and the earlier results that a request names.

    Args:
        request: what is asked.
        tell: is told what the reader must know of the data, one line each.

    Raises:
        SloshBagError, SloshModelError, SloshDiscoveryError: a file is not
            usable.
    """
    base = recorded_model(request.data[0]) if request.model is None else read_model(request.model)
    free_parameters(base, request.names)  # before the data are read, which takes longer
    fit = read_all(request.data, base, tell, from_bag=False, tables=request.tables)
    holdout = read_all(request.holdout, base, tell, from_bag=False, tables=request.tables)
    tell_ignored_tilt(base, (*fit, *holdout), tell)
    check_apart(fit, holdout)
    beside = tuple(read_beside(path) for path in request.beside)
    return PreparedIdentification(base, *unique_names(fit, holdout), beside)


def read_beside(folder: Path) -> Beside:
    """Reads frequency and damping of the first mode from an earlier identification.

    Args:
        folder: with its `model.yaml` and `identification.json`.

    Raises:
        SloshDiscoveryError: it holds no identification.
        SloshModelError: its model cannot be read.
    """
    path = folder / DOCUMENT
    try:
        overall = json.loads(read_text(path, LONGEST_DOCUMENT))["overall"]
        known = {entry["name"]: entry for entry in (*overall["parameters"], *overall["derived"])}
        frequency, damping = (
            (float(known[name]["value"]), float(known[name]["error"]))
            for name in (FREQUENCY, DAMPING)
        )
    except TextFileError as error:
        raise SloshDiscoveryError(str(error)) from None
    except (ValueError, KeyError, TypeError):
        raise SloshDiscoveryError(f"{path}: is not a result of slosh identify") from None
    return Beside(folder.name, read_model(folder / MODEL), frequency, damping)


def make_report(
    request: IdentificationRequest,
    prepared: PreparedIdentification,
    notes: Sequence[str],
    found: Identification,
) -> IdentificationReport:
    """Creates the result of an identification for its reader.

    Args:
        request: what was asked.
        prepared: what the identification started from.
        notes: what was told of the data while they were read.
        found: what it found.
    """
    count, held = len(prepared.fit), len(prepared.holdout)
    source = "the recorded model" if request.model is None else str(request.model)
    return IdentificationReport(
        found,
        subtitle=f"{source} ({prepared.base.name}) and {count} measured "
        f"motion{'s' if count != 1 else ''}" + (f", {held} held out" if held else ""),
        notes=tuple(notes),
        beside=prepared.beside,
        model_files=point_files([one.label for one in found.single]),
        help_files=tuple(
            (one.name, HELP.format(one.name.replace(".", "_")))
            for one in found.overall.held
            if one.inputs is not None
        ),
    )


def point_files(labels: Sequence[str]) -> tuple[str, ...]:
    """Returns unique file names for the models of operating points, from their labels."""
    plain = [re.sub(r"[^A-Za-z0-9._-]+", "_", label.removesuffix(" 1/min")) for label in labels]
    return tuple(
        POINT_MODEL.format(name if plain.count(name) == 1 else f"{name}_{number}")
        for number, name in enumerate(plain, start=1)
    )


def write_results(folder: Path, report: IdentificationReport) -> Document:
    """Writes all result files of an identification; returns its document.

    Raises:
        OSError: a file cannot be written.
    """
    found, document = report.found, identification_document(report)
    write_text(folder / MODEL, format_model(found.overall.model))
    for name, one in zip(report.model_files, found.single, strict=True):
        write_text(folder / name, format_model(one.model))
    tables = dict(report.help_files)
    for held in found.overall.held:
        if held.inputs is not None:
            inputs = held.inputs
            table = MotionTable(
                inputs.t, inputs.acceleration, inputs.attitude, inputs.angular_velocity
            )
            write_motion_table(folder / tables[held.name], table)
    write_document(folder / PAGE, document, folder / DOCUMENT)
    return document
