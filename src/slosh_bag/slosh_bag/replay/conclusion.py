"""What a finished replay comes to."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_bag.errors import SloshBagError
from slosh_bag.replay.accuracy import Judgement, judge
from slosh_bag.replay.result import ReplayResult
from slosh_bag.replay.run import Parts, ReplayRun
from slosh_bag.replay.series import Series

DRAWN = 20_000
"""Images whose heights the result holds; of a longer run it holds the extremes."""
_PARTS = 4
"""Rows that each bin of a longer run is drawn by: both extremes of two curves."""


class Origin(NamedTuple):
    """What is known to differ between the recording and the replay; see Verification."""

    causes: tuple[str, ...] = ()
    rounds_otherwise: bool = False


def conclude(
    name: str, source: str, run: ReplayRun, parts: Parts, origin: Origin | None = None
) -> ReplayResult:
    """The result of a replay through which everything has gone.

    Args:
        name: of the bag or table.
        source: topic or file that drove the models.
        run, parts: the replay.
        origin: what is known to differ between the recording and the replay.

    Raises:
        SloshBagError: there is no usable input.
    """
    if not parts.reader.counters["samples_used"]:
        raise SloshBagError(f"{name}: holds no usable message of {source}")
    origin = origin or Origin()
    if parts.follow is not None:
        origin = origin._replace(causes=(*origin.causes, *parts.follow.remarks()))
    counters = {**parts.reader.counters, "images": run.images}
    if run.unused:
        counters["not_used_live"] = run.unused
    astray = _astray(run.strays)
    counters["unmatched_images"] = parts.monitor.monitor.unmatched
    spans = run.motions.spans
    names = parts.bank.names
    judged = judge(parts.series, names, spans) if len(parts.series) else Judgement()
    counters["spikes"] = judged.spikes
    rows = thinned(parts.series)
    return ReplayResult(
        name=name,
        source=source,
        stamps=rows["stamp"],
        measured=rows["measured"],
        heights={model: rows["heights"][:, column] for column, model in enumerate(names)},
        accuracy=judged.models,
        motions=judged.motions,
        events=tuple(run.events),
        counters=counters,
        azimuth=rows["azimuth"],
        model_azimuth=rows["model_azimuth"],
        flags=rows["flags"],
        verification=None if parts.verifier is None else parts.verifier.result(*origin),
        comparisons=None if parts.comparisons is None else parts.comparisons.result(),
        model=parts.bank.model,
        limits=parts.monitor.monitor.settings,
        warnings=tuple(f"{name}: {line}" for line in (astray, judged.warning) if line),
    )


def _astray(strays: Mapping[str, int]) -> str:
    """How many messages were set aside, in a line; empty: none."""
    told = [f"{count} {what}" for what, count in strays.items() if count]
    if not told:
        return ""
    return f"set aside {' and '.join(told)} whose stamps lie elsewhere in time"


def thinned(series: Series, limit: int = DRAWN) -> NDArray[np.void]:
    """The rows that a chart needs: all, or the extremes of equal parts of a long run.

    Args:
        series: the images.
        limit: about how many rows.
    """
    if len(series) <= limit:
        return series.read(0, len(series))
    kept = []
    size = -(-len(series) * _PARTS // limit)
    for block in series.blocks():
        for start in range(0, len(block), size):
            part = block[start : start + size]
            curves = (part["measured"], part["measured"] - part["heights"][:, -1])
            rows = {0}
            for curve in curves:
                known = np.flatnonzero(np.isfinite(curve))
                if len(known):
                    rows |= {
                        int(known[np.argmin(curve[known])]),
                        int(known[np.argmax(curve[known])]),
                    }
            kept.append(part[sorted(rows)])
    return np.concatenate(kept)
