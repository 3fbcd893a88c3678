"""The root exception of the package slosh_plan."""

from __future__ import annotations


class SloshPlanError(ValueError):
    """An error whose one-line text says why a motion or a limit cannot be used.

    >>> from slosh_plan import HeightLimits, SloshPlanError
    >>> try:
    ...     HeightLimits(height=-0.02)
    ... except SloshPlanError as error:
    ...     print(error)
    height limit = -0.02 m must lie above 0 and up to 1 m
    """
