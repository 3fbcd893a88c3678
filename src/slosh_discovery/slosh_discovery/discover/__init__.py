"""Finds which physical effect explains the difference between a model and measurements.

Pure: measured motions and a model in, a finding out; no files, no clock.
"""

from slosh_discovery.discover.finding import Finding, Verdict
from slosh_discovery.discover.motion import MeasuredMotion
from slosh_discovery.discover.workflow import discover

__all__ = ["Finding", "MeasuredMotion", "Verdict", "discover"]
