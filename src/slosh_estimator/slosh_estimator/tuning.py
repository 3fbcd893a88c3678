"""Tuning numbers of the estimator and the monitor."""

from __future__ import annotations

import math
from dataclasses import dataclass

from slosh_base.files.nanoseconds import SECOND
from slosh_base.tuning import number


@dataclass(frozen=True, slots=True)
class EstimatorTuning:
    """Assumptions of estimator and monitor about cameras and liquids.

    Checked on the simulated cell's recordings by `slosh replay bags --check`. The unit
    "σ" is the sensor's standard deviation.
    """

    # estimator.py
    runaway: float = number(5.0, "radius", "displacement at which a sloshing mass is no liquid")
    still: float = number(0.0005, "m", "largest height of liquid at rest")
    settled: float = number(3.0, "1/(ζω)", "time after which the initial state is forgotten")
    # estimate_kernel.py
    jerk_filter: float = number(0.02, "s", "time constant of the low-pass behind the jerk")
    # comparison.py
    patience_ns: int = number(SECOND // 10, "ns", "time that a measurement waits for an estimate")
    # sight.py
    highest: float = number(10.0, "m", "largest height that is believed")
    clocks_apart: float = number(2.0, "s", "distance of stamps at which two clocks differ")
    clock_stands: float = number(0.8, "s", "time without a step after which a clock has stopped")
    # estimator_node.py
    tray_ns: int = number(SECOND // 200, "ns", "shortest time between two estimates of a tray")
    # level_watch.py
    level_window_ns: int = number(SECOND, "ns", "time at rest over which a level is seen")
    level_least: int = number(5, "1", "fewest images of it")
    level_noise: float = number(3.0, "σ", "difference of a level that is off")
    least_level: float = number(5e-4, "m", "the same at least: what a calibration leaves")
    # prediction_record.py
    early_ns: int = number(SECOND // 2, "ns", "time by which a motion may begin early")
    late: float = number(1.0, "s", "time by which it may begin late")
    duration_error: float = number(0.5, "s", "error of its duration")
    duration_share: float = number(0.25, "1", "relative error of a motion's start and duration")
    # agreement.py
    told_ns: int = number(2 * SECOND, "ns", "time after its end when a motion is judged")
    longest_ns: int = number(60 * SECOND, "ns", "time after which a motion is judged in any case")
    least_compared: int = number(20, "1", "fewest compared images of a judgement")
    agreement_noise: float = number(3.0, "σ", "error due to noise")
    share_of_peak: float = number(0.02, "1", "error due to calibration, as part of the peak")
    agreement_share: float = number(0.05, "1", "negligible error, as part of the watched limit")
    # azimuth.py
    least_turn: float = number(math.radians(20.0), "rad", "least error of the azimuth")
    turn_noise: float = number(3.0, "σ", "the same in its own standard deviation")
    least_coherence: float = number(0.5, "1", "least common part of two waves' energy")
    offset_near: float = number(0.04, "s", "largest time offset of a turned wave")
    offset_far: float = number(0.3, "s", "largest time offset of a wave that is not turned")
    offset_step: float = number(0.02, "s", "step between time offsets")
    least_gain: float = number(0.02, "1", "least gain of a turn over an offset")
    clear_gain: float = number(0.1, "1", "gain above which no offset is named")
    error_block: float = number(0.5, "s", "time after which errors are independent")
    least_blocks: int = number(4, "1", "fewest such times")
    image_gap: float = number(0.15, "s", "largest gap that is interpolated")
    across: float = number(0.25, "1", "part of the energy in the plane of a side view")
    # repeated_heights.py
    repeat_window_ns: int = number(SECOND // 2, "ns", "longest time that is compared")
    repeat_least_ns: int = number(3 * SECOND // 20, "ns", "shortest time that is compared")
    in_turn: int = number(3, "1", "most old pictures that come in turn")
    each: int = number(4, "1", "times that each of them is seen")
    same: float = number(1.5e-4, "m", "least difference of two pictures' heights")
    same_noise: float = number(4.0, "σ", "the same in units of the noise")
    same_most: float = number(6e-4, "m", "largest such difference")
    repeat_wave: float = number(2e-3, "m", "least wave of an old picture")
    moves: float = number(3e-3, "m", "change of the expected height of moving liquid")
    moves_times: float = number(8.0, "1", "the same in units of the difference")
    # stray_heights.py
    stray_kept: int = number(12, "1", "number of images that are compared")
    stray_least: int = number(6, "1", "fewest images that determine the usual change")
    stray_pause_ns: int = number(SECOND // 5, "ns", "pause after which any change is possible")
    jump: float = number(2e-3, "m", "least change of an outlier")
    jump_times: float = number(2.0, "1", "the same in units of the largest change")
    jump_noise: float = number(8.0, "σ", "the same in units of the noise")
    lasting: int = number(2, "1", "number of jumps that are no outliers")
    # wave_presence.py
    judged_ns: int = number(2 * SECOND, "ns", "interval of judgements")
    presence_longest_ns: int = number(10 * SECOND, "ns", "longest time that is judged together")
    wave_noise: float = number(5.0, "σ", "the same in units of the noise")
    least_wave: float = number(1e-3, "m", "least wave that is judged")
    presence_share: float = number(0.1, "1", "least wave, as part of the watched limit")
    missing: float = number(0.25, "1", "part of the other side's size at which a wave is missing")
    nothing: float = number(0.05, "1", "part of the measured wave that is no wave of a model")
    sustained: float = number(0.97, "1", "part of the last size at which a wave only decays")
    # observer/observer.py
    fused_ns: int = number(SECOND // 100, "ns", "time between two fused states")
    observer_state_ns: int = number(
        SECOND, "ns", "time between two recorded states of the observer"
    )
    ahead_ns: int = number(SECOND, "ns", "time by which a measurement may be ahead of the input")
    sensed_wait_ns: int = number(
        SECOND // 5, "ns", "time that a sensor's height waits for a later image"
    )
    usual_stddev: float = number(5e-4, "m", "standard deviation of a height that states none")
    least_stddev: float = number(1e-4, "m", "least standard deviation of a height")
    trusted_stddev: float = number(1e-3, "m", "standard deviation of a trusted fused height")
    kept_inputs: int = number(1024, "1", "inputs that a late measurement may be behind")
    waiting_heights: int = number(64, "1", "most measurements that wait for an input")
    reopen: int = number(2, "1", "rejected measurements in succession that forget the state")
    reopen_unseen: int = number(4, "1", "the same where a measurement does not show a shape")
    shape_points: int = number(5, "1", "fewest points that show whether they are a wave's")
    rest_wave: float = number(2e-4, "m", "standard deviation of a height at rest")
    unknown_wave: float = number(0.3, "1", "the same of an unknown wave, as part of the radius")
    frequency_spread: float = number(0.02, "1", "standard deviation of log ω about the model's")
    damping_spread: float = number(0.5, "1", "standard deviation of log ζ about the model's")
    level_spread: float = number(5e-4, "m", "standard deviation of the still level")
    clock_spread: float = number(3e-3, "s", "standard deviation of the measurement's clock")
    most_frequency: float = number(0.1, "1", "largest |log ω| about the model's")
    most_damping: float = number(2.3, "1", "largest |log ζ| about the model's")
    frequency_walk: float = number(1e-6, "1/s", "random walk of log ω")
    damping_walk: float = number(1e-4, "1/s", "random walk of log ζ")
    level_walk: float = number(1e-9, "m²/s", "random walk of the still level")
    clock_walk: float = number(1e-8, "s", "random walk of the measurement's clock")
    noise_floor: float = number(1e-6, "m²/s³", "noise of the acceleration at rest")
    noise_share: float = number(0.02, "1", "error of the acceleration as part of it")
    noise_wave: float = number(0.005, "1", "error of the wave's own force as part of it")
    noise_steep: float = number(0.4, "1", "height of a wave whose error is twice as large, in R")
    noise_memory: float = number(0.1, "s", "time over which such errors last")
    innovation_gate: float = number(3.1, "σ", "largest innovation, as of a normal deviate")
    common_error: float = number(0.5, "1", "part of a variance that all points share")
    relative_error: float = number(0.015, "1", "error of a height as part of the wave")
    error_memory: float = number(0.1, "s", "time over which errors of heights are alike")
    large_correction: float = number(
        0.02, "1", "wave, in radii, that a correction adds by the nonlinear equations"
    )
    rest_average: float = number(0.5, "s", "time over which the acceleration at rest is averaged")
    form_error: float = number(0.15, "1", "error of a height η by the form of the wave, in η²/R")
    # observer/calm.py
    bound: float = number(1.645, "σ", "deviation of the stated bound: 95 % are below")
    surely_calm: float = number(
        3.1, "σ", "deviation with which a wave must be below the tolerance"
    )
    calm_frequency: float = number(0.02, "1", "error of the model's frequency that calm allows")
    calm_damping: float = number(2.0, "1", "factor by which the model's damping may be wrong")
    calm_again: float = number(1.2, "1", "bound over the tolerance at which calm ends")
    calm_ns: int = number(SECOND // 20, "ns", "time between two messages about calm")
    calm_silence: float = number(0.1, "s", "time without an input after which it is stale")
    calm_first_ns: int = number(
        SECOND, "ns", "time after the start in which measurements may come"
    )
    calm_after_ns: int = number(SECOND // 5, "ns", "time after a motion that still belongs to it")
    # observer/shown_wave.py
    shown_ns: int = number(SECOND, "ns", "time over which heights at one place show a wave")
    shown_least: int = number(20, "1", "fewest such heights")
    # sensed/force_surface.py
    force_block_ns: int = number(SECOND // 25, "ns", "time over which a force is averaged")
    force_zero_ns: int = number(3 * SECOND, "ns", "time over which a force's zero is averaged")
    force_zero_first_ns: int = number(SECOND, "ns", "the same at first")
    load_memory: float = number(0.98, "1", "part of the load's sums that is kept at each block")
    load_least: int = number(10, "1", "fewest blocks in motion that show the load")
    load_wrong: float = number(2.0, "1", "ratio to the identified mass at which a force is wrong")
    load_unit: float = number(1.5, "1", "ratio to another unit's that is still that unit")
    force_moves: float = number(0.1, "m/s²", "acceleration of a moving container")


TUNING = EstimatorTuning()
