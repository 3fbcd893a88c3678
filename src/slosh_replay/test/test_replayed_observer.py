"""Tests that a replay reproduces the observer's fused estimates, also from the middle."""

import math

import numpy as np
import pytest

from slosh_bag import definitions
from slosh_estimator.observer.calm import CalmWatch, calm_fields
from slosh_estimator.observer.observer import Observer
from slosh_estimator.observer.states import fused_fields
from slosh_estimator.observer.surface_heights import SurfaceHeights, wall_heights
from slosh_estimator.sample import Sample
from slosh_replay import replay_bag
from slosh_replay.manifest import Expectation
from slosh_replay.replay.checking import check_result
from slosh_testing.live_bag import MODEL, START, TYPES, LiveBag

FUSED, STATE, SENSED = "fused_estimate", "observer_state", "sensed_surface"
CALM = "calm"
NAN = math.nan


class ObservedBag(LiveBag):
    """A recording of an estimator with an observer; `wrong` is added to the first height."""

    def __init__(self, *, cut: float = 0.0, wrong: float = 0.0, sensor: bool = False) -> None:
        super().__init__()
        self._sensor = sensor
        self.states = True
        self._observer, self._watch = Observer(self.model), CalmWatch(1e-3)
        self._calm_slot = -1
        self._cut, self._wrong, self._state_ns = cut, wrong, 0

    def entries(self, seconds):
        begin = START + round(1e9 * self._cut)
        return [
            entry
            for entry in super().entries(seconds)
            if entry[0] >= begin or entry[1].endswith("settings")
        ]

    def _estimate(self, estimator, estimate, gate, log_ns):
        super()._estimate(estimator, estimate, gate, log_ns)
        observer = self._observer
        state = observer.follow(estimate.sample, estimate.flags)
        if state is None:
            return
        if state.stamp_ns - self._state_ns >= 500_000_000:
            self._state_ns = state.stamp_ns
            self._put_state(observer.state())
        modal = np.array(state.modal).reshape(-1, 4)
        fields = fused_fields(state, observer.counts, observer.sensed)
        fields["msh"] += self._wrong
        calm = self._watch.update(state)
        if state.stamp_ns // 50_000_000 != self._calm_slot:
            self._calm_slot = state.stamp_ns // 50_000_000
            told = calm_fields(calm)
            told["bound"] += self._wrong
            self._put(CALM, state.stamp_ns, log_ns, **told)
        self._put(
            FUSED, state.stamp_ns, log_ns, modal_position=modal[:, :2].ravel(),
            modal_velocity=modal[:, 2:].ravel(), trusted=state.trusted, distance_to_rim=np.nan,
            **fields,
        )  # fmt: skip
        self._wrong = 0.0

    def _put_state(self, state):
        stamps = (-1 if one is None else one for one in (state.corrected_ns, state.judged_ns))
        corrected, judged = stamps
        self._put(
            STATE, state.stamp_ns, first_stamp=state.first_ns, corrected_stamp=corrected,
            judged_stamp=judged, counts=np.array(state.counts, dtype=np.uint64),
            rejected_in_turn=state.rejected, anchored_at=state.anchored_at, model=state.model,
            parameters=state.parameters, covariance=state.covariance, changes=state.changes,
            past=state.past, sensed=state.sensed,
            sensed_stamp=-1 if state.sensed_ns is None else state.sensed_ns,
        )  # fmt: skip

    def _surface(self, stamp, height, estimate, lag):
        super()._surface(stamp, height, estimate, lag)
        azimuth = estimate.nonlinear.azimuth
        unknown = SurfaceHeights(*(NAN,) * 11, 0)
        surface = unknown._replace(msh=height, azimuth=azimuth)
        self._observer.take(wall_heights(stamp, surface))
        if self._sensor:  # its newer heights come before the older ones of the camera
            newer = stamp + 20_000_000
            edge = unknown._replace(sh_left=height, azimuth_left=azimuth)
            none = np.empty(0, dtype=np.float32)
            self._put(
                SENSED, newer, **edge._asdict(), distance_to_rim=NAN, profile_azimuth=none,
                profile_height=none, peak_u=NAN, peak_v=NAN, peak_side=0,
            )  # fmt: skip
            self._observer.take(wall_heights(newer, edge), sensed=True)


@pytest.fixture
def bag(tmp_path, monkeypatch):
    monkeypatch.setitem(TYPES, FUSED, "slosh_msgs/msg/FusedEstimate")
    monkeypatch.setitem(TYPES, CALM, "slosh_msgs/msg/Calm")
    monkeypatch.setitem(TYPES, SENSED, "slosh_msgs/msg/FreeSurface")
    monkeypatch.setitem(TYPES, STATE, "slosh_msgs/msg/ObserverState")
    return lambda **how: ObservedBag(**how).write(tmp_path / "bag")


def failures(result):
    return check_result(result, Expectation(tolerance=0.0)).failures


def test_fused_estimates_come_out_again_bit_for_bit(bag):
    result = replay_bag(bag())
    found = result.verified[FUSED]
    assert found.exact, found.lines()
    assert found.recorded == 500
    calm = result.verified[CALM]
    assert calm.exact, calm.lines()
    assert calm.recorded > 50
    assert failures(result) == ()


@pytest.mark.parametrize("cut", [0.0, 1.7])
def test_with_a_sensor_beside_the_camera_too(bag, cut):
    written = bag(sensor=True, cut=cut)
    found = replay_bag(written).verified[FUSED]
    assert found.exact, found.lines()
    assert found.recorded > 250


LATER = {"sensed_taken", "sensed", "sensed_stamp"}


class OldBag(ObservedBag):
    """Recording of an older version, without sensors other than the camera."""

    def _put(self, *where, **fields):
        super()._put(*where, **{name: one for name, one in fields.items() if name not in LATER})


@pytest.mark.parametrize("cut", [0.0, 1.7])
def test_messages_of_an_older_version_are_read_with_a_note(bag, monkeypatch, tmp_path, cut):
    def read(name):
        found = now(name)
        for constants, fields in found.values():
            fields[:] = [field for field in fields if field[0] not in LATER]
            assert constants is not None
        return found

    now = definitions._read
    monkeypatch.setattr(definitions, "_read", read)
    bag = OldBag(cut=cut).write(tmp_path / "old")
    monkeypatch.undo()
    result = replay_bag(bag)
    found = result.verified[FUSED]
    assert found.exact, found.lines()
    assert found.recorded > 250
    assert any("without sensed_taken, taken as 0" in line for line in result.warnings)


def test_a_wrong_one_fails(bag):
    result = replay_bag(bag(wrong=1e-9))
    assert result.verified[FUSED].identical == 499
    assert any(FUSED in line for line in failures(result))
    assert any(CALM in line for line in failures(result))


def test_from_the_middle_of_a_run_they_do_from_the_next_state_on(bag):
    result = replay_bag(bag(cut=1.7))
    found = result.verified[FUSED]
    assert found.exact, found.lines()
    assert 0 < sum(found.unchecked.values()) < 60
    calm = result.verified[CALM]
    assert calm.exact, calm.lines()
    assert sum(calm.unchecked.values()) > 0
    assert found.recorded > 250


def test_the_state_of_an_observer_of_another_model_is_refused():
    observer = Observer(MODEL)
    observer.follow(Sample(START, 0.0, 0.0, 0.0, restarted=True))
    state = observer.state()
    Observer(MODEL).take_up(state)
    with pytest.raises(ValueError, match="observer of another model"):
        Observer(MODEL.with_effect("second_mode")).take_up(state)
