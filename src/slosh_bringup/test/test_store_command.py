"""Tests that `slosh store` lists bags, and deletes exactly the listed ones on request."""

import json
import os
import time

import pytest

from slosh_bag.held_folder import HeldFolder
from slosh_bringup.cli.main import main

DAY = 86400.0


@pytest.fixture
def runs(tmp_path):
    """Writes three runs, recorded 40, 20 and 2 days ago."""
    for number, age in ((1, 40), (2, 20), (3, 2)):
        folder = tmp_path / f"2026-01-0{number}T10-00-00" / "bag"
        folder.mkdir(parents=True)
        file = folder / "bag_0.mcap"
        file.write_bytes(bytes(2_000_000))
        os.utime(file, (time.time() - age * DAY,) * 2)
    return tmp_path


def bags(runs):
    return sorted(path.parent.parent.name[9] for path in runs.glob("*/bag/*.mcap"))


def test_it_shows_before_it_deletes(runs, capsys):
    line = ["store", str(runs), "--days", "30", "--quota", "3MB"]
    assert main(line) == 0
    text = capsys.readouterr().out
    assert text.count("would be deleted") == 3
    assert "3 bags, 6.0 MB; 2 of them, 4.0 MB, would be deleted" in text
    assert bags(runs) == ["1", "2", "3"]
    assert main([*line, "--delete"]) == 0
    assert "2 of them, 4.0 MB, deleted" in capsys.readouterr().out
    assert bags(runs) == ["3"]
    assert main(line) == 0
    assert "1 bags, 2.0 MB; 0 of them" in capsys.readouterr().out


def test_without_limits_all_is_kept(runs, capsys):
    assert main(["store", str(runs), "--json", "--delete"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert [row["surplus"] for row in told["bags"]] == [False] * 3
    assert {row["size"] for row in told["bags"]} == {2_000_000}
    assert bags(runs) == ["1", "2", "3"]


def test_a_running_recording_stays_and_its_excess_is_told(runs, capsys):
    held = HeldFolder(runs / "2026-01-01T10-00-00" / "bag")
    assert main(["store", str(runs), "--quota", "1MB", "--delete"]) == 1
    assert "the running recording exceeds the quota by 1.0 MB" in capsys.readouterr().out
    assert bags(runs) == ["1"]
    held.release()


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (["--days", "-1"], "days = -1.0 must not be negative"),
        (["--days", "9", "--event-days", "3"], "event bags are kept longer"),
        (["--days", "nan"], "must not be negative"),
    ],
)
def test_limits_that_do_not_fit_are_refused(runs, capsys, given, told):
    assert main(["store", str(runs), *given]) == 2
    said = capsys.readouterr().err
    assert told in said
    assert said.strip().count("\n") == 0


def test_a_quota_is_a_size(runs, capsys):
    with pytest.raises(SystemExit) as ended:
        main(["store", str(runs), "--quota", "3 parrots"])
    assert ended.value.code == 2
    assert "unknown unit 'parrots'" in capsys.readouterr().err


def test_a_folder_that_is_not_there_is_named(tmp_path, capsys):
    assert main(["store", str(tmp_path / "absent")]) == 2
    said = capsys.readouterr().err
    assert "absent: No such file or directory; name the folder of a cell's runs" in said
    assert "slosh store RUNS" in said
