"""Test scenes of a drawn cup, from slosh_testing."""

import pytest

from slosh_testing.drawn_cup import Scene, Wave


@pytest.fixture(scope="session")
def make_scene() -> type[Scene]:
    return Scene


@pytest.fixture(scope="session")
def make_wave() -> type[Wave]:
    return Wave
