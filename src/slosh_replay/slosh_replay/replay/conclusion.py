"""Assembles the result object of a finished replay."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_bag.errors import SloshBagError
from slosh_msgs_py.topics import ESTIMATE
from slosh_replay.replay.accuracy import Judgement, judge
from slosh_replay.replay.result import ReplayResult
from slosh_replay.replay.series import Series
from slosh_replay.replay.stream import ReplayStream
from slosh_replay.replay.verification import ORDER_UNKNOWN, Verification

DRAWN = 20_000
"""Images whose heights the result holds; of a longer run it holds the extremes."""
_PARTS = 4
"""Rows that each bin of a longer run is drawn by: both extremes of two curves."""


class Origin(NamedTuple):
    """Known reasons why a replay may differ from the recording; see Verification."""

    causes: tuple[str, ...] = ()
    rounds_otherwise: bool = False


def conclude(
    name: str, source: str, stream: ReplayStream, origin: Origin | None = None, left_out: int = 0
) -> ReplayResult:
    """Creates the result object of a finished replay.

    Args:
        name: of the bag or table.
        source: topic or file that drove the models.
        stream: the replay.
        origin: what is known to differ between the recording and the replay.
        left_out: recorded inputs that the live estimator did not take.

    Raises:
        SloshBagError: there is no usable input.
    """
    series, reader = stream.series, stream.setting.reader
    if not reader.counters["samples_used"]:
        raise SloshBagError(f"{name}: holds no usable message of {source}{reader.refusal}")
    reader.finish()
    estimator, feed = stream.estimator, stream.monitor.feed
    origin = origin or Origin()
    if estimator.untaken:
        causes = (*origin.causes, f"the recorded state cannot be restored: {estimator.untaken}")
        origin = origin._replace(causes=causes)
    verified = _verified(stream, origin)
    counters = {**reader.counters, "images": stream.images}
    unused = left_out + (verified[ESTIMATE].extra if ESTIMATE in verified else 0)
    if unused:
        counters["not_used_live"] = unused
    counters["unmatched_images"] = feed.monitor.unmatched
    names, laid = estimator.models.names, stream.alignment
    judged = Judgement()
    if laid is not None:
        judged = judge(series, names, clocks=laid.clocks)
    elif feed.monitor.settings.camera and len(series):
        judged = judge(series, names, stream.motions.spans)
    counters["spikes"] = judged.spikes
    said = (
        _astray(stream.strays),
        *reader.doubts,
        *reader.faults,
        feed.monitor.motions.clocks.text(),
        judged.warning,
        "" if laid is None else laid.drift,
        *reader.warnings(),
    )
    rows = thinned(series) if laid is None else series.read(0, len(series))
    heights = rows["heights"] if laid is None else laid.heights
    return ReplayResult(
        name=name,
        source=source,
        stamps=rows["stamp"],
        measured=rows["measured"],
        heights={model: heights[:, column] for column, model in enumerate(names)},
        accuracy=judged.models,
        motions=judged.motions,
        events=tuple(stream.monitor.events),
        counters=counters,
        still=None if laid is None else laid.still,
        azimuth=rows["azimuth"],
        model_azimuth=rows["model_azimuth"],
        flags=rows["flags"],
        verified=verified,
        model=estimator.models.model,
        limits=feed.settings,
        limit_changes=feed.changes,
        warnings=tuple(f"{name}: {line}" for line in said if line),
    )


def _verified(stream: ReplayStream, origin: Origin) -> dict[str, Verification]:
    """Compares estimates with the recorded ones, by the last part of topic names.

    Why estimates may differ is told of them, not of what follows from them, but for the order.
    """
    order = tuple(cause for cause in origin.causes if cause == ORDER_UNKNOWN)
    return {
        name: verifier.result(*(origin if name == ESTIMATE else origin._replace(causes=order)))
        for name, verifier in stream.verifiers.items()
    }


def _astray(strays: Mapping[str, int]) -> str:
    """Describes in one line how many messages were excluded; empty if none were."""
    told = [f"{count} {what}" for what, count in strays.items() if count]
    if not told:
        return ""
    return f"set aside {' and '.join(told)} with out-of-sequence stamps"


def thinned(series: Series, limit: int = DRAWN) -> NDArray[np.void]:
    """Returns the rows of a series to draw: all of a short run, the extremes of a long one.

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
