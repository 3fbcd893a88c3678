"""Tuning numbers of the identification of parameters."""

from __future__ import annotations

from dataclasses import dataclass

from slosh_base.tuning import number


@dataclass(frozen=True, slots=True)
class IdentifyTuning:
    """Assumptions of the identification about parameters, motions and recordings.

    Checked on simulated and measured runs by `validation/studies/identified_runs.py`. The unit "σ"
    is a standard deviation of the noise.
    """

    # parameters.py
    frequency_span: float = number(2.0, "1", "largest ratio of measured and model's frequency")
    frequency_width: float = number(0.1, "1", "usual relative difference of the two")
    fill_span: float = number(2.0, "1", "largest ratio of fill heights")
    fill_width: float = number(0.2, "1", "usual relative difference of fill heights")
    most_damping: float = number(0.9, "1", "largest damping ratio")
    damping_width: float = number(0.02, "1", "usual difference of damping ratios")
    # workflow.py
    least_seen: float = number(1e-6, "m", "largest height of a motion that was not measured")
    # problem.py
    clock_width: float = number(0.05, "s", "usual offset of a clock")
    state_span: float = number(3.0, "1", "first state of a decay in heights of its wave, at most")
    least_width: float = number(0.05, "1", "least width of a path over its length")
    # frequency_scan.py
    scan_span: float = number(1.3, "1", "largest ratio of a tried frequency and the model's")
    scan_phase: float = number(1.0, "rad", "phase over the record between two frequencies")
    scan_fewest: int = number(15, "1", "fewest frequencies")
    scan_most: int = number(120, "1", "most frequencies")
    scan_better: float = number(0.8, "1", "part of the sum of squares that a better start leaves")
    scan_trials: int = number(3, "1", "motions that are enough")
    # fitting.py
    huber: float = number(2.0, "σ", "residual beyond which it counts by its size")
    turns: int = number(3, "1", "rounds of fit and colour")
    lags: int = number(3, "1", "neighbours whose scores count together")
    memories: float = number(3.0, "1", "the same in memories of a coloured residual")
    most_lags: float = number(0.1, "1", "most of these as part of all images")
    differ: float = number(0.99, "1", "probability at which motions differ")
    least_motions: int = number(5, "1", "fewest motions that show a scatter")
    # trials.py
    moves: float = number(1e-4, "m/s²", "least acceleration of a moving container")
    rest: float = number(1e-3, "1", "part of the peak at which a rise begins")
    across: float = number(0.3, "1", "part of the acceleration across a stroke's line, at most")
    stopped: float = number(0.1, "1", "part of way and velocity at a stroke's end, at most")
    clear: float = number(4.0, "σ", "acceleration of a moving container")
    repeated: float = number(0.1, "1", "relative difference of repetitions")
    cycles: float = number(2.0, "1", "longest record of one stroke, in cycles")
    cycle_share: float = number(0.2, "1", "relative difference of cycles")
    dwell_share: float = number(0.5, "1", "least part of the dwell in a cycle's record")
    pause: float = number(0.02, "1", "least dwell as part of the motion")
    pause_samples: int = number(5, "1", "least samples of a dwell")
    # dwell.py
    least_frames: int = number(5, "1", "fewest images of a dwell")
    # information.py
    unknown: float = number(1.0, "1", "standard error of a direction that is not identified")
    involved: float = number(0.3, "1", "least part of a parameter in a direction")
    enough: float = number(2.0, "1", "loss of information by the simplest motion, at most")
    samples: float = number(60.0, "Hz", "rate of heights of a motion that is tried")
    # workflow.py
    surely: float = number(1e-3, "1", "probability at which a residual is more than noise")


TUNING = IdentifyTuning()
