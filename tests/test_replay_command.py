"""Tests `slosh replay`: many bags, manifests, checks and files for other programs."""

import argparse
import json
import math
import os
import re
import shutil
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml

from slosh_bag.reader import BagReader
from slosh_bringup.cli import replay as replay_command
from slosh_bringup.cli.main import main
from slosh_bringup.cli.replay import find_bags
from slosh_bringup.replay import task as task_module
from slosh_bringup.replay.task import unique_names
from slosh_replay.replay import replay_bag
from slosh_testing.live_bag import TEXT, LiveBag


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Writes three bags of two seconds, which tests must not change."""
    folder = tmp_path_factory.mktemp("recorded") / "bags"
    for name, height in (("a", 1.0), ("b", 1.1), ("c", 1.2)):
        live = LiveBag()
        live.height = height
        live.unrecorded = {700, 701} if name == "b" else ()
        live.write(folder / name, seconds=1.0)
    return folder


@pytest.fixture
def bags(recorded, tmp_path):
    """Copies the three bags, for tests that change them."""
    return shutil.copytree(recorded, tmp_path / "bags")


@pytest.fixture
def changed_model(tmp_path):
    path = tmp_path / "changed.yaml"
    path.write_text(TEXT.replace("0.58", repr(math.nextafter(0.58, 1.0))))
    return path


def replay(capsys, *words, jobs="1"):
    """Runs `slosh replay`; returns exit code, output and errors without the progress bar."""
    capsys.readouterr()
    code = main(["replay", "--jobs", jobs, *map(str, words)])
    out, err = capsys.readouterr()
    lines = [line for line in re.split(r"[\r\n]", err) if line and not line.startswith("replay: ")]
    return code, out, lines


def table(out):
    """Returns the rows of the first printed table, as lists of cells."""
    lines = out.split("\n\n")[0].splitlines()
    return {cells[0]: cells[1:] for cells in (re.split(r"  +", line) for line in lines)}


def test_one_bag(recorded, capsys):
    code, out, errors = replay(capsys, recorded / "a")
    assert (code, errors) == (0, [])
    assert table(out)["bag"] == ["images", "dropped", "events", "estimates"]
    assert table(out)["a"][0] == "188"
    assert table(out)["a"][3] == "1500 bit for bit"
    assert "MAE 3D-NL" in out


def test_a_folder_of_bags(recorded, capsys):
    code, out, errors = replay(capsys, recorded)
    assert (code, errors) == (0, [])
    assert list(table(out)) == ["bag", "a", "b", "c"]
    assert table(out)["b"][1] == "2"  # not used live
    assert "mean" in out
    assert max(map(len, out.splitlines())) < 100


def test_without_a_manifest_a_check_asks_for_the_recorded_estimates(
    recorded, capsys, changed_model
):
    code, out, errors = replay(capsys, recorded, "--check")
    assert (code, errors) == (0, ["3 of 3 bags as expected"])
    assert {row[-1] for row in list(table(out).values())[1:]} == {"as expected"}
    code, out, errors = replay(capsys, recorded / "a", "--check", "--model", changed_model)
    assert code == 1
    assert table(out)["a"][-1] == "FAILED"
    assert any("alpha: recorded 0.58, replayed with 0.58000" in line for line in errors)
    assert any("first difference: nonlinear." in line for line in errors)
    assert errors[-1] == "0 of 1 bags as expected"


def test_a_manifest_that_was_written_passes_and_then_sees_every_change(
    bags, capsys, changed_model
):
    code, _, errors = replay(capsys, bags, "--write-manifest")
    assert (code, errors) == (0, [f"{bags / 'manifest.yaml'}: 3 bags"])
    assert replay(capsys, bags, "--check")[::2] == (0, ["3 of 3 bags as expected"])

    manifest = bags / "manifest.yaml"
    stated = yaml.safe_load(manifest.read_text())
    assert stated["bags"]["b"]["drops"] == 2
    stated["bags"]["a"]["sigma"]["3D-L"]["value"] += 1e-5
    stated["bags"]["c"]["events"] = []
    stated["bags"]["c"]["shows"] = "a camera that sees too much"
    manifest.write_text(yaml.safe_dump(stated))
    code, out, errors = replay(capsys, bags, "--check")
    assert code == 1
    assert [row[-1] for row in list(table(out).values())[1:]] == [
        "FAILED",
        "as expected",
        "FAILED",
    ]
    a, c, last = errors
    assert re.match(r"slosh replay: a: MAE 3D-L: [\d.]+ mm, expected [\d.]+ … [\d.]+ mm", a)
    assert re.match(r"slosh replay: c: limit events: \d, expected 0", c)
    assert last == "1 of 3 bags as expected"

    shutil.rmtree(bags / "a")
    LiveBag().write(bags / "a", seconds=1.2)  # another recording under the same name
    code, _, errors = replay(capsys, bags / "a", "--check")
    assert code == 1
    assert any("images: 200, expected 188" in line for line in errors)

    assert replay(capsys, bags, "--write-manifest")[0] == 0
    assert replay(capsys, bags, "--check")[0] == 0
    assert yaml.safe_load(manifest.read_text())["bags"]["c"]["shows"] == (
        "a camera that sees too much"
    )
    assert replay(capsys, bags, "--check", "--model", changed_model)[0] == 1


def test_a_failure_that_is_shown_ends_with_1_and_another_model_is_not_judged(
    bags, capsys, changed_model
):
    assert replay(capsys, bags, "--write-manifest")[0] == 0
    code, out, _ = replay(capsys, bags, "--model", changed_model)
    assert (code, "FAILED" in out) == (0, False)
    manifest = bags / "manifest.yaml"
    stated = yaml.safe_load(manifest.read_text())
    stated["bags"]["b"]["drops"] = 5
    manifest.write_text(yaml.safe_dump(stated))
    code, out, _ = replay(capsys, bags)
    assert (code, table(out)["b"][-1]) == (1, "FAILED")


def test_a_model_of_the_manifest_is_replayed_with_and_kept(bags, capsys, changed_model):
    code, _, _ = replay(capsys, bags / "a", "--write-manifest", "--model", changed_model)
    assert code == 0
    stated = yaml.safe_load((bags / "manifest.yaml").read_text())["bags"]["a"]
    assert stated["model"] == "models/changed.yaml"  # a copy, which goes with the folder
    assert stated["estimates"] == "exact"  # which this model cannot give
    code, _, errors = replay(capsys, bags / "a", "--check")
    assert code == 1
    assert not any("MAE" in line for line in errors)  # with it all other figures are as stated
    assert any("alpha" in line for line in errors)
    (bags / stated["model"]).write_text("container: 5\n")
    code, _, errors = replay(capsys, bags / "a", "--check")
    assert code == 1
    assert "changed.yaml" in errors[0]


@pytest.mark.long
def test_a_bag_that_lacks_and_one_that_is_not_named_fail(bags, capsys):
    replay(capsys, bags, "--write-manifest")
    (bags / "c").rename(bags / "d")
    code, out, errors = replay(capsys, bags, "--check")
    assert code == 1
    assert table(out)["c"][-2:] == ["not replayed", "FAILED"]
    assert table(out)["d"][-1] == "FAILED"
    assert errors == [
        f"slosh replay: {bags / 'c'}: no such file or folder",
        "slosh replay: d: the manifest does not list this bag",
        "2 of 4 bags as expected",
    ]
    assert replay(capsys, bags)[0] == 1  # what is shown as failed
    code, _, _ = replay(capsys, bags, "--write-manifest")
    assert code == 1
    stated = yaml.safe_load((bags / "manifest.yaml").read_text())["bags"]
    assert list(stated) == ["a", "b", "c", "d"]


def test_a_broken_bag_does_not_stop_the_others(bags, capsys):
    (file,) = (bags / "b").glob("*.mcap")
    file.write_bytes(b"no bag")
    code, out, errors = replay(capsys, bags, "-o", bags.parent / "out")
    assert code == 1
    assert errors == [
        f"slosh replay: {file}: not an MCAP file: it is a text file; choose the bag itself"
    ]
    assert list(table(out)) == ["bag", "a", "b", "c"]
    assert (bags.parent / "out" / "c.html").is_file()
    assert replay(capsys, bags, "--check")[0] == 1
    assert replay(capsys, bags / "b")[0] == 2


def test_bags_in_subfolders_have_their_place_in_the_manifest(recorded, tmp_path, capsys):
    shutil.copytree(recorded / "a", tmp_path / "bags" / "deep" / "a")
    shutil.copytree(recorded / "b", tmp_path / "bags" / "b")
    assert replay(capsys, tmp_path / "bags", "--write-manifest")[0] == 0
    assert not (tmp_path / "bags" / "deep" / "manifest.yaml").exists()
    stated = yaml.safe_load((tmp_path / "bags" / "manifest.yaml").read_text())["bags"]
    assert list(stated) == ["b", "deep/a"]
    assert replay(capsys, tmp_path / "bags", "--check")[0] == 0


@pytest.mark.long
def test_a_bag_with_a_strangers_name_is_one_row_and_obeys_nobody(bags, tmp_path, capsys):
    name = "<script>alert(1)<\\script>\x1b[31m\nall is well"
    (bags / "a").rename(bags / name)
    output = tmp_path / "out"
    code, out, lines = replay(capsys, bags, "-o", output)
    assert code == 0
    assert "<script>alert(1)<\\script>\\x1b[31m\\nall is well  " in out
    assert not any(line.startswith("all is well") for line in [*out.splitlines(), *lines])
    pages = [path.read_text() for path in output.glob("*.html")]
    assert len(pages) == 4
    assert not any("<script>alert" in page or "\x1b" in page for page in pages)


def test_outputs_are_a_page_figures_a_bag_and_an_index(recorded, tmp_path, capsys):
    output = tmp_path / "new" / "out"
    assert replay(capsys, recorded, "-o", output)[0] == 0
    assert sorted(path.name for path in output.iterdir()) == [
        *(f"{name}{end}" for name in "abc" for end in ("", ".html", ".json")),
        "index.html",
    ]
    before = (output / "a" / "a_0.mcap").read_bytes()
    assert replay(capsys, recorded / "a", "-o", output)[0] == 0
    assert (output / "a" / "a_0.mcap").read_bytes() == before
    figures = json.loads((output / "a.json").read_text())
    assert figures["replay"]["verification"]["exact"]
    assert BagReader(output / "a").topics()["/slosh/estimate"].count == 1500


def test_an_interrupted_replay_goes_on_with_the_rest(bags, tmp_path, capsys, monkeypatch):
    done, stop = [], {"at": 2}

    def counted(run, *given, **options):
        if len(done) == stop["at"]:
            raise KeyboardInterrupt
        done.append(run.path.name)
        return replay_bag(run, *given, **options)

    monkeypatch.setattr(task_module, "replay_bag", counted)
    words = [bags, "-o", tmp_path / "out", "--json", "--check"]
    assert replay(capsys, *words)[0] == 1
    first = list(done)
    assert len(first) == 2
    done.clear()
    stop["at"] = 99
    # One of them has changed since: the other one is left.
    (recording,) = (bags / first[1]).glob("*.mcap")
    os.utime(recording, ns=(1, 1))
    code, out, errors = replay(capsys, *words)
    assert first[0] not in done
    assert first[1] in done
    assert "slosh replay: 1 of 3 bags were replayed by the interrupted run" in errors
    # The same as in one go, and the run after a whole one is a new one.
    done.clear()
    assert replay(capsys, *words)[:2] == (code, out)
    assert len(done) == 3


def test_a_recording_is_never_taken_for_an_old_output(bags, capsys):
    """Its folder has the very name that the output gets."""
    before = {path: path.read_bytes() for path in (bags / "a").iterdir()}
    code, _, errors = replay(capsys, bags / "a", "-o", bags)
    assert code == 2
    assert errors == [f"slosh replay: {bags / 'a'}: is the input; choose another folder"]
    assert {path: path.read_bytes() for path in (bags / "a").iterdir()} == before


@pytest.mark.parametrize("stranger", ["notes.txt", "a_9.mcap", "metadata.yaml"])
def test_strangers_files_are_not_touched(recorded, tmp_path, capsys, stranger):
    place = tmp_path / "a" / stranger
    place.parent.mkdir()
    place.write_text("mine")
    code, _, errors = replay(capsys, recorded / "a", "-o", tmp_path)
    assert code == 2
    assert len(errors) == 1
    assert place.read_text() == "mine"
    assert list(tmp_path.iterdir()) == [place.parent]


@pytest.mark.long
def test_outputs_within_the_folder_of_bags_are_none(bags, capsys):
    for _ in range(2):
        code, out, errors = replay(capsys, bags, "-o", bags / "out", "--check")
        assert (code, errors) == (0, ["3 of 3 bags as expected"])
        assert list(table(out)) == ["bag", "a", "b", "c"]


def test_json_is_all_that_is_printed(bags, capsys):
    (file,) = (bags / "b").glob("*.mcap")
    file.write_bytes(b"no bag")
    code, out, errors = replay(capsys, bags, "--check", "--json")
    assert code == 1
    a, b, c = json.loads(out)
    assert [item["name"] for item in (a, b, c)] == ["a", "b", "c"]
    assert b["error"] == f"{file}: not an MCAP file: it is a text file; choose the bag itself"
    assert a["verification"]["exact"]
    assert a["checks"] == [
        {"name": "recorded estimates", "failure": ""}, {"name": "warnings", "failure": ""}
    ]  # fmt: skip
    assert "NaN" not in out
    assert len(errors) == 2


def test_junit_names_everything_that_was_looked_at(bags, capsys, changed_model):
    replay(capsys, bags, "--write-manifest")
    (file,) = (bags / "b").glob("*.mcap")
    file.write_bytes(b"no bag")
    path = bags.parent / "reports" / "junit.xml"
    assert replay(capsys, bags, "--check", "--junit", path, "--model", changed_model)[0] == 1
    root = ElementTree.parse(path).getroot()
    assert root.tag == "testsuites"
    suites = {suite.get("name"): suite for suite in root}
    assert list(suites) == ["a", "b", "c"]
    names = [case.get("name") for case in suites["a"]]
    assert names[:2] == ["replay", "MAE 2D-L"]
    assert "recorded estimates" in names
    failed = [case for case in suites["a"] if case.find("failure") is not None]
    assert {case.get("name") for case in failed} == {"recorded estimates"}
    assert int(suites["a"].get("failures")) == len(failed) >= 3
    assert int(suites["a"].get("tests")) == len(suites["a"])
    assert float(suites["a"].get("time")) > 0.0
    (error,) = suites["b"].iter("error")
    assert (
        error.get("message")
        == f"{file}: not an MCAP file: it is a text file; choose the bag itself"
    )
    assert root.get("errors") == "1"
    assert int(root.get("tests")) == sum(len(suite) for suite in suites.values())


@pytest.mark.parametrize(
    ("paths", "names"),
    [
        (["x/a", "x/b"], ["a", "b"]),
        (["x/a", "y/a"], ["x-a", "y-a"]),
        (["x/1/a", "x/2/a", "x/b"], ["1-a", "2-a", "b"]),
        (["x/run.1", "x/run.2"], ["run.1", "run.2"]),
        (["x/a", "x/a.mcap", "x/b.mcap"], ["a", "a.mcap", "b"]),
        (["x/a-b", "x/a/b", "y/b"], ["a-b", "a-b-2", "y-b"]),
    ],
)
def test_each_bag_has_a_name_of_its_own(tmp_path, paths, names):
    assert unique_names([tmp_path / path for path in paths]) == names


@pytest.mark.long
def test_bags_of_one_name_keep_apart(recorded, tmp_path, capsys):
    for folder, bag in (("x", "a"), ("y", "b")):
        shutil.copytree(recorded / bag, tmp_path / folder / "run")
    out = tmp_path / "out"
    code, text, _ = replay(capsys, tmp_path / "x" / "run", tmp_path / "y" / "run", "-o", out)
    assert code == 0
    assert list(table(text)) == ["bag", "x-run", "y-run"]
    assert json.loads((out / "x-run.json").read_text())["replay"]["name"] == "x-run"
    assert (out / "y-run" / "y-run_0.mcap").is_file()


def test_a_cluster_gets_whole_paths(tmp_path, monkeypatch):
    (tmp_path / "a.mcap").touch()
    monkeypatch.chdir(tmp_path)
    words = ["a.mcap", "--model", "m.yaml", "-o", "out"]
    for scheduler, folder in (([], Path()), (["--scheduler", "tcp://x:1"], tmp_path)):
        parser = argparse.ArgumentParser()
        replay_command.add_arguments(parser)
        arguments = parser.parse_args([*words, *scheduler])
        (task,) = replay_command.make_tasks(find_bags(arguments.bags), arguments)
        assert task.bag == folder / "a.mcap"
        assert task.model == folder / "m.yaml"
        assert task.output == folder / "out"


@pytest.mark.parametrize(
    "words",
    [
        ["no/such/bag"],
        ["no/such/bag", "--check"],
        ["{bag}", "no/such/bag"],
        ["{bag}", "--model", "no/such/model.yaml"],
        ["{bag}", "--cell", "/other"],
        ["{bag}", "--jobs", "0"],
        ["{bag}", "--scheduler", "nowhere:1", "--jobs", "2"],
        ["{empty}"],
    ],
)
def test_a_wrong_input_is_one_line(recorded, tmp_path, capsys, words):
    capsys.readouterr()
    filled = [word.format(bag=recorded / "a", empty=tmp_path) for word in words]
    assert main(["replay", *filled]) == 2
    out, err = capsys.readouterr()
    (line,) = err.strip().splitlines()
    assert line.startswith("slosh replay: ")
    assert "Traceback" not in out


@pytest.mark.parametrize("words", [[], ["--check"], ["bag", "--chek"], ["bag", "--jobs", "two"],
                                   ["bag", "--check", "--write-manifest"]])  # fmt: skip
def test_mistyped_options_exit_with_two(words, capsys):
    with pytest.raises(SystemExit) as caught:
        main(["replay", *words])
    assert caught.value.code == 2
    assert "Traceback" not in capsys.readouterr().err
