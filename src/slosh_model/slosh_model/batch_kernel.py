"""Compiled integration of many simulations at once, one in each SIMD lane.

A block of trajectories, one to a lane, goes through time together. Each quantity is a row with a
value per lane; all rows lie in one flat array, each at a place that is known when the code is
compiled, so that the loops over the lanes become vector instructions without checks for overlap.
The operations and their order are those of `slosh_model.kernel`: the answers are the same bits.
"""

from __future__ import annotations

import numpy as np
from numba.types import boolean, int64, void

from slosh_base.compiled.compilation import (
    CHANGED_2,
    CHANGED_3,
    GIVEN_2,
    GIVEN_3,
    compiled,
    entry_point,
)
from slosh_model.effects.registry import DRIVE_MEMORY_COUNT, PARAMETER_COUNT
from slosh_model.indices import (
    AX,
    AY,
    AZ,
    DAMPING,
    FORCE_X,
    FORCE_Y,
    FREQUENCY,
    FREQUENCY_RATIO,
    GAIN,
    GAIN_Y,
    INPUT_COUNT,
    MASS_XX,
    MASS_XY,
    MASS_YY,
    POSE_COUNT,
    STATE_COUNT,
    TURN,
    VX,
    VY,
    X,
    Y,
)
from slosh_model.kernel import (
    UPRIGHT,
    along_mode,
    constants_of,
    in_axes,
    lightness,
    pose_at,
    turned,
    unwrapped,
)
from slosh_model.lane_chains import all_lane_drives, all_lane_modulations, all_lane_terms
from slosh_model.lane_rows import (
    ACCELERATION,
    ALONG,
    AXES,
    BEGIN,
    CONSTANTS,
    ELAPSED,
    HEIGHTS,
    INPUTS,
    INTERVAL,
    LANES,
    LEFT_INPUTS,
    LENGTH,
    LIFT,
    MODE,
    MOMENT,
    NEW_INPUTS,
    OLD_INPUTS,
    PARAMETERS,
    POSE,
    RIGHT_INPUTS,
    START,
    STATE,
    STATIC_HEIGHT,
    STEP,
    SUMS,
    TOTAL,
    YAW,
)
from slosh_model.layout import records

_CHUNK = 16  # samples that are fetched, and answered, together
_GIVEN, _ANSWERS = 5 * LANES, 3 * LANES  # numbers per sample of a chunk
_STAGE_WEIGHTS = (1.0, 2.0, 2.0, 1.0)
_STAGE_SHARES = (0.0, 0.5, 0.5, 1.0)


@compiled
def _copy(lanes, w, source, target, count):  # type: ignore[no-untyped-def]
    for row in range(count):
        for k in range(lanes):
            w[target + row * LANES + k] = w[source + row * LANES + k]


@compiled
def _blend(lanes, w, left, right, share, target):  # type: ignore[no-untyped-def]
    """Interpolates the inputs of each simulation between two samples; `share` is in [0, 1]."""
    for row in range(INPUT_COUNT):
        at = row * LANES
        for k in range(lanes):
            u0, u1 = w[left + at + k], w[right + at + k]
            w[target + at + k] = u0 + share * (u1 - u0)


@compiled
def _accelerate(lanes, w):  # type: ignore[no-untyped-def]
    """Computes q̈ of one mode in each simulation; see `kernel.modal_acceleration`."""
    all_lane_terms(lanes, w)
    for k in range(lanes):
        omega, zeta = w[MODE + FREQUENCY * LANES + k], w[MODE + DAMPING * LANES + k]
        omega_y = omega * w[MODE + FREQUENCY_RATIO * LANES + k]
        x, y = w[STATE + X * LANES + k], w[STATE + Y * LANES + k]
        vx, vy = w[STATE + VX * LANES + k], w[STATE + VY * LANES + k]
        fx = (
            w[SUMS + FORCE_X * LANES + k]
            - 2.0 * zeta * omega * vx
            - omega * omega * x
            - w[INPUTS + AX * LANES + k]
        )
        fy = w[SUMS + FORCE_Y * LANES + k] - 2.0 * zeta * omega_y * vy - omega_y * omega_y * y
        fy -= w[INPUTS + AY * LANES + k]
        mxx, mxy = w[SUMS + MASS_XX * LANES + k] + 1.0, w[SUMS + MASS_XY * LANES + k]
        myy = w[SUMS + MASS_YY * LANES + k] + 1.0
        inverse = 1.0 / (mxx * myy - mxy * mxy)
        w[ACCELERATION + k] = inverse * (myy * fx - mxy * fy)
        w[ACCELERATION + LANES + k] = inverse * (mxx * fy - mxy * fx)


@compiled
def _take_slope(lanes, w, weight, share):  # type: ignore[no-untyped-def]
    """Adds a Runge-Kutta stage's weighted slope to the step's sum; advances the state by it."""
    for row in range(STATE_COUNT):
        at = row * LANES
        slope = at + (STATE if row < VX else ACCELERATION - STATE_COUNT * LANES) + VX * LANES
        for k in range(lanes):
            value = w[slope + k]
            w[TOTAL + at + k] += weight * value
            w[STATE + at + k] = w[START + at + k] + share * w[STEP + k] * value


@compiled
def _step(lanes, w, modulated):  # type: ignore[no-untyped-def]
    """Makes one classical Runge-Kutta step of a mode in each simulation."""
    for row in range(STATE_COUNT):
        for k in range(lanes):
            w[START + row * LANES + k] = w[STATE + row * LANES + k]
            # Minus zero: the first slope stays what it is, its sign included.
            w[TOTAL + row * LANES + k] = -0.0
    for stage in range(4):
        share = _STAGE_SHARES[stage]
        for k in range(lanes):
            w[MOMENT + k] = w[BEGIN + k] + share * w[STEP + k]
        if modulated:
            all_lane_modulations(lanes, w)
        if stage == 3:
            _copy(lanes, w, RIGHT_INPUTS, INPUTS, INPUT_COUNT)
        elif stage != 2:
            _blend(lanes, w, LEFT_INPUTS, RIGHT_INPUTS, share, INPUTS)
        _accelerate(lanes, w)
        following = _STAGE_SHARES[stage + 1] if stage < 3 else 0.0
        _take_slope(lanes, w, _STAGE_WEIGHTS[stage], following)
    for row in range(STATE_COUNT):
        at = row * LANES
        for k in range(lanes):
            w[STATE + at + k] = w[START + at + k] + w[STEP + k] / 6.0 * w[TOTAL + at + k]


@compiled
def _fill(lanes, w, chunk, motion, first, count):  # type: ignore[no-untyped-def]
    """Copies several input samples of each simulation to consecutive rows of one array.

    Lane by lane: a lane's samples lie behind each other, those of the lanes far apart.
    """
    interval_rows, input_rows, intervals, inputs, yaws = motion
    turning = yaws.shape[0] > 0
    for k in range(lanes):
        spacing, row, before = interval_rows[k], input_rows[k], w[YAW + k]
        for j in range(count):
            i, at = first + j, j * _GIVEN + k
            chunk[at], chunk[at + LANES] = inputs[row, i + 1, 0], inputs[row, i + 1, 1]
            chunk[at + 2 * LANES] = inputs[row, i + 1, 2]
            chunk[at + 4 * LANES] = intervals[spacing, i]
            yaw = yaws[row, i + 1] if turning else before
            if yaw != before:
                yaw = before = unwrapped(yaw, before)
            chunk[at + 3 * LANES] = yaw
        w[YAW + k] = before


@compiled
def _take_inputs(lanes, w, chunk, j):  # type: ignore[no-untyped-def]
    for row in range(5):
        at, to = (
            j * _GIVEN + row * LANES,
            NEW_INPUTS + row * LANES if row < INPUT_COUNT else INTERVAL,
        )
        for k in range(lanes):
            w[to + k] = chunk[at + k]


@compiled
def _take_poses(lanes, w, input_rows, poses, i):  # type: ignore[no-untyped-def]
    """Copies each simulation's pose for an input; without poses the container is upright."""
    for k in range(lanes):
        pose = pose_at(poses[input_rows[k]], i) if poses.shape[0] > 0 else UPRIGHT
        for row in range(POSE_COUNT):
            w[POSE + row * LANES + k] = pose[row]


@compiled
def _load_runs(lanes, w, stores, memory):  # type: ignore[no-untyped-def]
    """Loads each simulation's last inputs, effect parameters and effect states."""
    for k in range(lanes):
        runs, _ = records(stores[k])
        run, at = runs[0], NEW_INPUTS + k
        w[at + AX * LANES], w[at + AY * LANES], w[at + AZ * LANES] = (
            run["ax"],
            run["ay"],
            run["az"],
        )
        w[at + TURN * LANES], w[YAW + k], w[ELAPSED + k] = run["turn"], run["yaw"], run["elapsed"]
        w[STATIC_HEIGHT + k] = run["static_height"]
        w[STATIC_HEIGHT + LANES + k] = run["static_height_y"]
        w[LIFT + k], w[AXES + k] = run["lift"], run["axes"]
        for place in range(DRIVE_MEMORY_COUNT):
            memory[k, place] = run["drive_memory"][place]
        for slot in range(PARAMETER_COUNT):
            w[PARAMETERS + slot * LANES + k] = run["parameters"][slot]


@compiled
def _load_mode(lanes, w, stores, n):  # type: ignore[no-untyped-def]
    for k in range(lanes):
        _, modes = records(stores[k])
        mode = modes[n]
        constants = constants_of(mode)
        for row in range(len(constants)):
            w[CONSTANTS + row * LANES + k] = constants[row]
            w[MODE + row * LANES + k] = constants[row]
        w[ALONG + k], w[ALONG + LANES + k] = mode["along_x"], mode["along_y"]
        w[STATE + X * LANES + k], w[STATE + Y * LANES + k] = mode["x"], mode["y"]
        w[STATE + VX * LANES + k], w[STATE + VY * LANES + k] = mode["vx"], mode["vy"]


@compiled
def _rotate_inputs(lanes, w):  # type: ignore[no-untyped-def]
    """Rotates the new inputs of each simulation to the axes of its modes."""
    at = NEW_INPUTS
    for k in range(lanes):
        if w[AXES + k] != 0.0:
            given = (
                w[at + AX * LANES + k], w[at + AY * LANES + k], w[at + AZ * LANES + k],
                w[at + TURN * LANES + k],
            )  # fmt: skip
            found = in_axes(given, w[AXES + k])
            w[at + AX * LANES + k], w[at + AY * LANES + k] = found[AX], found[AY]
            w[at + TURN * LANES + k] = found[TURN]


@compiled
def _along_modes(lanes, w, at):  # type: ignore[no-untyped-def]
    """Projects each simulation's inputs on its mode's direction, if the direction is fixed."""
    if w[ALONG] == 0.0 and w[ALONG + LANES] == 0.0:  # lanes of a block are alike in this
        return
    for k in range(lanes):
        given = (w[at + AX * LANES + k], w[at + AY * LANES + k], 0.0, 0.0)
        found = along_mode(given, w[ALONG + k], w[ALONG + LANES + k])
        w[at + AX * LANES + k], w[at + AY * LANES + k] = found[AX], found[AY]


@compiled
def _save_mode(lanes, w, stores, n):  # type: ignore[no-untyped-def]
    for k in range(lanes):
        _, modes = records(stores[k])
        mode = modes[n]
        mode["x"], mode["y"] = w[STATE + X * LANES + k], w[STATE + Y * LANES + k]
        mode["vx"], mode["vy"] = w[STATE + VX * LANES + k], w[STATE + VY * LANES + k]


@compiled
def _advance_mode(lanes, w, count, modulated):  # type: ignore[no-untyped-def]
    """Integrates one mode of each simulation over an input interval; adds its liquid heights."""
    _copy(lanes, w, OLD_INPUTS, LEFT_INPUTS, INPUT_COUNT)
    _along_modes(lanes, w, LEFT_INPUTS)
    for part in range(count):
        for k in range(lanes):
            w[BEGIN + k] = w[ELAPSED + k] + w[INTERVAL + k] * (part / count)
            w[STEP + k] = w[INTERVAL + k] / count
        _blend(lanes, w, OLD_INPUTS, NEW_INPUTS, (part + 1) / count, RIGHT_INPUTS)
        _along_modes(lanes, w, RIGHT_INPUTS)
        _step(lanes, w, modulated)
        _copy(lanes, w, RIGHT_INPUTS, LEFT_INPUTS, INPUT_COUNT)
    for k in range(lanes):
        w[MOMENT + k] = w[ELAPSED + k] + w[INTERVAL + k]
    if modulated:
        all_lane_modulations(lanes, w)
    for k in range(lanes):
        w[HEIGHTS + k] += w[MODE + GAIN * LANES + k] * w[STATE + X * LANES + k]
        w[HEIGHTS + LANES + k] += w[MODE + GAIN_Y * LANES + k] * w[STATE + Y * LANES + k]


@compiled
def _advance_modes(lanes, w, stores, mode_count, count, modulated):  # type: ignore[no-untyped-def]
    for n in range(mode_count):
        if mode_count > 1:
            _load_mode(lanes, w, stores, n)
        _advance_mode(lanes, w, count, modulated)
        if mode_count > 1:
            _save_mode(lanes, w, stores, n)


@compiled
def _add_static_heights(lanes, w):  # type: ignore[no-untyped-def]
    for k in range(lanes):
        light = lightness(w[LIFT + k], w[NEW_INPUTS + AZ * LANES + k])
        for row in range(2):
            at = row * LANES + k
            w[HEIGHTS + at] -= w[STATIC_HEIGHT + at] * light * w[NEW_INPUTS + at]


@compiled
def _finish_sample(lanes, w, answers, j):  # type: ignore[no-untyped-def]
    """Stores a sample's liquid heights and rotation angles; sets the heights to 0."""
    at = j * _ANSWERS
    for k in range(lanes):
        answers[at + k], answers[at + LANES + k] = w[HEIGHTS + k], w[HEIGHTS + LANES + k]
        answers[at + 2 * LANES + k] = w[NEW_INPUTS + TURN * LANES + k]
        w[HEIGHTS + k] = w[HEIGHTS + LANES + k] = 0.0
        w[ELAPSED + k] += w[INTERVAL + k]


@compiled
def _write_heights(lanes, answers, heights, first, count):  # type: ignore[no-untyped-def]
    for k in range(lanes):
        for j in range(count):
            at = j * _ANSWERS + k
            heights[k, first + j + 1, 0], heights[k, first + j + 1, 1] = turned(
                answers[at], answers[at + LANES], answers[at + 2 * LANES]
            )


@compiled
def _exceeds(lanes, answers, count, ceiling):  # type: ignore[no-untyped-def]
    """Whether a liquid height of the last samples exceeds a ceiling [m]."""
    highest = 0.0
    for j in range(count):
        at = j * _ANSWERS
        for k in range(lanes):
            highest = max(highest, max(abs(answers[at + k]), abs(answers[at + LANES + k])))
    return highest > ceiling


@compiled
def advance_lanes(  # type: ignore[no-untyped-def]
    stores, counts, interval_rows, input_rows, intervals, inputs, yaws, poses, driven, modulated,
    heights, ceiling,
):  # fmt: skip
    """Integrates up to LANES models as `advance_block` does; for calls from compiled code.

    Ends early after a height at +x or +y beyond a ceiling [m].

    Returns:
        the number of samples whose heights are written, the first one counted.
    """
    lanes = stores.shape[0]
    w = np.zeros(LENGTH)
    memory = np.empty((lanes, max(DRIVE_MEMORY_COUNT, 1)))
    motion = (interval_rows, input_rows, intervals, inputs, yaws)
    _load_runs(lanes, w, stores, memory)
    _take_poses(lanes, w, input_rows, poses, 0)
    mode_count = records(stores[0])[1].shape[0]
    if mode_count == 1:
        _load_mode(lanes, w, stores, 0)
    chunk, answers = np.empty(_CHUNK * _GIVEN), np.empty(_CHUNK * _ANSWERS)
    for first in range(0, counts.shape[0], _CHUNK):
        count = min(_CHUNK, counts.shape[0] - first)
        _fill(lanes, w, chunk, motion, first, count)
        for j in range(count):
            _copy(lanes, w, NEW_INPUTS, OLD_INPUTS, INPUT_COUNT)
            _take_inputs(lanes, w, chunk, j)
            if driven:
                if poses.shape[0] > 0:
                    _take_poses(lanes, w, input_rows, poses, first + j + 1)
                all_lane_drives(lanes, w, memory)
            _rotate_inputs(lanes, w)
            _advance_modes(lanes, w, stores, mode_count, counts[first + j], modulated)
            _add_static_heights(lanes, w)
            _finish_sample(lanes, w, answers, j)
        _write_heights(lanes, answers, heights, first, count)
        if ceiling < np.inf and _exceeds(lanes, answers, count, ceiling):
            return first + count + 1
    return counts.shape[0] + 1


@entry_point(
    void(
        CHANGED_2, int64[::1], int64[::1], int64[::1], GIVEN_2, GIVEN_3, GIVEN_2, GIVEN_3,
        boolean, boolean, CHANGED_3,
    )
)  # fmt: skip
def advance_block(  # type: ignore[no-untyped-def]
    stores, counts, interval_rows, input_rows, intervals, inputs, yaws, poses, driven, modulated,
    heights,
):  # fmt: skip
    """Integrates up to LANES models after their first sample, as `kernel.advance_many` does.

    Args:
        stores: (K, …) their stores, with the same effects switched on and as many modes.
        counts: (N - 1,) how many sub-steps lead to each input but the first, at least 1.
        interval_rows, input_rows: (K,) which row of the intervals, and which of the inputs, yaws
            and poses, each lane takes.
        intervals: (I, N - 1) time from the input before [s]; 0 where a trajectory has ended.
        inputs: (M, N, 3) acceleration [m/s²].
        yaws: (M, N) [rad], or (0, N) for upright containers.
        poses: (M, N, POSE_COUNT), or (0, N, POSE_COUNT).
        driven, modulated: whether the models have effects on the input, and on the modes'
            constants with time.
        heights: (K, N, 2) receives the wall heights at the containers' +x and +y [m], but for the
            first input's.
    """
    advance_lanes(
        stores, counts, interval_rows, input_rows, intervals, inputs, yaws, poses, driven,
        modulated, heights, np.inf,
    )  # fmt: skip
