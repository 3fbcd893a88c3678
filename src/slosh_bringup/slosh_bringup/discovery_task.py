"""Runs one discovery for all recordings together, or one task for each recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path

from slosh_bag.mcap_files.bag_folder import bag_files
from slosh_base.files import check_free, new_folder, remove_unfinished
from slosh_base.files.file_state import state_of
from slosh_bringup.finished_work import FinishedWork
from slosh_bringup.replay.frames import pictures_at
from slosh_bringup.replay.task import unique_names
from slosh_discovery.discover import discover
from slosh_discovery.discover.search import Progress
from slosh_discovery.discover_data.reading import files_at
from slosh_discovery.discovering import (
    DOCUMENT,
    DiscoveryRequest,
    Tell,
    make_report,
    prepare,
    write_results,
)
from slosh_discovery.discovery_report import DiscoveryReport
from slosh_discovery.discovery_report.words import verdict_sentence
from slosh_motion.checks.table_checks import InputDoubt
from slosh_motion.tables.motion_table import SUFFIXES, is_motion_table
from slosh_replay.recorded_run import RecordedRun
from slosh_report.document import Document


@dataclass(frozen=True, slots=True)
class Discovered:
    """Summary of the result of a discovery from one recording.

    Attributes:
        name: of its folder of results.
        summary: the verdict in a sentence.
        verdict: `named`, `none`, `ambiguous` or `unexplained`.
        effects: ids of the effects that the model lacks or has wrong.
        confidence: that these are they, from 0 to 1.
        closed: share of the removable height error that they explain; NaN: nothing to remove.
        notes: on the recording, one line each.
        warnings: why its data are doubtful, one line each.
        doubtful: whether one of them tells that an input is not what it claims to be.
        before: whether an earlier run has examined it, and it has not changed since.
    """

    name: str
    summary: str
    verdict: str
    effects: tuple[str, ...]
    confidence: float
    closed: float
    notes: tuple[str, ...]
    warnings: tuple[str, ...]
    doubtful: bool
    before: bool = False


def examine(
    request: DiscoveryRequest, folder: Path, tell: Tell, progress: Progress | None,
    threads: int | None,
) -> tuple[DiscoveryReport, Document]:  # fmt: skip
    """Runs a discovery and writes its files; returns the report and its document.

    Args:
        request: what is asked.
        folder: where the files are written, the final one or a temporary one.
        tell: is told what the reader must know of the data, one line each.
        progress: is told what is done and the share of it.
        threads: fits at a time; None: one per core.
    """
    notes: list[str] = []
    try:
        prepared = prepare(request, notes.append)
    finally:
        for note in notes:
            tell(note)
    finding = discover(
        prepared.fit, prepared.base, prepared.holdout, progress=progress, threads=threads
    )
    report = make_report(request, prepared, notes, finding, _pictures)
    return report, write_results(folder, report)


def each_recording(request: DiscoveryRequest) -> list[DiscoveryRequest]:
    """Splits a request into one request for each recording or table, with absolute paths.

    The results of each go to a folder of its own in the output folder, named after it.

    Raises:
        SloshDiscoveryError: nothing is at a path.
    """
    found = {file.resolve(): file.absolute() for path in request.data for file in files_at(path)}
    files = list(found.values())
    names = unique_names([_without_suffix(file) for file in files])
    return [
        replace(
            request,
            data=(file,),
            output=request.output.absolute() / name,
            model=None if request.model is None else request.model.absolute(),
            holdout=tuple(path.absolute() for path in request.holdout),
        )
        for file, name in zip(files, names, strict=True)
    ]


def discovery_task(request: DiscoveryRequest) -> Discovered:
    """Runs a discovery from one recording, unless an earlier run has finished it.

    Its results appear as a whole, and it is noted as finished after them.

    Raises:
        SloshDiscoveryError, SloshBagError, SloshModelError: it cannot be examined.
        SloshFileError: its folder of results holds something else.
    """
    finished, name = FinishedWork(request.output.parent), request.output.name
    state = _state(request)
    known = finished.find(name, state, Discovered)
    if known is not None and (request.output / DOCUMENT).is_file():
        return replace(known, before=True)
    if not finished.has(name):
        check_free(request.output)
        finished.begin(name)
    lines: list[str] = []
    # It may hold what a killed process has left, or results for data that have changed since.
    with new_folder(request.output, replace=True) as folder:
        report, _ = examine(request, folder, lines.append, None, threads=1)
    finding = report.finding
    doubts = [line for line in lines if isinstance(line, InputDoubt)]
    found = Discovered(
        name,
        verdict_sentence(finding),
        finding.verdict.value,
        tuple(effect.name for effect in finding.effects),
        finding.confidence,
        finding.gap.closed,
        tuple(str(line) for line in lines if not isinstance(line, InputDoubt)),
        tuple(str(line) for line in doubts),
        any(doubt.wrong for doubt in doubts),
    )
    finished.note(name, state, found)
    return found


def remove_unfinished_discoveries(requests: Sequence[DiscoveryRequest]) -> None:
    """Deletes temporary files of killed processes from the result folders."""
    for request in requests:
        remove_unfinished(request.output)
        with suppress(OSError):  # not empty: it holds results, or was never made
            request.output.rmdir()


def _state(request: DiscoveryRequest) -> str:
    """Returns a digest of all data and settings that affect a discovery's result."""
    inputs = [*request.data, *(file for path in request.holdout for file in files_at(path))]
    files = [one for path in inputs for one in _files(path)]
    options = (request.from_bag, request.most, sorted(request.groups.items()))
    return state_of(
        [*files, *([] if request.model is None else [request.model])],
        repr(options), repr(request.tables.words), version("slosh_bringup"),
    )  # fmt: skip


def _files(path: Path) -> list[Path]:
    return [path] if is_motion_table(path) else bag_files(path)


def _without_suffix(path: Path) -> Path:
    suffix = next((one for one in reversed(SUFFIXES) if path.name.endswith(one)), "")
    return path.with_name(path.name.removesuffix(suffix))


def _pictures(bag: Path, stamps: Mapping[str, int]) -> dict[str, tuple[bytes, float]]:
    return pictures_at(RecordedRun(bag), stamps)
