"""The root exception of the package."""

from __future__ import annotations


class SloshPlanError(ValueError):
    """A motion or a limit cannot be used; the text is one line.

    >>> from slosh_plan import HeightLimits, SloshPlanError
    >>> try:
    ...     HeightLimits(height=-0.02)
    ... except SloshPlanError as error:
    ...     print(error)
    height limit = -0.02 m must lie above 0 and up to 1 m
    """
