"""What a finished replay comes to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_bag.errors import SloshBagError
from slosh_replay.replay.accuracy import Judgement, judge
from slosh_replay.replay.result import ReplayResult
from slosh_replay.replay.series import Series
from slosh_replay.replay.stream import Components, ReplayStream
from slosh_replay.replay.verification import Verification

DRAWN = 20_000
"""Images whose heights the result holds; of a longer run it holds the extremes."""
_PARTS = 4
"""Rows that each bin of a longer run is drawn by: both extremes of two curves."""


class Origin(NamedTuple):
    """What is known to differ between the recording and the replay; see Verification."""

    causes: tuple[str, ...] = ()
    rounds_otherwise: bool = False


def conclude(
    name: str,
    source: str,
    stream: ReplayStream,
    components: Components,
    origin: Origin | None = None,
) -> ReplayResult:
    """The result of a replay through which everything has gone.

    Args:
        name: of the bag or table.
        source: topic or file that drove the models.
        stream, components: the replay.
        origin: what is known to differ between the recording and the replay.

    Raises:
        SloshBagError: there is no usable input.
    """
    reader = components.reader
    if not reader.counters["samples_used"]:
        raise SloshBagError(f"{name}: holds no usable message of {source}{reader.refusal}")
    reader.finish()
    origin = origin or Origin()
    if stream.untaken:
        causes = (*origin.causes, f"the recorded state cannot be restored: {stream.untaken}")
        origin = origin._replace(causes=causes)
    elif components.matcher is not None and components.known is None:
        origin = origin._replace(causes=(*origin.causes, *components.matcher.remarks()))
    counters = {**reader.counters, "images": stream.images}
    if stream.unused:
        counters["not_used_live"] = stream.unused
    astray = _astray(stream.strays)
    counters["unmatched_images"] = components.monitor.monitor.unmatched
    spans = stream.motions.spans
    names = components.models.names
    measured = components.monitor.monitor.settings.camera and len(components.series) > 0
    judged = judge(components.series, names, spans) if measured else Judgement()
    counters["spikes"] = judged.spikes
    clocks = components.monitor.monitor.motions.clocks.text()
    said = (
        astray, *reader.doubts, *reader.faults, clocks, judged.warning, *reader.warnings()
    )  # fmt: skip
    rows = thinned(components.series)
    return ReplayResult(
        name=name,
        source=source,
        stamps=rows["stamp"],
        measured=rows["measured"],
        heights={model: rows["heights"][:, column] for column, model in enumerate(names)},
        accuracy=judged.models,
        motions=judged.motions,
        events=tuple(stream.events),
        counters=counters,
        azimuth=rows["azimuth"],
        model_azimuth=rows["model_azimuth"],
        flags=rows["flags"],
        verification=_verification(components, origin),
        comparisons=None if components.comparisons is None else components.comparisons.result(),
        model=components.models.model,
        limits=components.monitor.settings,
        limit_changes=components.monitor.changes,
        warnings=tuple(f"{name}: {line}" for line in said if line),
    )


def _verification(components: Components, origin: Origin) -> Verification | None:
    """How the estimates compare with the recorded ones; None: none are recorded."""
    if components.verifier is None:
        return None
    counter = components.counter
    miscounted = counter.breaks if counter is not None else 0
    return replace(components.verifier.result(*origin), miscounted=miscounted)


def _astray(strays: Mapping[str, int]) -> str:
    """How many messages were set aside, in a line; empty: none."""
    told = [f"{count} {what}" for what, count in strays.items() if count]
    if not told:
        return ""
    return f"set aside {' and '.join(told)} with out-of-sequence stamps"


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
            one = block[start : start + size]
            curves = (one["measured"], one["measured"] - one["heights"][:, -1])
            rows = {0}
            for curve in curves:
                known = np.flatnonzero(np.isfinite(curve))
                if len(known):
                    rows |= {
                        int(known[np.argmin(curve[known])]),
                        int(known[np.argmax(curve[known])]),
                    }
            kept.append(one[sorted(rows)])
    return np.concatenate(kept)
