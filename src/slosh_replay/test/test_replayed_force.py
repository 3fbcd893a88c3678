"""Tests that a replay reproduces the heights of a force sensor, and what it leaves out."""

import json
import math

import numpy as np
import pytest

from slosh_estimator.observer.surface_heights import SurfaceHeights
from slosh_estimator.sensed.force_surface import ForceSurface, Motion
from slosh_estimator.sensed.payload import parse_payload
from slosh_estimator.sensed.surface import level_fields, wave_fields
from slosh_replay import replay_bag
from slosh_replay.manifest import Expectation
from slosh_replay.replay.checking import check_result
from slosh_testing.live_bag import MODEL, PARAMETERS, START, TYPES, LiveBag

MS = 1_000_000
SURFACE = "free_surface"
DOCUMENT = json.dumps({
    "natural_frequency": {"value": MODEL.mode_frequency(1)},
    "sloshing_mass": {"value": 0.17},
    "payload_mass": {"value": 1.2, "error": 0.002},
    "delay": {"value": 0.021},
    "directions": [{"container": [1.0, 0.0, 0.0], "sensor": [0.0, 1.0, 0.0]}],
    "residual_at_rest": 0.01,
    "residual_in_motion": 0.05,
})  # fmt: skip
NAN = math.nan


class ForceBag(LiveBag):
    """Recording of a sensor node with a force; `wrong` is added to its first height."""

    def __init__(self, *, cut: float = 0.0, wrong: float = 0.0, levels: bool = False) -> None:
        super().__init__()
        self._cut, self._wrong, self._levels = cut, wrong, levels
        self._force = ForceSurface(MODEL, parse_payload(DOCUMENT, "payload"))
        self._force_ns = START

    def entries(self, seconds):
        begin = START + round(1e9 * self._cut)
        found = super().entries(seconds)
        self._settings("sensor", 0, {"payload": DOCUMENT}, START - MS)
        entries = [*found, *(one for one in self._entries if one not in found)]
        return [one for one in entries if one[0] >= begin or one[1].endswith("settings")]

    def _estimate(self, estimator, estimate, gate, log_ns):
        super()._estimate(estimator, estimate, gate, log_ns)
        sample = estimate.sample
        motion = Motion(sample.stamp_ns, sample.ax, sample.ay, sample.yaw)
        self._tell(self._force.take_motion(motion), log_ns)
        # Forces come in bunches, as over a network.
        while sample.stamp_ns - self._force_ns > 30 * MS:
            for _ in range(7):
                self._force_ns += 4 * MS
                t = 1e-9 * (self._force_ns - START)
                push = [0.3 * math.sin(5.0 * t), 1.2 * sample.ax + math.sin(19.0 * t), 11.0]
                self._put_force(push, log_ns)
                self._tell(self._force.take_force(self._force_ns, *push), log_ns)

    def _put_force(self, push, log_ns):
        types = self._types
        vector = types["geometry_msgs/msg/Vector3"]
        wrench = types["geometry_msgs/msg/Wrench"](vector(*push), vector(0.0, 0.0, 0.0))
        self._put("force", self._force_ns, log_ns, wrench=wrench)

    def _tell(self, waves, log_ns):
        for wave in waves:
            fields = wave_fields(wave, MODEL.container.reaches[0])
            fields["msh"] += self._wrong
            self._wrong = 0.0
            self._put_surface(wave.stamp_ns, log_ns, fields)
            if self._levels:
                self._put_surface(wave.stamp_ns + MS, log_ns, level_fields(1e-3, 0.3, 1e-3))

    def _put_surface(self, stamp, log_ns, fields):
        unknown = SurfaceHeights(*(NAN,) * 11, 0)._asdict()
        none = np.empty(0, dtype=np.float32)
        self._put(
            SURFACE, stamp, log_ns, **unknown | fields, distance_to_rim=NAN, profile_azimuth=none,
            profile_height=none, peak_u=NAN, peak_v=NAN, peak_side=0,
        )  # fmt: skip

    def _surface(self, stamp, height, estimate, lag):
        """Adds nothing, since this cell has no camera."""


@pytest.fixture
def bag(tmp_path, monkeypatch):
    monkeypatch.setitem(TYPES, "force", "geometry_msgs/msg/WrenchStamped")
    monkeypatch.setitem(PARAMETERS, "sensor", {"beside_camera": False})
    return lambda **how: ForceBag(**how).write(tmp_path / "bag")


def test_heights_of_a_force_come_out_again_bit_for_bit(bag):
    found = replay_bag(bag()).verified[SURFACE]
    assert found.exact, found.lines()
    assert found.recorded > 80


def test_a_wrong_one_is_found_and_is_no_failure(bag):
    result = replay_bag(bag(wrong=1e-9))
    assert result.verified[SURFACE].recorded - result.verified[SURFACE].identical == 1
    assert check_result(result, Expectation(tolerance=0.0)).failures == ()


def test_heights_of_level_sensors_are_left_out(bag):
    found = replay_bag(bag(levels=True)).verified[SURFACE]
    assert found.exact, found.lines()


def test_from_the_middle_the_zero_of_the_sensor_is_found_again(bag):
    found = replay_bag(bag(cut=1.7)).verified[SURFACE]
    assert found.recorded > 30
    assert found.missing <= 27  # a zero is averaged first
    assert found.largest["msh"] < 2e-3
