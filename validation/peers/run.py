"""Runs every method on every selected test case for which the result is missing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from validation.peers import rows
from validation.peers.ask import ask_discovery, ask_regressions
from validation.peers.chosen import SEED, TUNING_SEED, Job, jobs, name_of
from validation.peers.residual_network import ask_network
from validation.peers.tune import Tuned, tune


@dataclass(frozen=True, slots=True)
class Answers:
    """All results by test case, with the tuned settings of the regressions.

    Attributes:
        tuned: settings of the regressions.
        regressions, discovery, networks: rows of each.
    """

    tuned: Tuned
    regressions: dict[str, rows.Row]
    discovery: dict[str, rows.Row]
    networks: dict[str, rows.Row]


def run(folder: Path, rounds: int, networks: int) -> None:
    """Runs the missing cases of all methods and stores the results in a folder.

    Args:
        folder: of the rows.
        rounds: of cases.
        networks: how many cases a network is trained on.
    """
    tuned = tune(jobs(1, TUNING_SEED), folder / "tuning.jsonl")
    asked = jobs(rounds, SEED)
    single = [job for job in asked if job[0] == "single"]
    _each(asked, folder / "regressions.jsonl", lambda job: ask_regressions(job, tuned))
    _each(asked, folder / "discovery.jsonl", ask_discovery)
    _each(single[:networks], folder / "networks.jsonl", ask_network)


def known(folder: Path) -> Answers:
    """Reads the results in a folder; the discovery's only for cases of the other methods."""
    tuned = tune([], folder / "tuning.jsonl")
    regressions = rows.read(folder / "regressions.jsonl")
    discovery = rows.read(folder / "discovery.jsonl")
    return Answers(
        tuned,
        regressions,
        {case: discovery[case] for case in regressions if case in discovery},
        rows.read(folder / "networks.jsonl"),
    )


def _each(asked: list[Job], path: Path, ask: Callable[[Job], rows.Row]) -> None:
    done = rows.read(path)
    for number, job in enumerate(asked, 1):
        if name_of(job) not in done:
            rows.add(path, ask(job))
            print(f"{path.stem} {number}/{len(asked)} {name_of(job)}", flush=True)
