"""Tests the list of cells: state, nearest height and page of each; silent ones not safe."""

import math

import pytest

from slosh_bringup.cell_watch import NodeReport
from slosh_bringup.watch.cells import MOST_CELLS, CellList
from slosh_bringup.watch.state import Compared


def compared(measured, estimated, state=0):
    nan = math.nan
    return Compared(1, measured, nan, estimated, nan, nan, nan, state, ())


def cells():
    made = CellList("/a")
    made.take_parameters("/a", "monitor", {"measured_limit": 0.02, "estimated_limit": 0.01})
    made.take_comparison("/a", compared(0.012, 0.008), 1.0)
    return made


def test_one_cell_has_no_list():
    assert cells().rows(1.0) == []


def test_each_cell_is_listed_with_the_height_nearest_to_its_limit():
    made = cells()
    made.take_comparison("/b", compared(math.nan, 0.001, state=1), 1.0)
    made.take_report("/b", NodeReport("watch", 0, "", {"page port": "7568"}))
    made.take_report("/b", NodeReport("monitor", 0, "", {"worst container": "far"}))
    own, other = made.rows(1.2)
    assert (own["name"], own["own"], own["verdict"]) == ("/a", True, "safe")
    assert (own["height"], own["limit"]) == (0.008, 0.01)
    assert (other["name"], other["own"], other["verdict"]) == ("/b", False, "near limit")
    assert (other["height"], other["port"], other["worst"]) == (0.001, 7568, "far")
    assert made.rows(9.0)[1]["verdict"] == "blind"
    made.keep(["/c"])
    assert made.names == ("/a",)


@pytest.mark.parametrize("port", ["", "-1", "7e3", "123456", "javascript:x"])
def test_a_port_that_is_none_is_no_link(port):
    made = cells()
    made.take_comparison("/b", compared(0.0, 0.0), 1.0)
    made.take_report("/b", NodeReport("watch", 0, "", {"page port": port}))
    assert made.rows(1.0)[1]["port"] == 0


def test_a_flood_of_cells_and_reports_of_strangers_is_bounded():
    made = cells()
    for number in range(1000):
        made.take_comparison(f"/n{number}", compared(0.0, 0.0), 1.0)
        made.take_report(f"/m{number}", NodeReport("watch", 0, "", {"page port": "1"}))
    assert len(made.rows(1.0)) == MOST_CELLS
