"""Two demonstrations at once in one shell, which has set a DDS domain: they do not meet."""

import pytest

from slosh_bringup.live.run_data import read_run
from slosh_replay.recorded_run import RecordedRun
from slosh_replay.replay import replay_bag
from slosh_testing.live_processes import live_process

TOO_SLOW = "this machine is too slow for the demonstration"
MOVED = "another run uses /slosh in ROS_DOMAIN_ID"


@pytest.mark.long
def test_each_has_a_domain_of_its_own(tmp_path):
    words = "demo", "--motion", "l", "-o"
    with (
        live_process(*words, str(tmp_path / "a"), output=tmp_path / "words_a") as one,
        live_process(*words, str(tmp_path / "b"), output=tmp_path / "words_b") as other,
    ):
        codes = [run.end() for run in (one, other)]
    assert sum(MOVED in run.said for run in (one, other)) == 1
    for name, run, code in zip("ab", (one, other), codes, strict=True):
        data = read_run(RecordedRun(tmp_path / name / "latest" / "bag"))
        assert not data.mixed
        # Two at once are more than a slow machine can do; it says so, and that is no mixture.
        assert code == int(bool(sum(data.lost().values())) or TOO_SLOW in run.said), run.said
        assert replay_bag(data.run).verification.exact
