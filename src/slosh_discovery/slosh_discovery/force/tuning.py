"""Tuning numbers of the identification from force."""

from __future__ import annotations

from dataclasses import dataclass

from slosh_base.tuning import number


@dataclass(frozen=True, slots=True)
class ForceTuning:
    """Assumptions of the force fit about payload, sensor and liquid.

    `model_error` was set by twelve of the even seeds of `validation/studies/force_accuracy.py`,
    which reports the odd ones. The cutoff, and that high waves are nonlinear, were chosen on one
    robot's bag; the other numbers are first guesses.
    """

    # prepared.py
    rate: float = number(250.0, "Hz", "rate at which the liquid is simulated")
    cutoff: float = number(2.5, "1", "highest frequency that counts, in natural frequencies")
    rows_per_cutoff: float = number(6.0, "1", "rows of the fit per period of the cutoff")
    least_peak: float = number(0.05, "m/s²", "least peak of the acceleration")
    moving: float = number(0.03, "1", "acceleration of a moving container, of its peak")
    pause: float = number(0.3, "s", "a shorter rest belongs to the motion")
    ringing: float = number(0.2, "s", "what follows a motion and belongs to it")
    most_offsets: int = number(12, "1", "motions with an offset of their own behind them, at most")
    longest_gap: float = number(0.1, "s", "a longer interval without a force is a gap")
    flat: int = number(6, "1", "equal extreme values in a row that show saturation")
    flat_share: float = number(0.2, "1", "part of the peak above which they do")
    most_hidden: float = number(
        0.3, "1", "clipped part of the motion's time that tells too little"
    )
    least_samples: float = number(2.5, "1", "samples of a wave below which it is not seen")
    samples_per_wave: float = number(11.0, "1", "samples of a wave that are enough")
    least_gain: float = number(0.97, "1", "gain of sampling below which it is named")
    least_periods: float = number(5.0, "1", "shortest record, in natural periods")
    tilt: float = number(0.26, "rad", "largest tilt of the container")
    # fit.py
    delay_span: float = number(0.5, "s", "largest delay of the sensor")
    fixed_axes: float = number(0.7, "1", "residual in fixed axes, of that in turned ones")
    unlike: float = number(0.7, "1", "residual, of the force, that does not follow a motion")
    delay_step: float = number(0.004, "s", "distance of the delays tried first")
    frequency_span: float = number(1.3, "1", "largest ratio of measured and model's frequency")
    frequency_trials: int = number(27, "1", "natural frequencies tried first")
    least_damping: float = number(2e-4, "1", "smallest damping ratio")
    most_damping: float = number(0.5, "1", "largest damping ratio")
    across: float = number(0.1, "1", "weaker directions of the motion, of the strongest, unused")
    rounds: int = number(3, "1", "rounds of fit, noise and orientation")
    alpha_width: float = number(0.2, "1", "usual error of the cubic spring's stiffness")
    memory: float = number(2.0, "1", "natural periods over which residuals remember")
    least_signal: float = number(3.0, "σ", "smallest sloshing mass that is one")
    # workflow.py
    model_error: tuple[float, float, float] = number(
        (1e-4, 5e-3, 5e-3), "1", "error of the equations in frequency, damping and mass"
    )
    # result.py
    unit: float = number(1.3, "1", "ratio of masses up to which a unit is right")


TUNING = ForceTuning()
