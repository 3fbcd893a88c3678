"""What the tests of all packages share."""

from collections.abc import Iterator

import pytest

from slosh_msgs_py.node.domain import own_domain


@pytest.fixture(scope="session", autouse=True)
def domain() -> Iterator[int]:
    """The DDS domain of this run, or of this worker of it, alone; every test speaks in it."""
    with own_domain() as number, pytest.MonkeyPatch.context() as environment:
        environment.setenv("ROS_DOMAIN_ID", str(number))
        environment.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        yield number
