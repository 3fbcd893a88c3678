"""Identification: estimates a model's parameters from measured motions (TM20, §2.4)."""

from __future__ import annotations

from slosh_discovery.identify.result import Identification, Strategy
from slosh_discovery.identify.workflow import identify

__all__ = ["Identification", "Strategy", "identify"]
