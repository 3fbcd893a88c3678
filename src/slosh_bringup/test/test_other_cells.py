"""Another cell in the namespace is told when it is seen, once, and one's own nodes are none."""

import pytest

from slosh_bringup.live.other_cells import OtherCells
from slosh_msgs_py.node.rivals import FORGOTTEN

NAMES = ("estimator", "monitor")


@pytest.fixture
def cells():
    """This cell has started its nodes at 0 s."""
    others = OtherCells()
    for name in NAMES:
        others.started(name, 0.0)
    return others


def counts(**extra):
    """What the graph shows: this cell's nodes, and so many more of a name."""
    return {name: 1 + extra.get(name, 0) for name in NAMES}


def test_another_cell_is_told_once_with_all_of_its_nodes_and_again_when_it_comes_back(cells):
    both = counts(estimator=1, monitor=1)
    seen = [counts(estimator=1), both, both, both, counts(), counts(), both, both]
    told = [cells.look(one, float(now)) for now, one in enumerate(seen)]
    assert told == [[], [], list(NAMES), [], [], [], [], list(NAMES)]


def test_a_node_that_was_killed_and_started_again_is_ones_own_until_it_should_be_forgotten(cells):
    cells.started("monitor", 10.0)
    seen = [cells.look(counts(monitor=1), 10.0 + age) for age in (1.0, 2.0, FORGOTTEN)]
    assert seen == [[]] * 3
    late = 10.0 + FORGOTTEN
    assert [cells.look(counts(monitor=1), late + age) for age in (1.0, 2.0)] == [[], ["monitor"]]
