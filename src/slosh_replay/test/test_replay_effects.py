"""Tests replays of models with every effect, with and without attitude."""

import sys
from pathlib import Path

import numpy as np
import pytest
from example_effects import STRENGTHS
from scipy.spatial.transform import Rotation

from slosh_estimator.monitor_settings import MonitorSettings
from slosh_model.measure import predicted_heights
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.simulate import Inputs
from slosh_motion.tables.motion_table import MotionTable
from slosh_replay.replay import replay_bag, replay_table
from slosh_replay.replay.setting import Outputs
from slosh_replay.tables.table_bag import write_table_bag

BASE = Model(Cylinder(0.05, 0.07), damping_ratio=0.02).nonlinear()
# The base is nonlinear already; a slower loss and a stronger drag suit these motions.
NONLINEAR = {"surface_nonlinearity", "pendulum_nonlinearity"}
"""The estimator always shows both models, with these and without."""
OF_RECTANGLES = {"amplitude_stiffening"}
ADDED = {name: p for name, p in STRENGTHS.items() if name not in NONLINEAR | OF_RECTANGLES} | {
    "fill_loss": {"rate": 0.005, "fixed_zero": 1.0},
    "yaw_coupling": {"kappa": 0.8},
}


class Kept(Outputs):
    """Receiver that keeps the comparisons."""

    def __init__(self) -> None:
        self.rows = []

    def comparisons(self, comparisons) -> None:
        self.rows += comparisons


def table(truth: Model, *, turning: bool = True) -> MotionTable:
    """Returns a table of a motion with tilt and yaw, and the heights a camera reads."""
    t = np.arange(0.0, 4.0, 0.002)
    swell = np.where((t > 0.5) & (t < 3.5), np.sin(np.pi * (t - 0.5) / 3.0) ** 2, 0.0)[:, None]
    waves = (4.0 * np.sin(13.0 * t), 3.0 * np.cos(11.0 * t), 2.0 * np.sin(9.0 * t))
    tips = (0.2 * np.sin(4.0 * t), 0.1 * np.cos(3.0 * t), 1.0 * np.sin(2.0 * t))
    attitude = Rotation.from_rotvec(swell * np.column_stack(tips)).as_quat()
    acceleration = swell * np.column_stack(waves)
    inputs = Inputs(t, acceleration, attitude if turning else None)
    msh = np.full(len(t), np.nan)
    msh[::8] = predicted_heights(truth, inputs, t[::8])[:, 0]
    return MotionTable(t, acceleration, inputs.attitude, msh=msh)


def sigma(result, model: Model) -> float:
    return {row.name: row for row in result.accuracy}[model.name].sigma


@pytest.mark.first(8)
@pytest.mark.parametrize("name", ADDED)
def test_the_right_effect_closes_the_gap(name: str) -> None:
    model = BASE.with_effect(name, **ADDED[name])
    measured, kept = table(model), Kept()
    right = replay_table("right", measured, model, outputs=kept)
    # A delay that grows falls between the estimates, which are joined by straight lines.
    assert sigma(right, model) < (3e-6 if name == "clock_drift" else 1e-6)
    assert sigma(replay_table("wrong", measured, BASE), BASE) > 1e-4
    # And so does the monitor see it.
    gaps = [abs(row.residual_nonlinear) for row in kept.rows]
    assert np.nanmax(gaps) < (1e-4 if name == "clock_drift" else 1e-5)
    assert np.isfinite(gaps).sum() > 240


@pytest.mark.parametrize("tau", [0.7, -0.7])
def test_the_parts_in_which_a_recording_comes_do_not_matter_to_a_delay(
    tau: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = BASE.with_effect("time_offset", tau=tau)
    measured, kept = table(model), {}
    for block in (50_000, 150):
        monkeypatch.setattr(sys.modules[replay_table.__module__], "_BLOCK", block)
        kept[block] = outputs = Kept()
        result = replay_table("delayed", measured, model, outputs=outputs)
        row = {row.name: row for row in result.accuracy}[model.name]
        assert row.count > 200
        assert row.sigma < 1e-6
    assert repr(kept[150].rows) == repr(kept[50_000].rows)


def test_the_limit_is_watched_by_the_liquid_s_own_height() -> None:
    hidden = BASE.with_effect("frame_saturation", cap=0.004)
    result = replay_table(
        "hidden", table(hidden), hidden, MonitorSettings(0.005, 0.005, disagreement_limit=0.001)
    )
    assert {event.source.name for event in result.events} == {"ESTIMATED"}
    assert np.nanmax(result.measured) == 0.004


def test_the_bag_of_a_table_is_replayed_with_its_attitude(tmp_path: Path) -> None:
    model = BASE.with_effect("gravity_tilt")
    measured = table(model)
    write_table_bag(Path("tilted.csv"), measured, tmp_path / "bag")
    result = replay_bag(tmp_path / "bag", model)
    assert result.source == "/slosh/accel"
    assert sigma(result, model) < 1e-6
    assert result.warnings == ()
    # A model that lacks the tilt gets it, as by `predict` of the same table.
    added = replay_bag(tmp_path / "bag", BASE)
    assert sigma(added, model) < 1e-6
    assert any("gravity_tilt is added" in line for line in added.warnings), added.warnings
