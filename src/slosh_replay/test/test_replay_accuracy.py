"""Tests which samples count for the mean absolute error and the peak error."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slosh_bag.errors import SloshBagError
from slosh_estimator.sight import SATURATED, SurfaceFlag
from slosh_motion.signals.metrics import mean_absolute_error, peak_error, rms_error
from slosh_replay.recording.heights import (
    SURFACE_FIELDS,
    HeightCollector,
    Measurements,
    measurements,
)
from slosh_replay.replay.accuracy import judge
from slosh_replay.replay.conclusion import thinned
from slosh_replay.replay.model_set import ModelHeights, at_images
from slosh_replay.replay.series import Series
from slosh_replay.replay.unrelated import align
from slosh_replay.tables import bag_table

STAMPS = np.arange(0, 1_000_000_000, 10_000_000, dtype=np.int64)
HEIGHT = 0.02


def series(measured, height=HEIGHT, flags=0, usable=True, motion=-1, block=64):
    """Returns rows of images with given heights."""
    measured = np.atleast_1d(measured)
    measured = np.broadcast_to(measured, max(len(measured), len(STAMPS)))
    found = Series(1, block)
    rows = np.zeros(len(measured), dtype=found.dtype)
    rows["stamp"] = 10_000_000 * np.arange(len(measured))
    rows["measured"], rows["flags"], rows["usable"] = measured, flags, usable
    rows["heights"][:, 0], rows["motion"] = height, motion
    found.append(rows)
    return found


def accuracy(rows: Series):
    return judge(rows, ["3D-NL"]).models[0]


def test_a_saturated_height_counts_only_above_the_estimate():
    """Tests that a saturated height counts only if it is above the estimate."""
    heights = np.where(np.arange(len(STAMPS)) < 60, 0.005, 0.03)
    row = accuracy(series(heights, flags=SATURATED))
    assert row.count == 40
    assert row.sigma == pytest.approx(0.01)


def test_estimates_from_an_unknown_state_do_not_count():
    judged = judge(series(0.01, usable=False), ["3D-NL"])
    assert judged.models == ()
    assert "state was unknown" in judged.warning


@pytest.mark.parametrize(
    ("measured", "height", "text"),
    [(np.nan, HEIGHT, "no image has a usable height"), (0.01, np.nan, "use the same clock")],
)
def test_why_nothing_counts_is_told(measured, height, text):
    judged = judge(series(measured, height), ["3D-NL"])
    assert judged.models == ()
    assert text in judged.warning


def test_each_motion_is_judged_by_its_own_images():
    motion = np.repeat([0, -1, 1], [40, 20, 40])
    rows = series(0.01 + 0.01 * (motion == 1), motion=motion)
    first, second = judge(rows, ["3D-NL"], [(0, 4 * 10**8), (6 * 10**8, 10**9)]).motions
    assert (first.start, first.end) == pytest.approx((0.0, 0.4))
    assert first.models[0].sigma == pytest.approx(0.01)
    assert second.models[0].sigma == pytest.approx(0.0)
    assert (first.peak, second.peak) == pytest.approx((0.01, 0.02))


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([1, 7, 64, 1000]))
def test_blocks_give_what_the_whole_series_gives(seed: int, block: int):
    random = np.random.default_rng(seed)
    measured = 0.01 * np.sin(np.arange(300) / 9.0) + 1e-4 * random.standard_normal(300)
    measured[random.random(300) < 0.1] = np.nan
    model = 0.011 * np.sin(np.arange(300) / 9.0)
    row = accuracy(series(measured, model, block=block))
    assert row.sigma == pytest.approx(mean_absolute_error(measured, model), rel=1e-12)
    assert row.rms == pytest.approx(rms_error(measured, model), rel=1e-12)
    assert row.epsilon == pytest.approx(peak_error(measured, model), rel=1e-12)


def test_a_long_series_keeps_its_extremes():
    measured = 0.01 * np.sin(np.arange(5000) / 50.0)
    measured[1234], measured[4000] = 0.5, -0.5
    rows = thinned(series(measured), limit=200)
    assert len(rows) < 400
    assert rows["measured"].max() == 0.5
    assert rows["measured"].min() == -0.5
    assert (np.diff(rows["stamp"]) > 0).all()


def estimates(stamps=STAMPS, flags=0):
    count = len(stamps)
    ramp = 1e-9 * stamps.astype(float)
    return ModelHeights(
        stamps, ramp[:, None], np.zeros(count), np.full(count, flags, dtype=np.int64)
    )


def test_there_is_no_estimate_within_a_gap_or_outside():
    stamps = np.concatenate((STAMPS[10:30], STAMPS[50:90]))
    known = np.isfinite(at_images(estimates(stamps), STAMPS).heights[:, 0])
    np.testing.assert_array_equal(np.flatnonzero(known), [*range(10, 30), *range(50, 90)])


def whole(acceleration=3.0, shift=5.0, level=0.004):
    t = np.arange(0.0, 12.0, 1 / 60)

    def wave(x):
        inside = (x > 0.0) & (x < 4.0)
        return np.where(inside, 0.02 * np.sin(np.pi * x / 4.0) ** 2 * (2 + np.sin(7 * x)), 0.0)

    stamps = np.arange(0, 4_000_000_000, 2_000_000, dtype=np.int64)
    heights = np.repeat(wave(stamps * 1e-9)[:, None], 4, axis=1)
    none = np.full(len(t), np.nan)
    accelerations = acceleration * np.outer(np.cos(3e-9 * np.pi * stamps), (1.0, 0.0, 0.0))
    none, whole = np.full(len(t), np.nan), np.zeros(len(t), dtype=np.int64)
    azimuth, flags = np.zeros(len(stamps)), np.zeros(len(stamps), dtype=int)
    return (
        ModelHeights(stamps, heights, azimuth, flags, accelerations=accelerations),
        Measurements(np.rint(t * 1e9).astype(int), level + wave(t - shift), whole, none, none),
    )


def test_still_level_is_taken_off_where_the_clocks_are_unrelated():
    found = align("run", *whole())
    assert found.still.level == pytest.approx(0.004)
    assert found.clocks[0].offset == pytest.approx(5.0, abs=2e-3)
    assert np.nanmean(np.abs(found.heights[:, 0] - found.measured.heights)) < 2e-4


def test_a_container_that_does_not_move_is_refused():
    with pytest.raises(SloshBagError, match="does not move"):
        align("run", *whole(acceleration=0.0))


# The one reader of measured heights, and that replay, table and discovery read by it.


NAN = float("nan")


def columns(stamps, msh, flags, azimuth=0.5):
    """Returns columns of FreeSurface messages as the bag reader gives them."""
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
