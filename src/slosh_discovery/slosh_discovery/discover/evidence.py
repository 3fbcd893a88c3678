"""Computes probabilities of candidate models given the data, by Laplace's approximation.

log Z = -χ²/(2T) - ½ dᵀW⁻¹d - ½ log det(I + W H/T), with d the parameters' distance from what was
expected, W their variances before any data and H = JᵀJ the information of the data on them. The
second term pays for what is implausible, the third for parameters: the more narrowly the data pin
one down within what was plausible, the more it costs (MacKay 2003, ch. 28).

T is the temperature of the data: χ² per sample of the best explanation, times the number of
samples whose residuals go together, neighbours in time and azimuths. It is 1 where the best
explanation leaves nothing but white noise; where even the best one leaves more, differences of χ²
count for less. Every further effect costs a fixed prior, and so does one whose parameters each
group of motions has its own of; each of these is paid for by the second and the third term.
Differences that are within what models themselves have wrong count for less: see `discounted`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from slosh_base.types import Array
from slosh_discovery.discover.explanation import Key
from slosh_discovery.discover.fitting import Fit
from slosh_discovery.discover.problem import PreparedMotion
from slosh_discovery.discover.tuning import TUNING
from slosh_model.effects.registry import EFFECTS

LONGEST_LAG = 60

Logs = dict[Key, float]


def log_evidence(fit: Fit, temperature: float) -> float:
    """Returns the log of evidence times prior of a fitted candidate model."""
    spreads = fit.explanation.spreads
    information = fit.information * np.outer(spreads, spreads) / temperature
    _, log_determinant = np.linalg.slogdet(np.eye(len(information)) + information)
    return -0.5 * fit.chi_square / temperature - 0.5 * float(log_determinant) + log_prior(fit)


def discounted(logs: Mapping[Key, float], fits: Mapping[Key, Fit], temperature: float) -> Logs:
    """Reduces differences in log evidence to account for the models' limited accuracy.

    No model has what it explains right to the last percent: terms of the second order are left
    out on all sides. Two explanations whose heights differ by no more than that are told apart by
    the error of either, not by the data. So the difference of two answers has an error of its
    own, of MODEL_ERROR of what the likeliest explains: the component of the data along it, which
    is all by which their χ² differ, has the variance T + (MODEL_ERROR ‖explained‖)² in place of T.
    Whether one more effect is at work beside others is another question, and stays as it is.

    Args:
        logs: of each explanation, as `log_evidence` gives them.
        fits: by the same keys, and the base.
        temperature: T.
    """
    first = max(logs, key=lambda key: logs[key])
    best = fits[first]
    effects = set(best.explanation.effects)
    explained = fits[(), ()].residual - best.residual
    share = 1.0 / (1.0 + TUNING.model_error**2 * float(explained @ explained) / temperature)
    told_apart = dict(logs)
    for key in logs:
        others = set(fits[key].explanation.effects)
        worse = fits[key].chi_square - best.chi_square
        if worse > 0.0 and not effects <= others and not others <= effects:
            # What fits worse never becomes the likelier one.
            given_back = 0.5 * (1.0 - share) * worse / temperature
            told_apart[key] = min(logs[key] + given_back, logs[first])
    return told_apart


def log_prior(fit: Fit) -> float:
    """Returns the log prior probability of a candidate model, up to a constant."""
    explanation = fit.explanation
    surprise = (fit.vector - explanation.centres) / explanation.spreads
    return (
        sum(math.log(TUNING.effect_prior * EFFECTS[name].odds) for name in explanation.effects)
        + len(explanation.per_group) * math.log(TUNING.group_prior)
        - len(explanation.chosen) * math.log(2.0)
        - 0.5 * float(surprise @ surprise)
    )


def temperature_of(fit: Fit, motions: Sequence[PreparedMotion]) -> float:
    """Returns the variance of a fit's residual [noise²] times its correlation length."""
    return residual_temperature(fit.residual, len(fit.vector), motions)


def residual_temperature(
    residual: Array, parameters: int, motions: Sequence[PreparedMotion]
) -> float:
    """Returns the variance of a residual [noise²] times its correlation length."""
    count = len(residual) - parameters
    series = residual_series(residual, motions)
    together = correlation_length(series) * columns_together(series)
    return max(float(residual @ residual) / max(count, 1), 1e-12) * together


def columns_together(series: Sequence[Array]) -> float:
    """Returns how many azimuths have correlated residuals; 1 for white noise or one azimuth.

    K (tr C²)/(tr C)² with the columns' covariance C, averaged over motions with as many columns.
    """
    ratios = []
    for columns in series:
        centred = np.nan_to_num(columns - np.nanmean(columns, axis=0))
        covariance = centred.T @ centred
        trace = float(np.trace(covariance))
        if trace > 0.0:
            ratios.append(len(covariance) * float(np.sum(covariance**2)) / trace**2)
    return max(float(np.mean(ratios)), 1.0) if ratios else 1.0


def correlation_length(series: Sequence[Array]) -> float:
    """Returns the correlation length of residuals [samples]; 1 for white noise."""
    total = np.zeros(LONGEST_LAG + 1)
    for columns in series:
        centred = np.nan_to_num(columns - np.nanmean(columns, axis=0))
        for lag in range(min(LONGEST_LAG, len(centred) - 1) + 1):
            total[lag] += float(np.sum(centred[lag:] * centred[: len(centred) - lag]))
    if total[0] <= 0.0:
        return 1.0
    length = 1.0
    for correlation in (total[1:] / total[0]).tolist():
        if correlation < TUNING.least_correlation:
            break
        length += 2.0 * correlation
    return length


def residual_series(residual: Array, motions: Sequence[PreparedMotion]) -> list[Array]:
    """Returns each motion's residual (times, azimuths), NaN where nothing was measured."""
    parts = parts_of(residual, motions)
    return [motion.laid(part) for motion, part in zip(motions, parts, strict=True)]


def parts_of(residual: Array, motions: Sequence[PreparedMotion]) -> list[Array]:
    """Splits a concatenated residual (N,) into one array per motion."""
    ends = np.cumsum([int(motion.kept.sum()) for motion in motions])
    return np.split(residual, ends[:-1])


def probabilities(log_evidences: Sequence[float]) -> Array:
    """Returns the probabilities of candidate models from log evidences; they sum to 1."""
    logs = np.array(log_evidences)
    weights = np.exp(logs - logs.max())
    shares: Array = weights / weights.sum()
    return shares


def standard_errors(fit: Fit, temperature: float) -> Array:
    """Returns standard errors (P,) of the free parameters, not above their prior deviations."""
    spreads = fit.explanation.spreads
    information = fit.information * np.outer(spreads, spreads) / temperature
    information += np.eye(len(spreads))
    errors: Array = spreads * np.sqrt(np.diag(np.linalg.inv(information)))
    return errors
