"""Tunes the settings of each sparse regression on test cases that are not reported."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from validation.peers import rows
from validation.peers.chosen import NOISES, Job, case_of, name_of
from validation.peers.library import names
from validation.peers.oracle import oracle
from validation.peers.sindy import METHODS, Data, grid

Tuned = Mapping[str, Mapping[str, Mapping[str, float]]]


def label(noise: float) -> str:
    """Formats a noise in mm as a JSON key."""
    return f"{1e3 * noise:g} mm"


def tune(jobs: list[Job], path: Path) -> Tuned:
    """Returns, by noise and method, the settings with the most exact results.

    Args:
        jobs: tuning cases to run first.
        path: of the rows of all of them; what is there is not run again.
    """
    known = rows.read(path)
    for job in jobs:
        if name_of(job) not in known:
            rows.add(path, _tried(job))
            print(f"tuned on {name_of(job)}", flush=True)
    tried = list(rows.read(path).values())
    return {
        label(noise): {method: _best(tried, label(noise), method) for method in METHODS}
        for noise in NOISES
    }


def _tried(job: Job) -> rows.Row:
    """Returns, by noise and method, exactness and false effects for every setting."""
    case = case_of(job)
    fit, _ = oracle(case)
    hidden = set(case.hidden)
    row: rows.Row = {"case": case.name}
    for noise in NOISES:
        data = Data(fit, noise, job[1])
        row[label(noise)] = {}
        for method, answer in METHODS.items():
            said = [names(answer(data, each).support, hidden) for each in grid(method)]
            row[label(noise)][method] = [[each == hidden, len(each - hidden)] for each in said]
    return row


def _best(tried: list[rows.Row], noise: str, method: str) -> dict[str, float]:
    settings = grid(method)

    def worth(index: int) -> tuple[int, int]:
        scores = [row[noise][method][index] for row in tried]
        return sum(score[0] for score in scores), -sum(score[1] for score in scores)

    return settings[max(range(len(settings)), key=worth)]
