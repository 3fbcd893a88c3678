import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from slosh_motion.inputs.gate import GateSettings, SampleGate, SampleVerdict

MS = 1_000_000
STILL, BAD = (0.0, 0.0, 0.0), (0.0, math.nan, 0.0)


def gate(**settings: float) -> SampleGate:
    made = SampleGate(GateSettings(**settings))
    assert made.judge(1000 * MS, STILL) is SampleVerdict.RESTART
    return made


def test_each_fault_is_dropped_and_counted_by_name() -> None:
    watched = gate()
    assert watched.judge(1000 * MS, STILL) is SampleVerdict.REPEATED
    assert watched.judge(999 * MS, STILL) is SampleVerdict.DISORDERED
    assert watched.judge(1001 * MS, BAD) is SampleVerdict.NOT_FINITE
    assert watched.judge(1001 * MS, (0.0, 2001.0, 0.0)) is SampleVerdict.IMPOSSIBLE
    assert watched.judge(1002 * MS, STILL, 1602 * MS) is SampleVerdict.STALE
    assert watched.judge(1602 * MS, STILL, 1002 * MS) is SampleVerdict.AHEAD
    assert watched.judge(0, STILL, 1002 * MS) is SampleVerdict.UNSTAMPED
    assert watched.judge(1003 * MS, (20.1, 0.0, 0.0), 1004 * MS) is SampleVerdict.JUMP
    assert (
        watched.judge(1003 * MS, STILL, 1004 * MS, SampleVerdict.IMPOSSIBLE)
        is SampleVerdict.IMPOSSIBLE
    )
    assert watched.judge(1003 * MS, STILL, 1004 * MS) is SampleVerdict.USE
    assert (watched.used, watched.dropped) == (2, 9)


def test_a_gap_restarts_and_its_limit_does_not() -> None:
    watched = gate(max_gap=0.05)
    assert watched.judge(1050 * MS, STILL) is SampleVerdict.USE
    assert watched.judge(1101 * MS, STILL) is SampleVerdict.APART
    assert watched.judge(1102 * MS, STILL) is SampleVerdict.RESTART
    assert watched.gaps == 1
    sorted_out = gate(confirms=False)
    assert sorted_out.judge(1101 * MS, STILL) is SampleVerdict.RESTART


def test_time_that_was_set_back_is_believed_after_some_samples() -> None:
    watched = gate(restart_after=5)
    verdicts = [watched.judge(k * MS, STILL) for k in range(1, 8)]
    assert (
        verdicts
        == [SampleVerdict.DISORDERED] * 4 + [SampleVerdict.RESTART] + [SampleVerdict.USE] * 2
    )


def test_one_stamp_far_in_the_future_does_not_block_for_ever() -> None:
    watched = gate(restart_after=5)
    watched.judge(10**15, STILL)
    watched.judge(10**15 + MS, STILL)
    verdicts = [watched.judge((1001 + k) * MS, STILL) for k in range(6)]
    assert verdicts[4:] == [SampleVerdict.RESTART, SampleVerdict.USE]


def test_a_spike_is_left_out_and_a_new_level_is_a_new_motion() -> None:
    watched = gate()
    spike, level = (0.0, 0.0, -200.0), (30.0, 1.0, 0.0)
    given_now = [spike, STILL, spike, spike, STILL, *[level] * 6, STILL]
    verdicts = [watched.judge((1001 + k) * MS, one) for k, one in enumerate(given_now)]
    out, use = SampleVerdict.JUMP, SampleVerdict.USE
    assert verdicts == [out, use, out, out, use, *[out] * 4, SampleVerdict.RESTART, use, out]


@given(
    st.lists(
        st.tuples(st.integers(0, 200), st.booleans(), st.none() | st.integers(0, 900)),
        max_size=100,
    )
)
def test_every_sample_is_counted_once_and_used_ones_increase_but_for_restarts(
    samples: list[tuple[int, bool, int | None]],
) -> None:
    watched = SampleGate(GateSettings(restart_after=3))
    last: int | None = None
    for stamp, finite, now in samples:
        verdict = watched.judge(
            stamp * MS, STILL if finite else BAD, None if now is None else now * MS
        )
        if verdict is SampleVerdict.USE:
            assert finite
            assert last is not None
            assert 0 < stamp - last <= 50
        if verdict in (SampleVerdict.USE, SampleVerdict.RESTART):
            last = stamp
    assert watched.used + watched.dropped == len(samples)


@given(
    st.lists(
        st.tuples(
            st.integers(-30, 90), st.booleans(), st.sampled_from([0.0, 5.0, 30.0, 3e3, math.nan])
        ),
        max_size=60,
    ),
    st.integers(1, 60),
)
def test_many_samples_at_once_are_judged_as_one_by_one(
    steps: list[tuple[int, bool, float]], size: int
) -> None:
    """Tests that many samples at once are judged as single ones, with gaps and jumps."""
    stamp, rows = 10**9, []
    for step, strange, push in steps:
        stamp += step * MS if strange else MS
        rows.append((stamp, (0.0, push if strange else 0.0, 0.0)))
    single, many = gate(restart_after=3), gate(restart_after=3)
    expected = [single.judge(*row) for row in rows]
    used: list[bool] = []
    restarted: list[bool] = []
    for start in range(0, len(rows), size):
        part = rows[start : start + size]
        use, again = many.judge_many(
            np.array([row[0] for row in part]), np.array([row[1] for row in part])
        )
        used += use.tolist()
        restarted += again.tolist()
    assert used == [verdict in (SampleVerdict.USE, SampleVerdict.RESTART) for verdict in expected]
    assert restarted == [verdict is SampleVerdict.RESTART for verdict in expected]
    assert (many.counts, many.used, many.dropped) == (single.counts, single.used, single.dropped)


def test_a_gate_names_the_unit_of_stamps_that_it_drops() -> None:
    gate = SampleGate(GateSettings())
    for k in range(400):
        now = 1_700_000_000 * 10**9 + k * 10_000_000
        second, fraction = divmod(now, 10**9)
        gate.judge(second * 10**9 + fraction // 1000, None, now)
    assert gate.dropped > 100
    assert "holds microseconds" in gate.unit.text
