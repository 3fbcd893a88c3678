"""Tests the measured rate of an input and its gain for sloshing modes."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slosh_model.constants import GRAVITY
from slosh_motion.errors import SloshMotionError
from slosh_motion.inputs.frames import SensorTransform
from slosh_motion.inputs.gate import GateSettings, SampleVerdict
from slosh_motion.inputs.inputs import InputSettings
from slosh_motion.inputs.pose_filter import PoseFilter
from slosh_motion.inputs.pose_input import PoseInput
from slosh_motion.inputs.sampling import MEMORY, Sampling, gap_sentence, interpolation_gain
from slosh_motion.inputs.sensor_inputs import AccelInput, ImuInput
from slosh_motion.tuning import TUNING

MS = 1_000_000
CUP = ((1, 21.0),)
LEVEL = (0.0, 0.0, 0.0, 1.0)


def told(intervals: list[int], modes=CUP) -> Sampling:
    sampling = Sampling("samples")
    sampling.carry(modes)
    for interval in intervals:
        sampling.take(interval, restarted=False)
    return sampling


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("rate", "gain"), [(18, 0.8916), (20, 0.9114), (30, 0.9598), (50, 0.9854), (1000, 1.0)]
)
def test_straight_lines_between_samples_lose_a_share_of_a_wave(rate: int, gain: float) -> None:
    """Tests the gain of linear interpolation against a sampled sine wave."""
    w, fine = 21.0, 200
    assert interpolation_gain(w, 1.0 / rate) == pytest.approx(gain, abs=1e-4)
    t = np.arange(round(400 * math.tau / w * rate) + 1) / rate
    between = np.arange(len(t) * fine - fine) / (rate * fine)
    wave = np.interp(between, t, np.sin(w * t))
    whole = between < math.floor(t[-1] * w / math.tau) * math.tau / w
    projected = 2.0 * np.mean(wave[whole] * np.sin(w * between[whole]))
    assert projected == pytest.approx(gain, abs=2e-3)


@pytest.mark.first(1)
@pytest.mark.parametrize("rate", [20, 30, 45, 60, 125, 500])
def test_the_gain_of_poses_is_what_passes_of_a_wave(rate: int) -> None:
    w = 21.0
    reader = PoseInput(GateSettings(max_gap=0.2), 0.0)
    reader.sampling.carry(((1, w),))
    samples = [
        sample
        for k in range(40 * rate)
        for sample in reader.update(
            round(k * 1e9 / rate), (0.01 * math.sin(w * k / rate), 0.0, 0.0), LEVEL
        )
    ]
    t, a = np.array([(1e-9 * sample.stamp_ns, 100.0 * sample.ax) for sample in samples]).T
    fine = np.arange(t[0], t[0] + 100 * math.tau / w, 1e-4)
    wave = np.interp(fine, t, a)
    passed = 2.0 * np.mean(wave * -np.sin(w * fine)) / w**2
    out_of_phase = 2.0 * np.mean(wave * np.cos(w * fine)) / w**2
    assert passed == pytest.approx(reader.sampling.gains()[1], abs=1e-3)
    assert out_of_phase == pytest.approx(0.0, abs=1e-3)
    assert passed > 0.97


def test_the_window_is_the_longest_that_carries_the_fastest_mode() -> None:
    for w in (10.0, 21.0, 45.0):
        chosen = PoseFilter.of(((1, w),), 0.0)
        assert chosen.gain(w, 0.02 / w) == pytest.approx(0.995, abs=1e-3)
        longer = PoseFilter(w, 1.2 * TUNING.reach / w)
        assert longer.gain(w, 0.02 / w) < 0.991


@pytest.mark.parametrize("jitter", [0.0, 0.1, 0.5])
@pytest.mark.parametrize("lost", [0.0, 0.1])
def test_jitter_and_lost_samples_do_not_hide_the_rate(jitter: float, lost: float) -> None:
    random = np.random.default_rng(1)
    t = np.arange(1000) + random.uniform(-jitter, jitter, 1000)
    stamps = np.sort(t)[random.random(1000) >= lost] * 8 * MS
    found = told(np.diff(stamps).astype(int).tolist()).interval_ns
    assert found == pytest.approx(8 * MS, rel=0.05 + jitter)


@settings(deadline=None)
@given(
    st.lists(st.tuples(st.integers(0, 60), st.booleans()), min_size=1, max_size=200),
    st.lists(st.integers(1, 80), min_size=1, max_size=20),
    st.integers(0, 200),
)
def test_many_at_once_and_one_by_one_are_judged_alike(
    given_ms: list[tuple[int, bool]], parts: list[int], cut: int
) -> None:
    """Tests that many samples at once give the same rate as single ones."""
    one, many, later = (told([]) for _ in range(3))
    flags = []
    for k, (interval, restarted) in enumerate(given_ms):
        if k == cut:
            later.take_up(one.memory)
        one.take(interval * MS, restarted=restarted)
        later.take(interval * MS, restarted=restarted)
        flags.append(one.slow)
    intervals = np.array([interval * MS for interval, _ in given_ms])
    restarted = np.array([flag for _, flag in given_ms])
    bounds = [0, *np.cumsum(parts).tolist(), len(given_ms)]
    found = [
        many.take_many(intervals[a:b], restarted[a:b])
        for a, b in itertools.pairwise(bounds)
        if a < b
    ]
    if bounds[-2] <= len(given_ms):
        assert np.concatenate(found).tolist() == flags
        assert repr(many.memory) == repr(one.memory)
    if cut < len(given_ms):
        assert repr(later.memory) == repr(one.memory)


def test_what_is_not_carried_is_said_with_a_remedy() -> None:
    assert told([10 * MS] * 8).sentence() == ""
    assert told([50 * MS] * 8).sentence() == (
        "samples arrive at 20 Hz: the gain at mode 1 (3.3 Hz) is 0.91, and the estimate is too "
        "low; publish at 35 Hz or more, or use a faster sensor"
    )
    third = told([20 * MS] * 8, ((1, 21.0), (2, 36.0), (3, 45.0)))
    assert "the gain at mode 2 (5.7 Hz) is 0.96" in third.sentence()
    assert [round(gain, 2) for gain in third.gains().values()] == [0.99, 0.96, 0.93]


def test_a_recording_of_old_is_not_judged() -> None:
    for kind in ("accel", "imu", "pose"):
        reader = InputSettings(kind, pose_window=21, modes=CUP).reader(kind)
        for _ in range(100):
            reader.sampling.take(50 * MS, restarted=False)
        assert not reader.sampling.slow
        assert reader.sampling.sentence() == ""


def test_memories_of_old_are_taken_up_and_those_of_other_inputs_are_not() -> None:
    accel, imu = (
        AccelInput(GateSettings(), ("world",)),
        ImuInput(GateSettings(), SensorTransform()),
    )
    accel.take_up(0, [1.0, 2.0, 3.0])
    imu.take_up(0, [0.0] * 9)
    assert len(accel.memory) == 3 + MEMORY
    for reader in (imu, PoseInput(GateSettings())):
        with pytest.raises(SloshMotionError, match="input with 37 values"):
            reader.take_up(0, accel.memory)
    with pytest.raises(SloshMotionError, match="input with 43 values"):
        accel.take_up(0, imu.memory)


@pytest.mark.parametrize("confirms", [True, False])
def test_samples_that_are_all_gaps_are_named(confirms: bool) -> None:
    """Tests that samples too far apart to be connected are reported."""
    imu = ImuInput(GateSettings(confirms=confirms), SensorTransform())
    imu.sampling.carry(CUP)
    for k in range(40):
        sample = imu.update(k * 52 * MS, (0.0, 0.0, GRAVITY), (0.0, 0.0, 0.0))
    gate = imu.gate
    assert gap_sentence(gate, gate.used, gate.counts[SampleVerdict.RESTART]) == (
        "samples arrive every 52 ms, but max_gap is 50 ms: each sample counts as a restart "
        "after a gap, and nothing is estimated; set max_gap to 0.1 s, or publish at 30 Hz or more"
    )
    assert imu.sampling.slow
    assert sample is None or sample.slow
    assert gap_sentence(gate, 100, 3) == ""
