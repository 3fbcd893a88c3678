"""Test reports, from slosh_testing."""

import pytest

from slosh_testing import reports


@pytest.fixture(scope="session")
def full_report():
    return reports.full_report()


@pytest.fixture(scope="session")
def hostile_report():
    return reports.hostile_report()
