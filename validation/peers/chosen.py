"""Selects the test cases for the comparison of methods."""

from __future__ import annotations

from validation.blind.cases import Case, case_name, make_case
from validation.blind.hidden import LISTED
from validation.peers.library import EXPRESSIBLE

SEED, TUNING_SEED = 3, 9
"""Of the cases that are reported, those of the discovery's own page, and of those tuned on."""
NOTHING = 3
"""Cases with nothing hidden, in each round."""
NOISES = (1e-4, 5e-4)
"""Standard deviations of the noise on the latent coordinates [m]."""

Job = tuple[str, int, int]


def jobs(rounds: int, seed: int) -> list[Job]:
    """Returns kind, index and seed of the cases: each expressible effect, and none hidden."""
    found: list[Job] = []
    for turn in range(rounds):
        first = turn * len(LISTED)
        effects = [first + k for k, name in enumerate(LISTED) if name in EXPRESSIBLE]
        found += [("single", index, seed) for index in effects]
        found += [("none", NOTHING * turn + k, seed) for k in range(NOTHING)]
    return found


def name_of(job: Job) -> str:
    """Returns the name of a test case."""
    return case_name(*job, None, None)


def case_of(job: Job) -> Case:
    """Creates the test case."""
    return make_case(*job)
