"""Explains why a recorded run has no heights to compare, or why the machine was too slow."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_bag.reader import BagReader, TopicInfo
from slosh_bringup.live.run_data import RunData, facts_of
from slosh_camera.measurement import Flag
from slosh_estimator.sight import UNUSABLE
from slosh_motion.inputs.inputs import MESSAGE_TYPES, TRANSFORMS
from slosh_motion.recorded.inputs import STAMP, stamps_of
from slosh_motion.recorded.sources import ESTIMATE, SURFACE
from slosh_msgs_py import topics
from slosh_replay.in_force import Starts, has_camera, image_topic, input_topic

MANY = 3
"""So many causes of one kind are named."""
LATE = 0.5
"""Stamps that lie this far behind the recorder's clock are old [s]."""

LOST_SAMPLES = 0.01
"""Above this share of late or lost samples the estimate is not what it could be."""
UNMEASURED_IMAGES = 0.3
"""Above this share of unmeasured images the comparison has holes."""
LATE_SAMPLES = 0.25
"""A robot is never that late with its own samples [s]."""


class Seen(NamedTuple):
    """Stamps and delay of the recorded messages of one topic.

    Attributes:
        stamps: (N,) theirs [ns].
        age: by how much the stamps lie behind the recorder's clock, median [s]; NaN: no message.
    """

    stamps: NDArray[np.int64]
    age: float


def shortfall(data: RunData, starts: Starts) -> tuple[str, ...]:
    """Lists the data missing from a run, one line each, root causes first.

    Without a camera, by choice, estimates are all that there can be.

    Args:
        data: the run.
        starts: what the nodes worked with, as far as they told.

    Raises:
        SloshBagError: the bag cannot be read.
    """
    if not has_camera(starts):
        return tuple(filter(None, [_input(data, starts)]))
    found = [line for line in (_input(data, starts), _images(data, starts)) if line]
    return tuple(found) or (_apart(data),)


def _input(data: RunData, starts: Starts) -> str:
    """Describes what is wrong with the estimator's recorded input; empty if nothing is."""
    facts = facts_of(data, "estimator")
    topic = input_topic(starts.get("estimator"))
    recorded = _count(data.topics, topic)
    came = max(int(facts.get("input total", 0)), recorded)
    if not came:
        return f"no messages received on {topic}, the input of the models"
    if _count(data.topics, _own(data, "estimate", ESTIMATE)):
        return ""
    reasons = _named(facts, "dropped: ")
    stamped = recorded and data.topics[topic].message_type != MESSAGE_TYPES[TRANSFORMS]
    age = _seen(data.run.reader, topic).age if stamped else float("nan")
    old = f"; their stamps are {age:.1f} s behind this machine's clock" if age > LATE else ""
    return (
        f"{came} messages received on {topic}, but none could be "
        f"used{reasons and f': {reasons}'}{old}"
    )


def _images(data: RunData, starts: Starts) -> str:
    """Describes what is wrong with the camera's recorded images; empty if nothing is."""
    facts = facts_of(data, "camera")
    topic = image_topic(starts.get("camera"))
    came = max(int(facts.get("image total", 0)), _count(data.topics, topic))
    surface = _own(data, "free_surface", SURFACE)
    if not came and not _count(data.topics, surface):
        return f"no images received on {topic}"
    measured, flags = _surfaces(data.run.reader, surface)
    if not measured:
        return f"{came} images received on {topic}, but none was measured in time"
    if not (flags & UNUSABLE == 0).any():
        names = ", ".join(
            f"{flag.name} {count}"
            for flag in Flag
            if (count := int(np.count_nonzero(flags & flag)))
        )
        return f"no free surface was found in any of {measured} images on {topic}: {names}"
    return ""


def _apart(data: RunData) -> str:
    """Describes measurements and estimates that do not overlap in time."""
    measured, estimated = (
        _seen(data.run.reader, _own(data, name, kind))
        for name, kind in (("free_surface", SURFACE), ("estimate", ESTIMATE))
    )
    ahead = (measured.stamps.min() - estimated.stamps.max()) * 1e-9
    behind = (estimated.stamps.min() - measured.stamps.max()) * 1e-9
    if max(ahead, behind) > 0.0:
        way = "ahead of" if ahead > 0.0 else "behind"
        return (
            f"the stamps of the images are {max(ahead, behind):.1f} s {way} those of the "
            "input: both must use the same clock"
        )
    count = len(measured.stamps)
    if measured.age > LATE:
        late = f"{measured.age:.1f} s after their images"
        return f"{count} heights were measured, most of them {late}: too late to be compared"
    return f"{count} heights were measured and estimated, but the monitor compared none of them"


def _named(facts: Mapping[str, str], prefix: str) -> str:
    """Formats the largest counters whose names have a prefix, e.g. 'stale 120, repeated 3'."""
    counts = {
        key.removeprefix(prefix): int(value)
        for key, value in facts.items()
        if key.startswith(prefix)
    }
    greatest = sorted(counts.items(), key=lambda item: -item[1])[:MANY]
    return ", ".join(f"{name} {count}" for name, count in greatest if count)


def _own(data: RunData, name: str, kind: str) -> str:
    """Returns the cell's topic whose name ends with `name`; empty if it has no messages."""
    return data.run.cell.topic(name, kind) or ""


def _count(known: Mapping[str, TopicInfo], topic: str) -> int:
    return (known[topic].count or 0) if topic in known else 0


def _seen(reader: BagReader, topic: str) -> Seen:
    stamps, logs = [np.empty(0, dtype=np.int64)], [np.empty(0, dtype=np.int64)]
    for block in reader.blocks([topic]):
        stamps.append(stamps_of(reader.columns(block, STAMP)))
        logs.append(np.asarray(block.log_ns, dtype=np.int64))
    found = np.concatenate(stamps)
    age = float(np.median(np.concatenate(logs) - found)) * 1e-9 if len(found) else float("nan")
    return Seen(found, age)


def _surfaces(reader: BagReader, topic: str) -> tuple[int, NDArray[np.int64]]:
    """Returns the number of recorded surface measurements, and their flags."""
    flags = [
        reader.columns(block, ("flags",))["flags"].astype(np.int64)
        for block in (reader.blocks([topic]) if topic else ())
    ]
    found = np.concatenate([np.empty(0, dtype=np.int64), *flags])
    return len(found), found


def slowness(data: RunData) -> str:
    """Describes signs that the machine was too slow, with figures; empty if there are none.

    On a robot nobody counts what was sent: the answer is empty.
    """
    cell, estimator, camera = (facts_of(data, node) for node in ("cell", "estimator", "camera"))
    sent, taken = _fact_count(cell, topics.ACCEL), _fact_count(cell, topics.IMAGE)
    if not sent:
        return ""
    used = _fact_count(estimator, "output total")
    measured = _fact_count(camera, "measurement total")
    left_out = _fact_count(cell, "images left out")
    late = _fact_count(cell, "late maximum [ms]") * 1e-3
    lost = sum(data.lost().values())
    found = []
    if sent - used > LOST_SAMPLES * sent:
        found.append(f"{sent - used} of {sent} samples were late or lost")
    if taken - measured > UNMEASURED_IMAGES * taken:
        found.append(f"{taken - measured} of {taken} images were not measured")
    if left_out:
        found.append(f"{left_out} images were not sent")
    if late > LATE_SAMPLES:
        found.append(f"samples were sent up to {late:.1f} s late")
    if lost > 0:
        found.append(f"{lost} messages were not recorded")
    return f"this machine is too slow for the demonstration: {', '.join(found)}" if found else ""


def _fact_count(facts: Mapping[str, str], key: str) -> int:
    return int(facts.get(key, 0))
