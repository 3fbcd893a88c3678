"""Generates a year of motions of several cells, as contents of a large fleet store.

The numbers follow no measurement; they have what the page and queries look for: a container whose
frequency falls and whose level drifts, rare events, motions that several bags have.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import fields, replace
from datetime import UTC, datetime

import numpy as np

from slosh_base.files.nanoseconds import SECOND
from slosh_fleet.motions.motion_row import MotionRow

FIRST_NS = int(datetime(2026, 1, 5, 6, tzinfo=UTC).timestamp()) * SECOND
DAY = 86_400
CELLS = 4
SHIFT = 8 * 3600.0
"""Time of a day in which a cell moves [s]."""
LIMIT = 0.02
PARTS = 50
"""Every so many bags a copied part of one, with other paths of the same motions."""


def bags_of_motions(motions: int, bags: int) -> Iterator[list[MotionRow]]:
    """Yields the motions of each bag; each bag holds one shift of one of CELLS cells.

    Args:
        motions: of all bags together, about.
        bags: number of bags.
    """
    rng = np.random.default_rng(40)
    each = -(-motions // bags)
    days = -(-bags // CELLS)
    for number in range(bags):
        day, cell = divmod(number, CELLS)
        rows = _shift(rng, number, day, cell, each, day / days)
        yield rows
        if number % PARTS == PARTS - 1:
            yield [replace(row, bag=f"{row.bag}_part") for row in rows[: each // 2]]


def _shift(
    rng: np.random.Generator, bag: int, day: int, cell: int, count: int, share: float
) -> list[MotionRow]:
    """Returns one cell's motions on one day; `share` is the elapsed fraction of the year."""
    begin = FIRST_NS + (day * DAY + 8 * 3600 * (cell % 2)) * SECOND
    starts = begin + (np.sort(rng.uniform(0.0, SHIFT, count)) * SECOND).astype(np.int64)
    peak = rng.gamma(9.0, 0.001, count)
    frequency = 18.9 * (1.0 - 0.02 * share * (cell == 1)) + rng.normal(0.0, 0.02, count)
    values = {
        "begin_ns": starts,
        "duration": rng.uniform(0.6, 2.0, count),
        "acceleration": rng.uniform(0.5, 4.0, count),
        "measured_peak": np.where(rng.random(count) < 0.05, np.nan, peak),
        "linear_peak": peak * rng.normal(0.95, 0.02, count),
        "nonlinear_peak": peak * rng.normal(1.0, 0.01, count),
        "measured_limit": np.full(count, LIMIT),
        "estimated_limit": np.full(count, LIMIT),
        "sigma_linear": rng.gamma(4.0, 1e-4, count),
        "sigma_nonlinear": rng.gamma(4.0, 5e-5, count),
        "epsilon_linear": rng.normal(-0.05, 0.02, count),
        "epsilon_nonlinear": rng.normal(0.0, 0.01, count),
        "images": rng.integers(30, 120, count),
        "calm_time": rng.gamma(4.0, 0.5, count),
        "natural_frequency": frequency,
        "natural_frequency_stddev": np.full(count, 0.02),
        "damping_ratio": rng.normal(0.0062 + 0.001 * share * (cell == 2), 2e-4, count),
        "damping_ratio_stddev": np.full(count, 2e-4),
        "level": rng.normal(-0.0015 * share * (cell == 3), 2e-4, count),
        "events": (peak > LIMIT).astype(int),
        "measured_flags": np.zeros(count, int),
        "estimate_flags": np.zeros(count, int),
    }
    texts = {
        "cell": f"line_{cell}", "bag": f"/bags/line_{cell}/{bag:05d}", "container": "cylinder",
        "model_digest": hashlib.sha256(bytes([cell])).hexdigest(),
    }  # fmt: skip
    digests = [raw.hex() for raw in (rng.bytes(32) for _ in range(count))]
    columns = {name: values[name].tolist() for name in values} | {"digest": digests}
    columns |= {name: [text] * count for name, text in texts.items()}
    names = [one.name for one in fields(MotionRow)]
    return [MotionRow(*row) for row in zip(*(columns[name] for name in names), strict=True)]
