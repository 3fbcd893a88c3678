"""The one reader of measured heights, and that replay, table and discovery read by it."""

import numpy as np
import pytest

from slosh_estimator.sight import SurfaceFlag
from slosh_replay.recording.heights import SURFACE_FIELDS, HeightCollector, measurements
from slosh_replay.tables import bag_table

NAN = float("nan")


def columns(stamps, msh, flags, azimuth=0.5):
    """Columns of FreeSurface messages, as a bag's reader gives them."""
    count = len(stamps)
    return {
        "header.stamp.sec": np.array(stamps, dtype=np.int32),
        "header.stamp.nanosec": np.full(count, 5, dtype=np.uint32),
        "msh": np.array(msh, dtype=np.float64),
        "flags": np.array(flags, dtype=np.uint16),
        "msh_stddev": np.full(count, 1e-4),
        "azimuth": np.full(count, azimuth),
    }


def collected(*parts):
    collector = HeightCollector()
    for part in parts:
        collector.add(part)
    return collector.measurements()


def test_what_comes_in_parts_is_one_and_in_the_order_of_the_recording():
    found = collected(columns([3, 1], [0.1, 0.2], [0, 0]), columns([2], [0.3], [0]))
    assert found.stamps.tolist() == [3_000_000_005, 1_000_000_005, 2_000_000_005]
    assert found.heights.tolist() == [0.1, 0.2, 0.3]
    assert found.stddev.tolist() == [1e-4] * 3
    assert found.azimuth.tolist() == [0.5] * 3
    whole = measurements(columns([3, 1, 2], [0.1, 0.2, 0.3], [0, 0, 0]))
    assert all((a == b).all() for a, b in zip(found[:5], whole[:5], strict=True))


def test_in_order_keeps_of_each_stamp_what_was_recorded_first():
    found = collected(columns([2, 1, 2, 1], [0.1, 0.2, 0.3, 0.4], [0, 0, 0, 0])).in_order()
    assert found.stamps.tolist() == [1_000_000_005, 2_000_000_005]
    assert found.heights.tolist() == [0.2, 0.1]


@pytest.mark.parametrize(
    ("flag", "unusable", "saturated"),
    [
        (SurfaceFlag.SATURATED, False, True),
        (SurfaceFlag.NOT_FOUND, True, False),
        (SurfaceFlag.BAD_IMAGE, True, False),
        (SurfaceFlag.NOT_FOUND | SurfaceFlag.SATURATED, True, True),
        (SurfaceFlag.FROZEN, False, False),
    ],
)
def test_the_flags_tell_whether_there_is_a_height_and_whether_it_is_a_bound(
    flag, unusable, saturated
):
    found = collected(columns([1, 2], [0.1, NAN], [int(flag), 0]))
    assert found.unusable.tolist() == [unusable, False]
    assert found.saturated.tolist() == [saturated, False]
    assert np.isnan(found.usable_heights).tolist() == [unusable, True]
    assert found.heights[0] == 0.1  # as recorded


def test_a_table_takes_the_fields_that_a_replay_takes():
    assert HeightCollector.fields == SURFACE_FIELDS
    assert isinstance(bag_table.TableHeights([]).surfaces, HeightCollector)
