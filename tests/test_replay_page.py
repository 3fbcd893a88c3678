"""Tests a replay's page in a real browser: it shows the numbers of its JSON file."""

import json
import re

import pytest
from headless_browser import View

from slosh_bringup.cli.main import main
from slosh_testing.live_bag import TEXT, LiveBag
from slosh_testing.reports import at

LOOK = """
const all = (selector) => [...document.querySelectorAll(selector)];
return {
  heading: document.querySelector("h1").textContent,
  text: document.body.innerText,
  charts: all(".chart svg").map((svg) => svg.getBoundingClientRect().width).filter((w) => w > 0),
  wide: document.documentElement.scrollWidth - document.documentElement.clientWidth,
  numbers: all("data").map((e) => [e.dataset.path, e.value, e.textContent]),
};
"""


@pytest.fixture(scope="module")
def seen(headless, tmp_path_factory):
    """Returns page contents and JSON figures of three replays, from one browser run.

    One passes its check, one fails it with another model, one is of a bag without images.
    """
    folder = tmp_path_factory.mktemp("pages")
    live = LiveBag()
    live.height, live.camera_gap, live.unrecorded = 1.1, (2.2, 2.6), {700, 701}
    live.write(folder / "bags" / "cup", seconds=2.0)
    live.topics = {"accel", "estimate", "settings"}
    live.write(folder / "blind")
    (folder / "model.yaml").write_text(TEXT.replace("0.58", "0.6"))
    bags, model = str(folder / "bags"), str(folder / "model.yaml")
    runs = {
        "cup": (["--check"], 0, folder / "good"),
        "changed": (["--check", "--model", model], 1, folder / "bad"),
    }
    assert main(["replay", bags, "--write-manifest"]) == 0
    for words, code, output in runs.values():
        assert main(["replay", bags, *words, "-o", str(output)]) == code
    assert main(["replay", str(folder / "blind"), "-o", str(folder / "good")]) == 0
    files = {
        "cup": folder / "good" / "cup",
        "changed": folder / "bad" / "cup",
        "blind": folder / "good" / "blind",
    }
    views = [
        View(path.with_suffix(".html").read_text(encoding="utf-8"), width)
        for path in files.values()
        for width in (1280, 390)
    ]
    look = headless.look(views, LOOK)
    pages = dict(zip(files, zip(look.values[::2], look.values[1::2], strict=True), strict=True))
    figures = {
        name: json.loads(path.with_suffix(".json").read_text()) for name, path in files.items()
    }
    return pages, figures, look.console


@pytest.mark.parametrize("name", ["cup", "changed", "blind"])
def test_every_number_is_that_of_the_file_beside_the_page(seen, name):
    pages, figures, _ = seen
    for page in pages[name]:
        assert len(page["numbers"]) > {"blind": 5}.get(name, 40)
        for path, value, _ in page["numbers"]:
            assert json.loads(value) == at(figures[name], path), path


def test_the_table_shows_what_was_found_in_the_units_that_it_names(seen):
    pages, figures, _ = seen
    shown = {path: text for path, _, text in pages["cup"][0]["numbers"]}
    models = {row["name"]: row for row in figures["cup"]["replay"]["accuracy"]}
    for number, name in enumerate(("2D-L", "3D-L", "2D-NL", "3D-NL")):
        row = figures["cup"]["models"][number]
        assert (row["name"], row["sigma"]) == (name, models[name]["sigma"])
        sigma = float(re.search(r"[\d.]+", shown[f"/models/{number}/sigma"])[0])
        assert sigma == pytest.approx(1e3 * models[name]["sigma"], abs=0.006)
    measured = [height for height in figures["cup"]["replay"]["series"]["measured"] if height]
    assert max(measured) in [row.get("value") for row in figures["cup"]["key_figures"]]
