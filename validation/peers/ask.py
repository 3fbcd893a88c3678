"""Runs all sparse regressions, or the discovery, on one test case."""

from __future__ import annotations

import math
import time

import numpy as np

from slosh_discovery.discover.workflow import discover
from validation.blind.score import run_case
from validation.peers.chosen import NOISES, Job, case_of
from validation.peers.gap import closed
from validation.peers.library import EFFECT_OF, TERMS, names
from validation.peers.oracle import base_of, oracle
from validation.peers.rows import Row
from validation.peers.sindy import METHODS, Answer, Data
from validation.peers.tune import Tuned, label


def ask_regressions(job: Job, tuned: Tuned) -> Row:
    """Runs every sparse regression on a test case; returns results and scores by noise."""
    case = case_of(job)
    fit, held_out = oracle(case)
    hidden = set(case.hidden)
    given: list[tuple[str, str, Answer, float]] = []
    for noise in NOISES:
        data = Data(fit, noise, job[1])
        for method, answer in METHODS.items():
            start = time.process_time()
            found = answer(data, tuned[label(noise)][method])
            given.append((label(noise), method, found, time.process_time() - start))
    shares = closed(
        base_of(case), held_out, np.array([found.coefficients for *_, found, _ in given])
    )
    row: Row = {"case": case.name, "kind": case.kind, "hidden": sorted(hidden)}
    for (noise_label, method, found, seconds), share in zip(given, shares, strict=True):
        said = names(found.support, hidden)
        row.setdefault(noise_label, {})[method] = {
            "support": {term: _value(found, term) for term in found.support},
            "exact": said == hidden,
            "false": sorted(said - hidden),
            "confidence": _confidences(found, said),
            "closed": share if math.isfinite(share) else None,
            "cpu_seconds": round(seconds, 3),
        }
    return row


def ask_discovery(job: Job) -> Row:
    """Runs the discovery on a test case and returns the scored result."""
    return run_case(discover, *job)


def _value(found: Answer, term: str) -> float:
    return float(found.coefficients[TERMS.index(term)])


def _confidences(found: Answer, said: set[str]) -> dict[str, float]:
    """Returns, by effect, the largest share of ensemble models with one of its terms."""
    return {
        effect: max(share for term, share in found.inclusion.items() if EFFECT_OF[term] == effect)
        for effect in sorted(said)
        if found.inclusion
    }
