"""Tuning numbers of the servers for controllers outside ROS."""

from __future__ import annotations

from dataclasses import dataclass

from slosh_base.tuning import number


@dataclass(frozen=True, slots=True)
class PlcTuning:
    """Time constants of the servers, which report within 1 s that a cell's messages stopped."""

    silence: float = number(0.75, "s", "time without a message after which its values are bad")
    oldest: float = number(2.0, "s", "age of a stamp, or time ahead, from which a value is bad")
    period: float = number(0.1, "s", "time between two updates of OPC UA and MQTT")
    retry: float = number(2.0, "s", "time between two attempts to reach an MQTT broker")
    keep_alive: int = number(1, "s", "keep-alive time that an MQTT broker is told")
    starting: float = number(240.0, "s", "longest time that the servers may take to start")
    validity: float = number(730.0, "day", "validity of a new certificate")
    longest_validity: float = number(36500.0, "day", "longest validity of a new certificate")
    expiring: float = number(30.0, "day", "rest of a certificate's time that is reported")


TUNING = PlcTuning()
