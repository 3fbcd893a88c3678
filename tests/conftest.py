"""What the tests across packages share."""

import os

import pytest


@pytest.fixture
def domain(monkeypatch):
    """A DDS domain of this test alone, on this machine alone."""
    number = 1 + os.getpid() % 100
    monkeypatch.setenv("ROS_DOMAIN_ID", str(number))
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    return number
