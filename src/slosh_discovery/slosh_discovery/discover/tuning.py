"""Tuning numbers of the discovery."""

from __future__ import annotations

from dataclasses import dataclass

from slosh_base.tuning import number


@dataclass(frozen=True, slots=True)
class DiscoverTuning:
    """Assumptions of the discovery about noise, effects, recordings and robots.

    Checked on blind cases by `validation/studies/blind_tables.py` and on measured recordings by
    `validation/studies/discovery_findings.py`. The unit "σ" is a standard deviation of the noise,
    "ln" a logarithm of a likelihood.
    """

    # motion.py
    least_motion: int = number(20, "1", "fewest samples of a motion")
    highest: float = number(2.0, "m", "largest height in metres: above, the unit is another")
    # input_series.py
    still_input: float = number(1e-3, "1", "part of the peak acceleration that moves nothing")
    still_rate: float = number(1e-4, "rad/s", "angular velocity below which nothing turns")
    # input_noise.py
    least_input_noise: float = number(1e-4, "m/s²", "least noise that moves a liquid")
    rest_order: int = number(3, "1", "order of the differences at rest")
    rest_bin: float = number(0.05, "s", "time over which accelerations are averaged")
    rest_bins: int = number(4, "1", "fewest such times of a rest")
    moves: float = number(4.0, "σ", "mean acceleration of a motion")
    rest_margin: float = number(0.3, "s", "time before a motion in which it may have begun")
    least_rest: float = number(0.5, "s", "shortest rest that has a spectrum")
    least_lines: int = number(8, "1", "fewest lines of a spectrum that show a colour")
    least_kinks: int = number(20, "1", "fewest steps of a rounded input that differ from the last")
    kinked: float = number(0.1, "1", "the same as part of its steps")
    rounded_levels: float = number(0.3, "1", "values per sample of a rounded input, at most")
    # differences.py
    clear_height: float = number(3.0, "σ", "least height that is clear of the noise")
    longest_span: float = number(1.5, "1", "largest span of a difference over one without a gap")
    least_noise: float = number(1e-9, "m", "noise of exact data")
    least_samples: int = number(12, "1", "fewest samples of an estimate")
    # noise.py
    settle: float = number(0.05, "s", "end of a rest that is left out")
    consistent: float = number(3.0, "σ", "largest deviation that may be chance")
    signal_band: float = number(10.0, "Hz", "frequency up to which a residual is examined")
    spectrum_share: float = number(0.8, "1", "part of the false alarms that the spectrum may use")
    independent_lines: float = number(2.0, "1", "independent lines per frequency, by simulation")
    significance: float = number(0.015, "1", "probability at which a residual is no white noise")
    robust_efficiency: float = number(0.6, "1", "efficiency of the robust scale, by simulation")
    # colour.py
    most_colour: float = number(0.9, "1", "correlation above which a residual is no noise")
    largest_colour: float = number(0.99, "1", "largest correlation that is tried")
    # sensor_noise.py
    liquid_band: float = number(8.0, "Hz", "frequency below which a liquid in a cup moves")
    band_share: float = number(0.3, "1", "the same as part of the sampling rate")
    outlier: float = number(4.0, "σ", "deviation of an outlier")
    shadow: int = number(2, "1", "samples beside a larger outlier that are its shadow")
    steady: float = number(0.03, "1", "relative change of colour and jitter that ends the rounds")
    contradicted: float = number(3.0, "ln", "loss above the liquid's band that denies a noise")
    common_colour: float = number(1.0, "1", "usual inverse tanh of a sensor's correlation")
    sure_colour: float = number(8.0, "ln", "least gain of colour and jitter")
    worth_colour: float = number(0.04, "ln", "least gain of a sample")
    rougher: float = number(3.0, "1", "ratio of a noise to the heights' differences that is none")
    varied: float = number(0.1, "1", "least relative spread of claimed deviations")
    spike: float = number(5.0, "σ", "deviation of a spike from its neighbours")
    few_spikes: float = number(0.003, "1", "most spikes of plain noise, part of the samples")
    alike_noise: float = number(0.15, "1", "relative difference of noises that weigh alike")
    slowest: float = number(0.85, "1", "correlation at which a model is at fault; 0.88 was")
    strongest_colour: float = number(0.97, "1", "largest correlation of neighbours that is tried")
    largest_jitter: float = number(0.03, "s", "largest jitter of stamps")
    # clock.py
    clock_step: float = number(1.0 / 60.0, "s", "step of the offsets that are tried")
    clock_slip: float = number(0.5, "s", "range around a fitted offset that is searched")
    clock_better: float = number(0.9, "1", "part of the sum of squares a better offset leaves")
    clock_overlap: float = number(0.6, "1", "least common part of both series")
    # problem.py
    input_spacing: float = number(0.0042, "s", "largest time between two inputs")
    fine_spacing: float = number(0.0021, "s", "the same where heights are between inputs")
    sample_spacing: float = number(0.0075, "s", "least time between two heights")
    least_shared: float = number(0.02, "1", "least part of the white noise that shared noise adds")
    # fitting.py
    clock_span: float = number(0.2, "s", "largest change of a clock offset")
    # driven.py
    small_answer: float = number(0.1, "σ", "least answer to an input's noise")
    flat: float = number(0.1, "1", "change with the liquid below which a measurement is constant")
    # explanation.py
    least_fill: float = number(0.1, "1", "least part of the fill height that is left")
    # evidence.py
    effect_prior: float = number(
        1.0 / 70.0, "1", "odds of one effect before any data; of any, 1 in 3"
    )
    group_prior: float = number(1.0 / 10.0, "1", "odds of an effect to differ between groups")
    least_correlation: float = number(0.05, "1", "least correlation of a residual")
    model_error: float = number(0.02, "1", "part of what a model explains that it has wrong")
    # gap.py
    least_gap: float = number(0.3, "1", "least gap as part of the noise")
    worse: float = number(2.0, "1", "ratio to the base's mean squares of no explanation")
    # search.py
    beam: int = number(5, "1", "explanations that are extended")
    promising: int = number(5, "1", "effects by which each of them is extended")
    most_effects: int = number(3, "1", "most effects of any kind")
    most_foretold: int = number(6, "1", "most effects with those whose size theory gives")
    beam_foretold: int = number(3, "1", "explanations to which these are added")
    starts_fitted: int = number(2, "1", "starts that are fitted")
    visible: float = number(1e-3, "σ", "least change of heights by an effect")
    adequate: float = number(0.25, "σ", "largest correlated part of an adequate residual")
    adequate_coloured: float = number(0.35, "σ", "the same where the colour is an estimate")
    adequate_driven: float = number(0.4, "σ", "the same where the inputs' noise is removed")
    sure: float = number(2.5, "σ", "deviation of an estimate that is not chance")
    # rounds.py
    same_frequency: float = number(0.01, "1", "relative difference of one frequency")
    same_size: float = number(0.3, "1", "relative difference of one damping and height")
    # campaigns.py
    least_members: int = number(2, "1", "fewest motions of a set-up")
    clear_gain: float = number(5.0, "ln", "least gain of groups over one")
    # steadiness.py
    change_taken: float = number(1.0 / 3.0, "1", "least part of the rest that a change explains")
    least_change: float = number(0.1, "1", "least change beside the effect")
    # propose.py
    most_terms: int = number(3, "1", "most terms of a formula")
    scanned: int = number(2, "1", "motions on which terms are tried")
    fitted: int = number(16, "1", "tries that are fitted")
    least_gain: float = number(0.05, "1", "part of the gap that a further term takes")
    proposal_columns: int = number(6, "1", "azimuths that are examined")
    # verdict.py
    sure_enough: float = number(0.8, "1", "probability of an explanation that is named")
    rival: float = number(0.05, "1", "relative probability of a rival")
    closed: float = number(0.5, "1", "least part of the gap that an explanation closes")
    partly: float = number(0.1, "1", "least part of it that a partial one closes")
    contenders: int = number(8, "1", "explanations that predict motions left out")
    unseen: float = number(0.1, "1", "part of the expected motion below which none is seen")
    negligible: float = number(0.06, "1", "least gain of an effect, of the noise's mean squares")
    negligible_share: float = number(0.004, "1", "the same, of the gap")
    cosmetic_share: float = number(0.02, "1", "the same where more than noise is left")
    trust: float = number(2.0, "1", "loss of confidence by what is left of the gap")
    least_trust: float = number(0.85, "1", "least confidence times the part that is closed")
    # where.py
    amplitude_bins: int = number(5, "1", "bins up to the highest height")
    sectors: int = number(8, "1", "sectors of the azimuth")
    least_wave: float = number(0.05, "1", "part of the peak below which a wave has no direction")
    band: float = number(0.25, "1", "half width of a band, of the first mode's frequency")
    low_band: float = number(0.5, "1", "end of the lowest band, likewise")
    worst_separation: float = number(0.5, "s", "least time between worst moments")
    # workflow.py
    tabled: int = number(5, "1", "explanations that are cross-checked")
    most_rivals: int = number(2, "1", "most rivals")
    # separate.py
    give: float = number(10.0, "1", "largest change of a parameter in a refit, in steps")
    floor: float = number(5e-4, "m", "usual noise of a sensor")
    per_family: int = number(3, "1", "frequencies of each family that are refined")
    long_dwell: float = number(10.0, "s", "dwell that shows a decay")
    most_height: float = number(0.7, "radius", "largest height where the rim is not known")
    freeboard_share: float = number(0.8, "1", "largest height as part of the freeboard")
    sample_rate: float = number(60.0, "Hz", "rate of the heights that are compared")
    alike: float = number(0.005, "1", "relative difference of equal models")
    width_change: float = number(0.003, "1", "relative change of the container's width")
    damping_change: float = number(0.03, "1", "relative change of the damping")
    parameter_change: float = number(0.03, "1", "change of a parameter, of that from neutral")
    # separating_families.py
    family_still: float = number(1.5, "s", "rest before a motion")
    family_swing: float = number(4.0, "s", "duration of a motion")
    family_ramp: float = number(1.2, "s", "rise and fall of its amplitude")
    family_dwell: float = number(3.0, "s", "rest after it")
    family_step: float = number(1.0 / 120.0, "s", "time between two inputs")
    most_travel: float = number(0.6, "m", "largest extent of a path")
    most_tilt: float = number(0.25, "rad", "largest tilt")
    tilt_share: float = number(0.5, "1", "part of the acceleration's limit that a tilt uses")
    yaw: float = number(1.2, "rad", "amplitude of the yaw")
    most_yaw_rate: float = number(6.0, "rad/s", "largest rate of the yaw")


TUNING = DiscoverTuning()
