"""The drawn cup of slosh_testing, for the tests of the camera."""

import pytest

from slosh_testing.drawn_cup import Scene, Wave


@pytest.fixture(scope="session")
def make_scene() -> type[Scene]:
    return Scene


@pytest.fixture(scope="session")
def make_wave() -> type[Wave]:
    return Wave
