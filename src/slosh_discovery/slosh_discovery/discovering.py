"""Runs a discovery that reads its data from files and writes its results to files."""

from __future__ import annotations

import json
import shlex
import shutil
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np

from slosh_bag.errors import SloshBagError
from slosh_bag.reader import BagReader
from slosh_base.files import check_outside, write_text
from slosh_discovery.discover.finding import Finding, SeparatingMotion
from slosh_discovery.discover.motion import MeasuredMotion
from slosh_discovery.discover_data import read_motions
from slosh_discovery.discover_data.reading import day_motions, files_at
from slosh_discovery.discover_frames import Pictures, worst_frames
from slosh_discovery.discovery_report import Command, DiscoveryReport, discovery_document
from slosh_discovery.errors import SloshDiscoveryError
from slosh_model.model import Model
from slosh_model.model_text import format_model, read_model
from slosh_model.simulate import Inputs
from slosh_model.tilt import attitude_of, ignored_text, ignored_tilt
from slosh_motion.checks.table_checks import InputDoubt
from slosh_motion.recorded import settings
from slosh_motion.recorded.sources import CellTopics
from slosh_motion.tables.columns import FOUND_OUT, TableOptions
from slosh_motion.tables.motion_table import MotionTable, is_motion_table, write_motion_table
from slosh_report.document import Document
from slosh_report.text import write_document

MODEL, DOCUMENT, PAGE = "model.yaml", "discovery.json", "report.html"
GROUP_MODEL = "model_{}.yaml"
SEPARATING = "separating_{}.csv"
HELD_OUT = 3
"""Without --holdout every third motion is held out."""
CELL = "/slosh"
"""Namespace of a cell where no recording tells another."""
SERVICE = "load_model"

Motions = tuple[MeasuredMotion, ...]
Tell = Callable[[str], object]


@dataclass(frozen=True, slots=True)
class DiscoveryRequest:
    """Data files, model and options of a discovery, as the user gives them.

    Attributes:
        data: bags, motion tables, folders of these.
        output: folder of the results.
        model: file of the base model; None: the one that the first bag's estimator ran.
        holdout: likewise; empty: every third motion of `data`, where there are three.
        from_bag: data are recording days; the motions in which the live estimate was off most
            come first.
        most: at most so many motions of `data`, the first ones; None: all.
        groups: patterns by the name of the group whose motions they match; empty: no groups.
        tables: how motion tables are to be read.
    """

    data: tuple[Path, ...]
    output: Path
    model: Path | None = None
    holdout: tuple[Path, ...] = ()
    from_bag: bool = False
    most: int | None = None
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    tables: TableOptions = FOUND_OUT


@dataclass(frozen=True, slots=True, eq=False)
class PreparedDiscovery:
    """Model and measured motions, read from files, with which a discovery starts.

    Attributes:
        base: the model that came in.
        fit, holdout: the motions.
    """

    base: Model
    fit: Motions
    holdout: Motions


MANY, MOST = 100_000, 500_000
"""Measured samples with which a search takes minutes; more than MOST take hours and gigabytes."""


def check_size(motions: Sequence[MeasuredMotion], tell: Tell) -> None:
    """Warns if a search will take long; raises an error if it would take far too long.

    Raises:
        SloshDiscoveryError: longer than anybody waits.
    """
    count = sum(len(motion.t) for motion in motions)
    remedy = "100 heights a second are enough, others may be empty; or take fewer motions"
    if count > MOST:
        raise SloshDiscoveryError(f"{count} measured samples are more than {MOST}: {remedy}")
    if count > MANY:
        tell(f"{count} measured samples: the search takes minutes; {remedy}")


def prepare(request: DiscoveryRequest, tell: Tell) -> PreparedDiscovery:
    """Reads the model and the motions that a request names.

    Args:
        request: what is asked.
        tell: is told what the reader must know of the data, one line each.

    Raises:
        SloshDiscoveryError: a file stands for two things.
        SloshBagError, SloshModelError, and likewise SloshDiscoveryError: a
            file is not usable.
    """
    base = recorded_model(request.data[0]) if request.model is None else read_model(request.model)
    fit, holdout = (
        read_all(
            paths, base, tell, from_bag=from_bag, groups=request.groups, tables=request.tables
        )
        for paths, from_bag in ((request.data, request.from_bag), (request.holdout, False))
    )
    tell_ignored_tilt(base, (*fit, *holdout), tell)
    if request.most is not None and len(fit) > request.most:
        tell(f"the first {request.most} of {len(fit)} motions are used")
        fit = fit[: request.most]
    check_apart(fit, holdout)
    check_size((*fit, *holdout), tell)
    if not holdout and len(fit) >= HELD_OUT:
        fit, holdout = part(fit)
        whose = " of each group" if request.groups else ""
        tell(f"every third motion{whose} is held out: {len(holdout)} of {len(fit) + len(holdout)}")
    elif not holdout:
        tell("no motion is held out: the gap is shown on the motions of the fit")
    return PreparedDiscovery(base, *unique_names(fit, holdout))


def make_report(
    request: DiscoveryRequest,
    prepared: PreparedDiscovery,
    notes: Sequence[str],
    finding: Finding,
    pictures: Pictures,
) -> DiscoveryReport:
    """Creates the content of a discovery's result page and terminal text.

    Args:
        request: what was asked.
        prepared: what the discovery started from.
        notes: what was told of the data while they were read.
        finding: what it found.
        pictures: gives a bag's camera images.
    """
    count, held = len(finding.motions), len(prepared.holdout)
    source = "the recorded model" if request.model is None else str(request.model)
    return DiscoveryReport(
        finding,
        subtitle=f"{source} ({finding.base.name}) against {count} measured "
        f"motion{'s' if count != 1 else ''}, {held} held out",
        notes=tuple(notes),
        commands=next_commands(request, finding),
        separating_files=tuple(
            SEPARATING.format(number) for number in range(1, len(finding.separating) + 1)
        ),
        frames=worst_frames((*request.data, *request.holdout), finding.worst, pictures),
    )


def write_results(folder: Path, report: DiscoveryReport) -> Document:
    """Writes all result files of a discovery; returns its document.

    Raises:
        OSError: a file cannot be written.
    """
    document = discovery_document(report)
    write_text(folder / MODEL, format_model(report.finding.model))
    for name, model in report.finding.group_models.items():
        write_text(folder / GROUP_MODEL.format(name), format_model(model))
    for name, motion in zip(report.separating_files, report.finding.separating, strict=True):
        write_motion_table(folder / name, _table(motion))
    write_document(folder / PAGE, document, folder / DOCUMENT)
    return document


def check_paths(data: Sequence[Path], holdout: Sequence[Path], output: Path) -> None:
    """Raises an error if a file is given for two purposes.

    Args:
        data, holdout: what is read.
        output: folder of the results.

    Raises:
        SloshDiscoveryError: a path is named twice.
        SloshFileError: the results would lie in a bag.
    """
    seen: dict[Path, str] = {}
    for kind, paths in (("DATA", data), ("--holdout", holdout)):
        for path in paths:
            real = path.resolve()
            if real in seen:
                where = f"in {kind} twice" if seen[real] == kind else "in both DATA and --holdout"
                raise SloshDiscoveryError(f"{path}: is {where}; give it once")
            seen[real] = kind
    bags = [path for path in (*data, *holdout) if any(path.glob("*.mcap"))]
    check_outside(output, bags)


def recorded_model(bag: Path) -> Model:
    """Returns the estimator's last model in a bag, or in the last bag of a folder that has one.

    Raises:
        SloshDiscoveryError: the bag does not tell.
        SloshBagError: it cannot be read.
    """
    bags = [path for path in files_at(bag) if not is_motion_table(path)]
    for path in reversed(bags):
        try:
            started = settings.latest(CellTopics(BagReader(path)).starts, "estimator")
        except SloshBagError:
            if len(bags) == 1:
                raise
            continue  # a bag of a folder that is damaged
        if started is not None:
            return settings.model_of(started)
    raise SloshDiscoveryError(f"{bag}: contains no model; give one (--model)")


def part(motions: Motions) -> tuple[Motions, Motions]:
    """Splits motions into fitted and held-out ones; every third of each group is held out."""
    met: Counter[str | None] = Counter()
    parts: tuple[list[MeasuredMotion], list[MeasuredMotion]] = [], []
    for motion in motions:
        met[motion.group] += 1
        parts[met[motion.group] % HELD_OUT == 0].append(motion)
    return tuple(parts[0]), tuple(parts[1])


def check_apart(fit: Motions, holdout: Motions) -> None:
    """Raises an error if a held-out motion is also fitted.

    Raises:
        SloshDiscoveryError: the same measurements are in both.
    """
    known = {_print(motion): motion.name for motion in fit}
    for motion in holdout:
        other = known.get(_print(motion))
        if other is not None:
            raise SloshDiscoveryError(
                f"{motion.name} in --holdout holds the same measurements as {other} in DATA"
            )


def unique_names(fit: Motions, holdout: Motions) -> tuple[Motions, Motions]:
    """Adds numbers to the names of motions that have the same name."""
    counts = Counter(motion.name for motion in (*fit, *holdout))
    met: Counter[str] = Counter()
    named = []
    for motion in (*fit, *holdout):
        met[motion.name] += 1
        if counts[motion.name] > 1:
            motion = replace(motion, name=f"{motion.name} ({met[motion.name]})")
        named.append(motion)
    return tuple(named[: len(fit)]), tuple(named[len(fit) :])


def next_commands(request: DiscoveryRequest, finding: Finding) -> tuple[Command, ...]:
    """Returns the commands that the user may run after a discovery."""
    models = {
        f" of a rig as in {name}": request.output / GROUP_MODEL.format(name)
        for name in finding.group_models
    } or {"": request.output / MODEL}
    first = finding.motions[0].motion.group if finding.group_models else None
    model = request.output / (MODEL if first is None else GROUP_MODEL.format(first))
    found = []
    if finding.changed:
        found += _use(request, model)
        service = f"{recorded_cell(request.data)}/{SERVICE}"
        found += [
            Command(
                f"load it into the running estimator{whose}",
                _call(service, path),
            )
            for whose, path in models.items()
        ]
    if finding.separating:
        table, heights = request.output / SEPARATING.format(1), request.output / "heights.csv"
        words = ["slosh", "discover", *map(str, request.data), "RECORDING"]
        words += ["--from-bag"] if request.from_bag else []
        words += ["--model", str(request.model)] if request.model else []
        words += ["--holdout", *map(str, request.holdout)] if request.holdout else []
        words += request.tables.words
        for name, patterns in request.groups.items():
            words += [word for pattern in patterns for word in ("--group", f"{name}={pattern}")]
        found += [
            Command("heights to expect of the motion that separates",
                    _line("slosh", "simulate", model, table, "-o", heights)),
            Command("after the robot has run that motion and RECORDING contains it",
                    _line(*words, "-o", f"{request.output}_2")),
        ]  # fmt: skip
    return tuple(found)


def _call(service: str, model: Path) -> str:
    """Returns the command that loads a model by a service, which works on this machine."""
    name, path = shlex.quote(service), json.dumps(str(model.resolve()))
    if shutil.which("ros2"):
        return f"ros2 service call {name} slosh_msgs/srv/LoadModel " + shlex.quote(
            f"{{path: {path}}}"
        )
    return f"slosh call {name} " + shlex.quote(f"path: {path}")


def recorded_cell(data: Sequence[Path]) -> str:
    """Returns the ROS namespace of the robot cell in the first bag of the data.

    Args:
        data: bags, motion tables, folders of these.
    """
    for path in data:
        inside = sorted(path.iterdir()) if path.is_dir() else []
        for item in (path, *inside):
            if item.suffix == ".mcap" or (item.is_dir() and any(item.glob("*.mcap"))):
                cells = CellTopics(BagReader(item)).cells
                return cells[0] if cells else CELL
    return CELL


def _use(request: DiscoveryRequest, model: Path) -> list[Command]:
    """Returns commands that apply the discovered model to the first bag and the first table."""
    found = []
    given = [path for path in request.data if path.exists()]
    files = [file for path in given for file in files_at(path)]
    table = next((path for path in files if is_motion_table(path)), None)
    bag = next((path for path in files if not is_motion_table(path)), None)
    if table is not None:
        output = model.with_name("heights.csv")
        line = _line("slosh", "simulate", model, table, "-o", output, *request.tables.words)
        found.append(Command("heights that the new model predicts", line))
    if bag is not None:
        line = _line("slosh", "replay", bag, "--model", model, "-o", model.with_name("replay"))
        found.append(Command("the new model over the recording", line))
    return found


def _line(*words: object) -> str:
    return shlex.join(map(str, words))


def read_all(
    paths: Iterable[Path],
    base: Model,
    tell: Tell,
    *,
    from_bag: bool,
    groups: Mapping[str, tuple[str, ...]] | None = None,
    tables: TableOptions = FOUND_OUT,
) -> Motions:
    """Reads the motions of several files; within a bag those with the largest live error first.

    Raises:
        SloshDiscoveryError: there are groups, and a motion belongs to none or to several.
    """
    if not from_bag:
        return tuple(
            grouped(motion, path, groups or {})
            for path in paths
            for motion in read_motions(path, base, tell, tables)
        )
    found = [(entry, path) for path in paths for entry in day_motions(path, base, tell, tables)]
    found.sort(key=lambda pair: -np.nan_to_num(pair[0].disagreement, nan=-1.0))
    return tuple(grouped(entry.motion, path, groups or {}) for entry, path in found)


def tell_ignored_tilt(base: Model, motions: Motions, tell: Tell) -> None:
    """Warns of motions in which the container tilts but the model ignores tilt."""
    tilts = {one.name: ignored_tilt(base, attitude_of(one.inputs)) for one in motions}
    tilted = max(motions, key=lambda one: tilts[one.name], default=None)
    text = "" if tilted is None else ignored_text(base, attitude_of(tilted.inputs))
    if tilted is not None and text:
        tell(InputDoubt(f"{tilted.name}: {text}", wrong=False))


def grouped(
    motion: MeasuredMotion, path: Path, groups: Mapping[str, tuple[str, ...]]
) -> MeasuredMotion:
    """Returns the motion with its group, if a pattern matches its name or path.

    Raises:
        SloshDiscoveryError: there are groups, and it belongs to none or to several.
    """
    if not groups:
        return motion
    texts = motion.name, str(path)
    found = [
        name
        for name, patterns in groups.items()
        if any(fnmatchcase(text, pattern) for text in texts for pattern in patterns)
    ]
    if len(found) != 1:
        which = f"groups {', '.join(found)}" if found else "none of the groups"
        raise SloshDiscoveryError(
            f"{path}: motion {motion.name} matches {which}; it must match one (--group)"
        )
    return replace(motion, group=found[0])


def _print(motion: MeasuredMotion) -> tuple[bytes, bytes]:
    """Returns a key that identifies the measurements of a motion."""
    return motion.t.tobytes(), motion.heights.tobytes()


def _table(motion: SeparatingMotion) -> MotionTable:
    inputs: Inputs = motion.inputs
    return MotionTable(inputs.t, inputs.acceleration, inputs.attitude, inputs.angular_velocity)
