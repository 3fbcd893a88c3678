import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slosh_base.files.nanoseconds import SECOND
from slosh_estimator.errors import SloshEstimatorError
from slosh_estimator.estimator import Estimate, Estimator
from slosh_estimator.validity import EstimateFlag, settling_seconds
from slosh_model.limits import ValidityLimits
from slosh_model.model import Model
from slosh_model.model_text import parse_model
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.shapes.rectangle import Rectangle
from slosh_model.simulate import Inputs, simulate
from slosh_motion.inputs.sampling import Sample, Samples

MODEL = Model(Cylinder(0.05, 0.07, rim_height=0.09)).spatial()
TICK = 1_953_125  # ns: 1/512 s, exact in binary, so that both clocks have the same intervals
MS = 1_000_000


def run(estimator: Estimator, count: int, a: tuple[float, float, float], first: int = 0) -> int:
    flags = 0
    for k in range(first, first + count):
        flags |= estimator.update(Sample(k * MS, *a, 0.0, k == first)).flags
    return flags


@settings(max_examples=20, deadline=None)
@given(
    st.lists(
        st.tuples(st.integers(1, 12), *[st.floats(-8.0, 8.0, allow_subnormal=False)] * 3),
        min_size=2,
        max_size=60,
    )
)
def test_online_equals_offline_bit_for_bit(
    steps: list[tuple[int, float, float, float]],
) -> None:
    ticks = np.cumsum([step[0] for step in steps])
    acceleration = np.array([step[1:] for step in steps])
    estimator = Estimator(MODEL)
    online = [
        estimator.update(Sample(int(tick) * TICK, *map(float, a), 0.0, k == 0))
        for k, (tick, a) in enumerate(zip(ticks, acceleration, strict=True))
    ]
    inputs = Inputs(ticks / 512.0, acceleration)
    for twin, answers in (
        (MODEL.linear(), [e.linear for e in online]),
        (MODEL.nonlinear(), [e.nonlinear for e in online]),
    ):
        offline, _ = simulate(twin, inputs)
        assert [a.sh_x for a in answers] == offline.sh_x.tolist()
        assert [a.sh_y for a in answers] == offline.sh_y.tolist()
        modal = [a.modal for a in answers]
        assert modal == offline.modal.reshape(len(answers), -1).tolist()


def bits(estimator: Estimator, parts: list[list[Sample]]) -> list[bytes]:
    """Returns all columns of consecutive results as bytes."""
    tables = [estimator.update_many(Samples.of(part)) for part in parts]
    return [
        b"".join(column.tobytes() for column in columns) for columns in zip(*tables, strict=True)
    ]


@settings(max_examples=40, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.integers(1, 40 * MS),
            *[st.floats(-9.0, 9.0, allow_subnormal=False)] * 3,
            st.sampled_from([0.0, 0.0, 0.3, -2.5]),
            st.integers(0, 7),
        ),
        min_size=1,
        max_size=40,
    ),
    st.integers(1, 40),
)
def test_many_samples_at_once_give_the_bits_of_one_by_one(
    steps: list[tuple[int, float, float, float, float, int]], size: int
) -> None:
    samples, stamp = [], 0
    for index, (interval, ax, ay, az, yaw, event) in enumerate(steps):
        stamp += interval
        runaway = 1e7 if event == 6 else 1.0  # leads the models out of the physical range
        samples.append(Sample(stamp, runaway * ax, ay, az, yaw, index == 0 or event == 7))
    one_by_one = [[sample] for sample in samples]
    parts = [samples[i : i + size] for i in range(0, len(samples), size)]
    single, many = Estimator(MODEL), Estimator(MODEL)
    assert bits(single, one_by_one) == bits(many, parts)
    assert single.divergences == many.divergences
    online = Estimator(MODEL)
    answers = [online.update(sample) for sample in samples]
    table = Estimator(MODEL).update_many(Samples.of(samples))
    assert [a.flags for a in answers] == table.flags.tolist()
    assert [a.jerk for a in answers] == table.jerk.tolist()
    assert [list(a.linear[:4]) for a in answers] == table.heights[:, 0].tolist()
    assert [list(a.nonlinear[:4]) for a in answers] == table.heights[:, 1].tolist()
    assert [a.nonlinear.modal for a in answers] == table.modal[:, 1].reshape(
        len(answers), -1
    ).tolist()


def test_a_diverging_model_is_reset_flagged_and_counted() -> None:
    estimator = Estimator(MODEL)
    flags = run(estimator, 400, (1e5, 0.0, 0.0))
    assert flags & EstimateFlag.DIVERGED
    assert estimator.divergences > 0
    assert 0 <= flags < 2**16
    calm = estimator.update(Sample(10**10, 0.0, 0.0, 0.0, 0.0, True))
    assert math.isfinite(calm.linear.msh)
    assert math.isfinite(calm.nonlinear.msh)


@pytest.mark.parametrize(
    ("norm", "expected"),
    [
        (7.9, 0),
        (8.1, EstimateFlag.PLANARITY_LOST),
        (9.6, EstimateFlag.PLANARITY_LOST | EstimateFlag.ACCELERATION_LIMIT),
    ],
)
def test_acceleration_limits(norm: float, expected: int) -> None:
    estimate = Estimator(MODEL).update(Sample(0, 0.6 * norm, 0.0, 0.8 * norm, 0.0, True))
    assert estimate.flags == expected


@pytest.mark.parametrize(
    ("jerk", "expected"),
    [
        (55.0, 0),
        (65.0, EstimateFlag.PLANARITY_LOST),
        (80.0, EstimateFlag.PLANARITY_LOST | EstimateFlag.JERK_LIMIT),
    ],
)
def test_jerk_of_a_ramp(jerk: float, expected: int) -> None:
    estimator = Estimator(MODEL)
    for k in range(95):
        estimate = estimator.update(Sample(k * MS, jerk * k * 1e-3 - 4.0, 0.0, 0.0, 0.0, k == 0))
    assert estimate.jerk == pytest.approx(jerk, rel=0.02)
    assert estimate.flags == expected


def test_limits_come_from_the_model_and_the_rim_from_the_container() -> None:
    model = Model(Cylinder(0.05, 0.07, rim_height=0.072), limits=ValidityLimits(acceleration=1.0))
    flags = run(Estimator(model), 150, (2.0, 0.0, 0.0))
    assert flags == EstimateFlag.ACCELERATION_LIMIT | EstimateFlag.ABOVE_RIM


TANK = Model(Rectangle(0.06, 0.04, 0.067, rim_height=0.079), damping_ratio=0.02)


def test_limits_of_a_rectangle_are_those_of_tm20s_motions_and_its_corner_spills() -> None:
    assert run(Estimator(TANK), 150, (1.7, 0.0, 0.0)) == EstimateFlag.NONE
    assert run(Estimator(TANK), 150, (1.9, 0.0, 0.0)) == EstimateFlag.PLANARITY_LOST
    # Neither side's middle reaches the rim, the corner between them does.
    either = [run(Estimator(TANK), 150, push) for push in ((1.7, 0.0, 0.0), (0.0, 1.2, 0.0))]
    both = run(Estimator(TANK), 150, (1.7, 1.2, 0.0))
    assert [flags & EstimateFlag.ABOVE_RIM for flags in (*either, both)] == [0, 0, 8]


def test_reset_and_load_model_start_from_rest() -> None:
    estimator = Estimator(MODEL)
    run(estimator, 150, (3.0, 0.0, 0.0))
    estimator.reset()
    assert estimator.update(Sample(200 * MS, 3.0, 0.0, 0.0)).linear.msh == 0.0
    estimator.load_model(MODEL.planar())
    assert estimator.names == ("2D-L", "2D-NL")
    assert estimator.update(Sample(201 * MS, 3.0, 0.0, 0.0)).linear.msh == 0.0


def wave(estimator: Estimator, k: int) -> Estimate:
    return estimator.update(Sample(k * MS, 4.0 * math.sin(0.0185 * k), 0.0, 0.0, 0.0, k == 0))


@pytest.mark.parametrize("how", ["reset", "load_model"])
def test_what_starts_anew_in_motion_settles(how: str) -> None:
    """Tests that heights are flagged SETTLING after a restart during motion."""
    estimator = Estimator(MODEL)
    for k in range(800):
        assert not wave(estimator, k).flags & EstimateFlag.SETTLING
    estimator.reset() if how == "reset" else estimator.load_model(MODEL.planar())
    assert all(wave(estimator, k).flags & EstimateFlag.SETTLING for k in range(800, 900))
    estimator.reset()  # and again while it settles
    assert wave(estimator, 900).flags & EstimateFlag.SETTLING


@pytest.mark.parametrize("how", ["reset", "load_model"])
@pytest.mark.parametrize("tilt", [0.0, 0.1])
def test_what_starts_anew_at_rest_is_known(how: str, tilt: float) -> None:
    model = MODEL.with_effect("static_tilt", roll=tilt, pitch=0.0)
    estimator = Estimator(model)
    run(estimator, 50, (0.0, 0.0, 0.0))
    estimator.reset() if how == "reset" else estimator.load_model(MODEL)
    assert not run(estimator, 50, (0.0, 0.0, 0.0), first=50)


@pytest.mark.parametrize("blocks", [False, True])
def test_an_input_that_begins_in_motion_settles(blocks: bool) -> None:
    """Tests SETTLING from the sample that shows it until the wave from before has decayed."""
    model = Model.from_cup(diameter=0.08, fill_height=0.06)
    lasts = settling_seconds(model)
    count, shown = int(10 * (lasts + 2.0)), 3
    stamps = np.arange(count, dtype=np.int64) * (SECOND // 10)
    moving = np.arange(count) == shown
    samples = Samples(
        stamps, np.zeros((count, 3)), np.zeros(count), np.arange(count) == 0, moving=moving
    )
    estimator = Estimator(model)
    if blocks:
        flags = estimator.update_many(samples).flags
    else:
        flags = np.array([estimator.update(samples.one(k)).flags for k in range(count)])
    settling = flags & int(EstimateFlag.SETTLING) != 0
    until = stamps[shown] + round(lasts * SECOND)
    assert settling.tolist() == ((stamps >= stamps[shown]) & (stamps < until)).tolist()


def test_an_input_with_which_no_liquid_can_rest_gives_no_height() -> None:
    model = MODEL.nonlinear().with_effect("static_tilt", roll=0.3, pitch=0.3)
    estimator = Estimator(model.with_effect("accel_gain", gain=5.0))
    for k in range(300):
        estimate = estimator.update(Sample(k * MS, 2000.0, -2000.0, -2000.0, 0.0, k == 0))
        assert 0 <= estimate.flags < 2**16
        if estimate.flags & EstimateFlag.DIVERGED:
            assert not 0.0 < estimate.nonlinear.msh < 1e-3


def test_a_state_that_is_taken_up_gives_the_same_bits_and_flags() -> None:
    """Tests that a restored state gives identical results and flags."""
    model = MODEL.with_effect("draining_film", speed=0.01)
    live, other = Estimator(model, at_rest=False), Estimator(model)
    samples = [Sample(k * MS, math.sin(0.02 * k), 0.3, 0.0) for k in range(1200)]
    for sample in samples[:1000]:
        live.update(sample)
    state = live.state()
    assert state is not None
    other.take_up(state)
    for sample in samples[1000:]:
        assert repr(live.update(sample)) == repr(other.update(sample))


def test_a_state_of_another_model_is_refused_and_changes_nothing() -> None:
    live, other = Estimator(MODEL.with_effect("second_mode")), Estimator(MODEL)
    run(live, 10, (1.0, 0.0, 0.0))
    state = live.state()
    assert state is not None
    with pytest.raises(SloshEstimatorError, match="the model has"):
        other.take_up(state)
    assert other.state() is None


# A cup by its contour, with a mode as its model file has it: nothing is solved.
CUP = """
container:
  {shape: frustum, bottom_radius: 0.028, top_radius: 0.04, height: 0.09, fill_height: 0.06}
modes:
- {axis: x, natural_frequency: 21.6, reach: 0.036, mass_ratio: 0.32,
  height_per_displacement: 1.49, mass_height: -0.03, crest_ratio: 1.0, crest_place: 0.036,
  layer_damping: 7.0, bulk_damping: 200.0}
effects: [{name: vertical_acceleration}]
"""


def test_a_shape_with_a_linear_model_alone_publishes_nothing_as_nonlinear() -> None:
    estimator = Estimator(parse_model(CUP))
    assert estimator.names == ("3D-L", "3D-L")
    low = [estimator.update(Sample(k * MS, 0.5, 0.2, 0.0, 0.0, k == 0)) for k in range(500)]
    assert all(e.linear == e.nonlinear for e in low)
    assert {e.flags for e in low} == {EstimateFlag.LINEAR_ONLY}


def test_waves_too_high_for_the_linear_model_are_flagged() -> None:
    model = parse_model(CUP)
    estimator = Estimator(model)
    found = [estimator.update(Sample(k * MS, 1.5, 0.0, 0.0, 0.0, k == 0)) for k in range(500)]
    limit = model.container.linear_height
    assert max(e.linear.msh for e in found) > limit
    for e in found:
        beyond = bool(e.flags & EstimateFlag.BEYOND_LINEAR)
        assert beyond == (e.linear.msh > limit)


def test_a_cylinder_raises_neither_flag() -> None:
    both = EstimateFlag.LINEAR_ONLY | EstimateFlag.BEYOND_LINEAR
    assert not run(Estimator(MODEL), 500, (2.0, 0.0, 0.0)) & both
