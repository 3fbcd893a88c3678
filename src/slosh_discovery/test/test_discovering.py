"""From files to a finding's report: which motions are fitted, which images are shown."""

import shutil
from pathlib import Path

import pytest
from example_finding import example_finding, example_motion

from slosh_bag.reader import BagReader
from slosh_discovery.discover.finding import Role, WorstMoment
from slosh_discovery.discover_data import read_motions
from slosh_discovery.discover_frames import worst_frames
from slosh_discovery.discovering import part, recorded_model, unique_names
from slosh_discovery.errors import SloshDiscoveryError

BAGS = Path(__file__).parents[3] / "bags"


@pytest.fixture
def day():
    """A recording of the simulated cell."""
    if not (BAGS / "c3").exists():
        pytest.skip("the recordings are not there")
    return BAGS / "c3"


def test_the_worst_moments_images_are_those_of_their_stamps(day):
    asked = []

    def picture(bag, wanted):
        asked.append((bag, dict(wanted)))
        return dict.fromkeys(wanted, (b"jpeg", 0.0123))

    motion, *_ = read_motions(day)
    moments = [
        WorstMoment(motion.name, float(motion.t[row]), 0.01, 0.02, 0.01) for row in (7, 9, 11, 13)
    ]
    elsewhere = WorstMoment("other#1", 1.0, 0.01, 0.02, 0.01)
    for data in (day, day.parent):
        frames = worst_frames([data], [elsewhere, *moments], picture)
        assert [frame.caption[:7] for frame in frames] == ["B: c3#1", "C: c3#1"]
        assert frames[0].caption.endswith(" s, 12.3 mm")
    reader = BagReader(day)
    stamps = {
        1_000_000_000 * surface.header.stamp.sec + surface.header.stamp.nanosec
        for surface in (reader.decode(m) for m in reader.messages(["/slosh/free_surface"]))
    }
    # A bag is asked once for all of its moments.
    assert [bag for bag, _ in asked] == [day, day]
    assert list(asked[0][1]) == ["B", "C"]
    assert set(asked[0][1].values()) <= stamps
    assert len(set(asked[0][1].values())) == 2


def test_a_name_that_two_bags_share_brings_no_image(day, tmp_path):
    copy = tmp_path / day.name
    shutil.copytree(day, copy)
    moment = WorstMoment("c3#1", 1.0, 0.01, 0.02, 0.01)
    assert worst_frames([day, copy], [moment], pytest.fail) == ()


def test_motions_of_one_name_are_told_apart():
    motions = tuple(example_motion(name, 1) for name in ("run#1", "run#2", "run#1"))
    fit, holdout = unique_names(motions[:2], motions[2:])
    assert [motion.name for motion in fit] == ["run#1 (1)", "run#2"]
    assert [motion.name for motion in holdout] == ["run#1 (2)"]


def test_every_motion_is_either_fitted_or_held_out():
    motions = example_finding().motions * 3
    fit, holdout = part(motions)
    assert len(fit) == 6
    assert holdout == motions[2::3]
    assert all(entry.role is Role.HOLDOUT for entry in motions[2::3])


def test_a_table_tells_no_model(tmp_path):
    with pytest.raises(SloshDiscoveryError, match="give one"):
        recorded_model(tmp_path / "run_1.csv")
