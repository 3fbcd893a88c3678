"""Tests that clipped, frozen, mixed and missing samples are found."""

import numpy as np
import pytest
from honest_inputs import honest_input

from slosh_motion.checks.input_faults import FaultKind, FaultWatch, find_input_faults

T = np.arange(0.0, 4.0, 0.004)
WINDOW = np.where(T < 3.0, np.sin(np.pi * T / 3.0) ** 2, 0.0)
SMOOTH = WINDOW[:, np.newaxis] * np.column_stack(
    [3.0 * np.sin(13.0 * T), 2.5 * np.cos(11.0 * T), np.sin(9.0 * T)]
)


def noisy(values, size=0.02):
    return values + size * np.random.default_rng(3).normal(size=values.shape)


def kinds(values, t=T):
    return [fault.kind for fault in find_input_faults(t, values)]


@pytest.mark.parametrize("values", [SMOOTH, noisy(SMOOTH)], ids=["exact", "noisy"])
class TestFaults:
    def test_a_clipped_axis_is_told_with_its_value_and_when(self, values):
        found = find_input_faults(T, np.clip(values, -1.8, 1.8))
        assert {fault.kind for fault in found} == {FaultKind.CLIPPED}
        assert {(fault.axis, fault.value) for fault in found} == {
            (0, 1.8), (0, -1.8), (1, 1.8), (1, -1.8)
        }  # fmt: skip
        first = found[0]
        assert np.abs(values[np.searchsorted(T, first.start), first.axis]) >= 1.8
        assert first.times > 1
        axis = ("ax", "ay")[first.axis]
        assert first.text().startswith(f"{axis} is clipped at {first.value:.4g} m/s² from ")
        assert "times more" in first.text()
        assert first.text().endswith("raise it and record again")

    def test_a_frozen_input_is_told(self, values):
        frozen = values.copy()
        start, end = np.searchsorted(T, [1.1, 1.3])
        frozen[start:end] = frozen[start]
        (fault,) = find_input_faults(T, frozen)
        assert (fault.kind, fault.times) == (FaultKind.FROZEN, 1)
        assert fault.start == pytest.approx(1.1, abs=0.005)
        assert fault.end == pytest.approx(1.3, abs=0.005)
        assert "repeats its values from 1.10 to 1.30 s" in fault.text()

    def test_a_missing_stretch_is_told(self, values):
        kept = (T < 1.1) | (T > 1.25)
        (fault,) = find_input_faults(T[kept], values[kept])
        assert fault.kind is FaultKind.MISSING
        assert "no samples from 1.10 to 1.25 s" in fault.text()


def trapezoid(ramp):
    """Returns accelerations of a move there and back, with straight or smooth ramps."""
    at = [0.5, 0.5 + ramp, 1.0, 1.0 + 2.0 * ramp, 1.6, 1.6 + ramp, 4.0]
    value = np.interp(T, at, [0.0, 3.0, 3.0, -3.0, -3.0, 0.0, 0.0])
    return np.column_stack([value, 0.5 * value, np.zeros_like(T)])


@pytest.mark.parametrize("ramp", [0.001, 0.01, 0.1])
def test_a_planned_plateau_is_no_fault(ramp):
    assert kinds(trapezoid(ramp)) == []
    quarter = np.sin(0.5 * np.pi * trapezoid(max(ramp, 0.05))[:, :1] / 3.0)
    assert kinds(quarter * np.array([3.0, 1.5, 0.0])) == []
    # Sampled at another rate, beside its corners.
    t = np.arange(0.0013, 3.9, 0.0077)
    sampled = np.column_stack([np.interp(t, T, column) for column in trapezoid(ramp).T])
    assert kinds(sampled, t) == []


def test_a_rounded_input_is_no_clipped_one():
    for quantum in (0.01, 0.04):
        for values in (SMOOTH, noisy(SMOOTH)):
            assert kinds(quantum * np.round(values / quantum)) == []


def test_a_rest_and_a_short_record_have_no_faults():
    assert kinds(np.zeros((len(T), 3))) == []
    gap = (T < 0.05) | (T > 3.2)
    assert kinds(0.0 * SMOOTH[gap], T[gap]) == []
    assert kinds(SMOOTH[:10], T[:10]) == []


@pytest.mark.parametrize(("every", "behind"), [(1, 0.3e-3), (1, 1.6e-3), (3, 2.1e-3)])
def test_two_publishers_on_one_topic_are_told(every, behind):
    """Tests that two publishers on one topic are detected."""
    other = T[::every] + behind
    t = np.concatenate([T, other])
    order = np.argsort(t)
    values = np.concatenate([noisy(SMOOTH), noisy(-0.7 * SMOOTH[::every, [1, 0, 2]])])[order]
    (fault,) = find_input_faults(t[order], values)
    assert fault.kind is FaultKind.MIXED
    assert "several publishers are mixed on its topic; stop one of them" in fault.text()
    # Neither are they two where the liquid's container stands still.
    assert kinds(0.01 * values, t[order]) == []


def test_a_stream_tells_the_faults_of_its_parts_once():
    watch = FaultWatch()
    long = np.arange(0.0, 40.0, 0.004)
    window = np.sin(np.pi * long / 40.0) ** 2
    values = noisy(3.0 * window[:, np.newaxis] * np.sin(np.outer(long, [13.0, 11.0, 9.0])))
    values[3000:3050] = values[3000]
    values[6000:6050] = values[6000]
    values[:, 1] = values[:, 1].clip(max=2.0)
    stamps = 10**18 + np.rint(long * 1e9).astype(np.int64)
    for part in np.array_split(np.arange(len(long)), 97):
        watch.add(stamps[part], values[part])
    watch.finish()
    frozen, clipped = sorted(watch.faults, key=lambda fault: fault.axis)
    assert (frozen.kind, frozen.times) == (FaultKind.FROZEN, 2)
    assert frozen.start == pytest.approx(12.0, abs=0.01)
    assert (clipped.kind, clipped.axis, clipped.value) == (FaultKind.CLIPPED, 1, 2.0)
    assert clipped.times > 3


@pytest.mark.first(2)
@pytest.mark.parametrize("kind", ["acceleration", "force"])
@pytest.mark.parametrize("bits", [None, 16])
def test_honest_inputs_are_neither_clipped_nor_frozen(kind, bits):
    """Tests that correct inputs, also coarsely rounded ones, are not reported."""
    told = []
    for seed in range(2000, 2030):
        source = honest_input(seed)
        values = getattr(source, kind)
        if bits is not None:
            step = 1.02 * np.abs(values).max() / 2.0 ** (bits - 1)
            values = step * np.round(values / step)
        watch = FaultWatch(has_gravity=kind == "force")
        for part in np.array_split(np.arange(len(values)), len(values) // 40):
            watch.add(source.stamps[part], values[part])
        watch.finish()
        told += [one.text() for one in watch.faults if one.kind is not FaultKind.MISSING]
    assert told == []


def test_a_planned_motion_without_noise_has_no_faults():
    for seed in range(2000, 2030):
        source = honest_input(seed)
        t = (source.stamps - source.stamps[0]) * 1e-9
        assert [k for k in kinds(source.true, t) if k is not FaultKind.MISSING] == [], seed


def test_a_clipped_force_is_told_with_gravity_in_it():
    force = noisy(SMOOTH) + np.array([0.0, 0.0, 9.81])
    watch = FaultWatch(has_gravity=True)
    stamps = np.rint(1e9 * T).astype(np.int64)
    for stamp, row in zip(stamps.tolist(), force.clip(max=10.3).tolist(), strict=True):
        watch.take(stamp, tuple(row))
    watch.finish()
    (fault,) = watch.faults
    assert (fault.kind, fault.axis, fault.value) == (FaultKind.CLIPPED, 2, pytest.approx(10.3))
