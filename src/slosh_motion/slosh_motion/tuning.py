"""Tuning numbers of inputs and their checks, alignment, clock drift and motion spans."""

from __future__ import annotations

from dataclasses import dataclass

from slosh_base.files.nanoseconds import SECOND
from slosh_base.tuning import number
from slosh_model.constants import GRAVITY


@dataclass(frozen=True, slots=True)
class MotionTuning:
    """Assumptions about sensors, trackers and drivers, motion detection and clock drift.

    Checked by the tests of the package on simulated inputs with and without each fault. The unit
    "σ" is a standard deviation of the noise.
    """

    # gate.py
    strongest: float = number(2000.0, "m/s²", "largest acceleration of a container, 200 g")
    agreeing: int = number(5, "1", "samples that make a jump a new motion")
    # imu_input.py
    angular_filter: float = number(0.01, "s", "time constant of the angular acceleration")
    gravity_filter: float = number(2.0, "s", "time constant of the mean specific force")
    too_light: float = number(0.5 * GRAVITY, "m/s²", "mean force of a sensor without gravity")
    too_heavy: float = number(3.0 * GRAVITY, "m/s²", "mean force of a sensor in another unit")
    fastest_turn: float = number(200.0, "rad/s", "largest angular velocity, 30 turns a second")
    # pose_filter.py
    reach: float = number(1.43, "rad", "half the window in phase of the carried mode, ωH")
    velocity_reach: float = number(1.27, "rad", "the same where velocities are differentiated")
    pose_reaches: tuple[float, ...] = number((0.26, 1.43), "rad", "the same, of degrees 3 and 5")
    velocity_reaches: tuple[float, ...] = number((0.22, 1.27), "rad", "the same, of 1 and 3")
    fastest_mode: float = number(30.0, "rad/s", "carried mode without a model: a cup of 40 mm")
    phase_step: float = number(0.25, "rad", "largest step between accelerations, ωT")
    # pose_input.py
    fastest_move: float = number(20.0, "m/s", "speed above which a tracker jumps")
    farthest: float = number(1e4, "m", "largest distance of a container from the origin")
    lengths: tuple[float, float] = number((1e-3, 1e3), "1", "lengths that a quaternion may have")
    clock_poses: int = number(32, "1", "number of poses that determine the even clock")
    clock_memory: float = number(0.99, "1", "part of the clock's fit that is kept at each pose")
    # aligned.py
    moved: float = number(1e-6, "rad, m", "change of a joint or a transform that moves")
    slower: float = number(1.5, "1", "ratio of intervals at which a slower stream leads")
    leading_ns: int = number(SECOND // 20, "ns", "longest interval of a stream that leads")
    kept_states: int = number(1024, "1", "values of a stream that are kept")
    set_back_ns: int = number(SECOND, "ns", "stamps that go back so far are another time")
    silent_ns: int = number(SECOND, "ns", "time that a stream may be behind the others")
    silent_intervals: float = number(3.0, "1", "the same in its own intervals, in addition")
    clock_way: float = number(
        0.05, "rad, m", "change within a second of a stream whose clock matters"
    )
    clock_apart: float = number(0.03, "s", "least distance of two publishers' clocks")
    # joint_poses.py, transform_poses.py
    first_states: int = number(50, "1", "messages after which missing inputs are reported")
    still_ns: int = number(30 * SECOND, "ns", "time after which a resting chain is reported")
    beyond_limits: float = number(1.0, "rad, m", "distance to a joint's limits that is no error")
    # joint_velocities.py
    stretch_ns: int = number(SECOND // 5, "ns", "time over which velocities are compared")
    compared: float = number(0.01, "rad, m", "motion over which velocities are compared")
    agreeing_velocity: float = number(0.05, "1", "relative error of velocities that agree")
    # sampling.py
    carried: tuple[float, float] = number((0.97, 1.03), "1", "gains of a mode that is carried")
    first_rate: int = number(4, "1", "intervals that determine the rate at first")
    restarts: int = number(4, "1", "fewest restarts that are no single gaps")
    rate_change: int = number(33, "1", "inverse relative change of a rate that is reported")
    # alignment.py
    quiet_window: float = number(0.8, "s", "length of the quiet part that gives level and noise")
    onset_noises: float = number(5.0, "σ", "deviation from which a height shows a motion")
    onset_share: float = number(0.5, "1", "part of the peak that it exceeds as well")
    sustained: tuple[int, int] = number((3, 5), "1", "samples that exceed both, out of so many")
    search: float = number(1.0, "s", "half-width of the search for the clock offset")
    bowl: float = number(0.02, "s", "half-width of the fit at the least residual")
    separation: float = number(0.1, "s", "least distance of two separate minima")
    offset_step: float = number(0.002, "s", "grid of offsets before the fit")
    coverage: float = number(0.98, "1", "part of the model that measured samples cover")
    distinct: float = number(1.10, "1", "RMS of a second minimum over the first, at least")
    outlier_share: float = number(
        0.15, "1", "part of the peak by which a single outlier stands out"
    )
    # clock_drift.py
    least_covered: int = number(20, "1", "fewest samples of a motion that show a drift")
    drift_rounds: int = number(6, "1", "iterations of the least squares of the drift")
    drift_surely: float = number(5.0, "σ", "least significance of a drift")
    least_drift: float = number(5e-4, "1", "least drift")
    drift_gain: float = number(0.3, "1", "part of the residual that the drift explains")
    few: float = number(4.0, "1", "more of it by this over the degrees of freedom")
    least_gain: float = number(0.005, "s", "least change of the offset")
    model_error: float = number(0.002, "s", "error of an offset by the model")
    least_offset: float = number(0.015, "s", "least constant offset that is reported")
    rough_offset: float = number(0.02, "s", "standard deviation from which an offset is unknown")
    least_motions: int = number(4, "1", "fewest motions that show a growing offset")
    kept_motions: int = number(500, "1", "motions that are kept")
    near: float = number(0.3, "s", "half-width of the search about a known offset")
    # motion_spans.py
    moving: float = number(0.15, "m/s²", "deviation from rest at which the container moves")
    beginning: float = number(1.1, "s", "length of a constant beginning that is rest")
    settled: float = number(1.0, "s", "length of a constant input whose drift is followed")
    turning: float = number(0.05, "rad/s", "rate of tilt at which the container moves")
    pause_ns: int = number(SECOND, "ns", "length of a rest between two motions")
    after_ns: int = number(SECOND, "ns", "time after a motion in which its heights count")
    # checks/constancy.py
    bin_ns: int = number(50_000_000, "ns", "time over which inputs are averaged")
    looked_back: int = number(7, "1", "second differences that give the noise")
    constancy_noises: float = number(3.5, "σ", "deviation of a mean that is noise")
    tolerance: float = number(0.075, "m/s²", "deviation from a constant without noise")
    most_tolerance: float = number(0.5, "m/s²", "largest deviation from a constant with noise")
    top_speed: float = number(5.0, "m/s", "largest change of speed in a motion")
    # checks/input_faults.py
    least_samples: int = number(16, "1", "fewest samples that can show a fault")
    fault_moving: float = number(0.15, "m/s²", "acceleration below which a fault is negligible")
    flat_samples: int = number(4, "1", "fewest equal samples of a clipped top")
    beside: int = number(4, "1", "samples beside it that extrapolate the clipped part")
    cap: float = number(0.05, "1", "part of the range by which that exceeds the top")
    straight: float = number(1e-3, "1", "change of slope per sample of a planned ramp")
    arriving: float = number(2.2, "1", "rise over the distance to the top of a planned arrival")
    quanta: float = number(12.0, "steps", "bend of rounded values that is known")
    everywhere: float = number(0.7, "1", "part of the samples that differ where noise is in them")
    fine: float = number(20.0, "steps", "third difference at which equal values are rare")
    rough: float = number(1.0, "1", "third over second differences of noise")
    exact: float = number(1e-8, "1", "relative difference of different numbers")
    rounded: float = number(0.05, "1", "deviation from a multiple of a step, in steps")
    freeze: float = number(0.04, "s", "shortest freeze")
    freeze_samples: int = number(5, "1", "fewest samples of a freeze")
    held: float = number(3.0, "1", "length of a freeze over the usual repetition")
    leap: float = number(1.0, "m/s²", "change at the end of a freeze that began at rest")
    jump: float = number(3.0, "1", "change at its end over the changes beside it")
    gap: float = number(0.05, "s", "shortest missing stretch")
    gap_samples: float = number(5.0, "1", "the same in sampling intervals")
    apart: float = number(0.4, "m/s²", "deviation of a sample from its neighbours")
    sticks_out: float = number(2.0, "1", "the same over the difference of the neighbours")
    in_turn: int = number(12, "1", "such samples in succession that show a second motion")
    at_least: int = number(30, "1", "such samples in all")
    apart_speed: float = number(0.01, "m/s", "the same deviation of a velocity")
    in_turn_speed: int = number(8, "1", "such velocities in succession")
    least_speed: int = number(16, "1", "such velocities in all")
    most_between: int = number(20, "1", "most samples between two of them")
    alike: float = number(0.5, "1", "relative difference of their deviations")
    along: float = number(0.8, "1", "cosine of the angle between these")
    regular: float = number(0.25, "1", "relative change of the samples between them")
    uneven: float = number(0.05, "1", "relative scatter of the intervals of all samples")
    unevenness: float = number(2.5, "1", "the same over that of one publisher")
    window_ns: int = number(10 * SECOND, "ns", "part of a stream that is checked at a time")
    overlap_ns: int = number(SECOND // 2, "ns", "part of the window before that is checked again")
    most_faults: int = number(20, "1", "most kinds of fault that are distinguished")
    most_taken: int = number(50_000, "1", "most samples that wait for a check")
    # checks/message_checks.py
    leap_distance: float = number(5e-3, "m", "change of position that is no leap")
    leap_angle: float = number(0.05, "rad", "change of attitude that is no leap")
    leap_speed: float = number(20.0, "m/s", "speed that is no leap where no motion is known")
    leap_steps: float = number(4.0, "1", "change over the largest of those before")
    leap_detour: float = number(1.25, "1", "way over the change of poses that go on")
    leap_before: int = number(8, "1", "changes before that are looked at")
    leap_acceleration: float = number(100.0, "m/s²", "acceleration that is no leap")
    leap_spin: float = number(1000.0, "rad/s²", "angular acceleration that is no leap")
    fro_window: int = number(64, "1", "successive changes of a motion that are looked at")
    fro_turns: int = number(4, "1", "single steps back in them that show two publishers")
    fro_least: float = number(5e-4, "m", "least way back")
    fro_way: float = number(0.01, "m", "least way of the whole")
    fro_noises: float = number(3.0, "1", "way back over the largest change at rest")
    fro_leads: float = number(1.2, "1", "way of the whole over the mean way back")
    fro_over: int = number(64, "1", "changes of a straight motion after which it is over")
    drop_most: int = number(3, "1", "successive zeros that are no stop")
    drop_acceleration: float = number(20.0, "m/s²", "acceleration of a stop that is none")
    drop_speed: float = number(0.1, "m/s", "change of speed at a stop that is none")
    stair_runs: int = number(6, "1", "successive stairs that are looked at")
    stair_ns: int = number(15_000_000, "ns", "longest stair that is no fault")
    stair_quanta: float = number(4.0, "1", "step of a stair over the least step")
    stair_share: float = number(0.01, "1", "least step of a stair but one, part of the way")
    stair_way: float = number(5e-3, "m", "least way from the first to the last stair")
    stair_speed: float = number(0.05, "m/s", "the same of velocities")
    twist_ns: int = number(SECOND // 10, "ns", "time over which a twist is integrated")
    twist_gap: float = number(0.25, "s", "longest time between two twists")
    twist_way: float = number(5e-3, "m", "least way of a stretch that is compared")
    twist_stretches: int = number(20, "1", "stretches in motion that are compared")
    twist_least: int = number(4, "1", "fewest stretches that show a wrong twist")
    twist_error: float = number(0.3, "1", "relative error of a wrong twist")
    twist_slight: float = number(0.05, "1", "the same where the parent's axes fit better")
    twist_nothing: float = number(1e-4, "1", "part of a way that is none")
    # checks/beginning.py
    began_speed: float = number(0.05, "m/s", "speed at the first moment that is none")
    began_noises: float = number(5.0, "σ", "the same in its standard deviations")
    began_few: float = number(52.0, "1", "more of it by this over the squared degrees of freedom")
    began_poses: int = number(8, "1", "fewest samples that show it")
    began_shakes: float = number(2.5, "σ", "acceleration at first over the vibration")
    began_acceleration: float = number(1.0, "m/s²", "acceleration at first that is none")
    # checks/jitter.py
    jitter_speed: float = number(0.1, "m/s", "speed from which stamps are compared with places")
    jitter_acceleration: float = number(0.5, "m/s²", "the same of velocities")
    jitter_gap: float = number(0.25, "s", "time of three messages that are no neighbours")
    jitter_rows: int = number(256, "1", "messages in motion that are compared")
    jitter_least: int = number(32, "1", "fewest messages that show a scatter")
    jitter_ratio: float = number(0.4, "1", "unevenness at even times over that at the stamps")
    jitter_astray: float = number(0.225, "1", "distance from the middle of two neighbours")
    jitter_share: float = number(0.015, "1", "part of such stamps that is no fault")
    jitter_error: float = number(5e-4, "m", "standard deviation of a height that is told")
    # checks/stamp_checks.py
    clock_messages: int = number(20, "1", "fewest messages whose stamps are compared")
    clock_span: float = number(1.0, "s", "shortest recording whose stamps are compared")
    clock_rate: float = number(0.02, "1", "relative error of the stamps' rate that is no fault")
    clock_growth: float = number(0.04, "s", "growth of the clocks' offset that is no fault")
    clock_step: float = number(0.01, "s", "step of the stamps that is no fault")
    clock_beside: float = number(0.3, "s", "time beside a step over which it must stay")
    # checks/table_checks.py
    unlikely: float = number(100.0, "m/s²", "acceleration that no robot with liquid has")
    shortest_table: float = number(1.0, "s", "shortest motion whose mean is checked")
    gentle: float = number(1.5, "m/s²", "peak below which a motion looks like one in g")
    # checks/constant_finder.py
    rest: float = number(0.4, "s", "time without change after which an input is constant")
    forgetting: float = number(30.0, "s", "time constant of the integral")
    departure: float = number(0.25, "m/s²", "deviation from a constant that is a motion")


TUNING = MotionTuning()
