"""What the tests of all packages share."""

from __future__ import annotations

import importlib
import itertools
import os
import shutil
import signal
from collections import Counter
from collections.abc import Iterator
from types import ModuleType
from typing import Any

import headless_browser
import pytest
from hypothesis import settings
from live_browser import LiveBrowser

from slosh_msgs_py.node.dead_ports import free_dead_ports
from slosh_msgs_py.node.domain import own_domain

FIRST_DOMAINS = itertools.count(os.getpid(), 7)
"""Where each file's tests look for a free domain: not where those before them were."""
REAL_TIME = "tests/real_time/"
"""Tests of processes that must keep pace: one worker runs them all, one after the other."""

# `make test` tries the same few examples in every run: what passed for a change passes again.
# `make test-all` looks for new ones.
settings.register_profile("same", max_examples=20, derandomize=True, deadline=None, database=None)
settings.register_profile("search", deadline=None)
settings.load_profile("same")


@pytest.fixture(scope="module", autouse=True)
def domain() -> Iterator[int]:
    """The DDS domain of a file's tests alone.

    What an earlier file's tests have killed is still known in its domain for some seconds, and
    holds up who publishes there.
    """
    with own_domain(next(FIRST_DOMAINS)) as number, pytest.MonkeyPatch.context() as environment:
        environment.setenv("ROS_DOMAIN_ID", str(number))
        environment.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        free_dead_ports()
        yield number


@pytest.fixture(scope="session", autouse=True)
def interrupts() -> None:
    """Workers ignore Ctrl-C, nohup the hang-up, and what a test starts would inherit that."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


def skip_without(found: str | None, what: str, package: str) -> None:
    """Skips the test, with the remedy, where a program is not installed."""
    if found is None:
        pytest.skip(f"no {what} on this machine: sudo apt install {package}")


@pytest.fixture(scope="session")
def headless() -> ModuleType:
    """The module that renders pages in a browser; the test is skipped where there is none."""
    skip_without(headless_browser.find_browser(), "browser", "chromium")
    return headless_browser


@pytest.fixture(scope="module")
def browser(headless: ModuleType) -> Iterator[LiveBrowser]:
    """A running browser."""
    with LiveBrowser() as found:
        yield found


@pytest.fixture(scope="session")
def ray_tracer() -> None:
    """Skips the test where no ray tracer is installed."""
    skip_without(shutil.which("povray"), "ray tracer", "povray")


@pytest.fixture(scope="session")
def new_broker() -> Any:
    """The class of MQTT brokers; the test is skipped where there is none."""
    plc = importlib.import_module("slosh_testing.plc")
    skip_without(plc.find_mosquitto(), "MQTT broker", "mosquitto")
    return plc.Broker


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Marks as long what follows the first cases of a test that says how many are enough."""
    seen: Counter[str] = Counter()
    for item in items:
        enough = item.get_closest_marker("first")
        if enough is not None:
            function = item.nodeid.partition("[")[0]
            seen[function] += 1
            if seen[function] > enough.args[0]:
                item.add_marker(pytest.mark.long)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Hands the tests to the workers file by file, so that what a file prepares is made once."""
    from xdist.scheduler import LoadFileScheduling

    class ByFile(LoadFileScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return REAL_TIME if nodeid.startswith(REAL_TIME) else super()._split_scope(nodeid)

    return ByFile(config, log)
