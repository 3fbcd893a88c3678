"""Tests which messages the endurance run counts as missing."""

from __future__ import annotations

import numpy as np
import pytest

from slosh_base.files.nanoseconds import SECOND
from validation.long_runs import endurance

IMAGE = SECOND // 20


def columns(stamps: np.ndarray) -> dict[str, np.ndarray]:
    """Returns the columns of a stream's messages with given stamps [ns] and no drops."""
    sec, nanosec = np.divmod(stamps, SECOND)
    return {"header.stamp.sec": sec, "header.stamp.nanosec": nanosec,
            "samples_dropped": np.zeros_like(stamps)}  # fmt: skip


def recorded(comparison: np.ndarray, images: np.ndarray) -> endurance.Stream:
    """Returns the stream of comparisons of a recording in which all other streams are complete."""
    every = columns(np.arange(images[0], images[-1] + 1, SECOND // 1000))
    read = {name: columns(images) for name in ("free_surface", "cell/truth")}
    read |= {"accel": every, "estimate": every, "comparison": columns(comparison)}
    return endurance.recorded_streams(read)["comparison"]


IMAGES = 1_000 * SECOND + IMAGE * np.arange(200)
KILL = int(IMAGES[50])
SILENT = IMAGES[(IMAGES > KILL) & (IMAGES < KILL + 3 * SECOND)]
"""The images that a monitor which was killed does not compare."""
LEFT = np.setdiff1d(IMAGES, SILENT)


@pytest.mark.parametrize("words", [[], [KILL + 2 * SECOND + 7, KILL + 5 * SECOND // 2 + 7]])
def test_what_a_restarted_monitor_says_of_no_height_does_not_divide_its_gap(
    words: list[int],
) -> None:
    stream = recorded(np.sort(np.append(LEFT, words).astype(np.int64)), IMAGES)
    assert endurance.gaps(stream, [KILL]) == (len(SILENT), 0, [])


def test_a_gap_that_no_kill_explains_is_told_with_its_moment() -> None:
    stream = recorded(LEFT, IMAGES)
    assert endurance.gaps(stream, []) == (0, 0, [(KILL, len(SILENT))])
    later = KILL + round(2 * endurance.BACK * SECOND)
    assert endurance.gaps(stream, [later])[2] == [(KILL, len(SILENT))]
