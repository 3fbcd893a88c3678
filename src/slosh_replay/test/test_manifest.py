"""Tests that manifests are read strictly and written without loss."""

import re
from pathlib import Path, PurePosixPath

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slosh_bag.errors import SloshBagError
from slosh_replay.manifest import (
    SOURCES,
    Expectation,
    ExpectedEvent,
    ExpectedNumber,
    read_manifest,
    write_manifest,
)

WHOLE = """
bags:
  c3:
    shows: DL22's 3D motion c, in the simulated cell
    model: models/other.yaml
    estimates: exact
    images: 552
    drops: 0
    sigma: {3D-NL: {value: 0.000134, tolerance: 1.0e-6}}
    epsilon: {3D-NL: {value: -0.0139, tolerance: 0.001}}
    events:
      - {source: measured, peak: {value: 0.0245, tolerance: 1.0e-6}}
    warnings: [unfinished]
  empty: {}
"""


def read(tmp_path: Path, text: str) -> dict[str, Expectation]:
    (tmp_path / "manifest.yaml").write_text(text, encoding="utf-8")
    return read_manifest(tmp_path / "manifest.yaml")


def test_every_key_is_read(tmp_path):
    bags = read(tmp_path, WHOLE)
    assert bags["empty"] == Expectation()
    assert bags["c3"] == Expectation(
        shows="DL22's 3D motion c, in the simulated cell",
        model=tmp_path / "models/other.yaml",
        tolerance=0.0,
        images=552,
        drops=0,
        sigma={"3D-NL": ExpectedNumber(0.000134, 1e-6)},
        epsilon={"3D-NL": ExpectedNumber(-0.0139, 0.001)},
        events=(ExpectedEvent("measured", ExpectedNumber(0.0245, 1e-6)),),
        warnings=("unfinished",),
    )


MISTAKES = [
    ("[]", "", "must hold one key, bags"),
    ("bags: {}\nbag: {}", "", "must hold one key, bags"),
    ("bags: [c3]", "", "must hold one key, bags"),
    ("bags: {c3: [", "", "not YAML"),
    ("bags: {c3: {}, c3: {}}", "", "bags.c3: given twice"),
    ("bags: {c3: {images: 1, images: 2}}", "", "bags.c3.images: given twice"),
    ("bags: {/c3: {}}", "", "a bag is named by its path below the manifest's folder"),
    ("bags: {a/../../c3: {}}", "", "a bag is named by its path below the manifest's folder"),
    ("bags: {c3: 5}", "bags.c3", "must be a mapping"),
    ("bags: {c3: {sigmas: {}}}", "bags.c3", "unknown key 'sigmas'"),
    ("bags: {c3: {shows: 5}}", "bags.c3.shows", "is not a text"),
    ("bags: {c3: {model: 5}}", "bags.c3.model", "is not a file name"),
    ("bags: {c3: {model: ''}}", "bags.c3.model", "is not a file name"),
    ("bags: {c3: {estimates: yes}}", "bags.c3.estimates", "True is not a number"),
    ("bags: {c3: {estimates: exactly}}", "bags.c3.estimates", "'exactly' is not a number"),
    ("bags: {c3: {estimates: 1:30}}", "bags.c3.estimates", "'1:30' is not a number"),
    ("bags: {c3: {estimates: -0.1}}", "bags.c3.estimates", "at least 0"),
    ("bags: {c3: {estimates: .nan}}", "bags.c3.estimates", "must be finite"),
    ("bags: {c3: {images: 1.5}}", "bags.c3.images", "not a number of messages"),
    ("bags: {c3: {images: true}}", "bags.c3.images", "not a number of messages"),
    ("bags: {c3: {drops: -1}}", "bags.c3.drops", "not a number of messages"),
    ("bags: {c3: {sigma: 0.1}}", "bags.c3.sigma", "must be a mapping from the model's name"),
    ("bags: {c3: {sigma: {3D-L: 0.1}}}", "bags.c3.sigma.3D-L", "must be a mapping"),
    ("bags: {c3: {sigma: {3D-L: {value: 1}}}}", "bags.c3.sigma.3D-L", "tolerance is missing"),
    ("bags: {c3: {sigma: {3D-L: {tolerance: 1}}}}", "bags.c3.sigma.3D-L", "value is missing"),
    (
        "bags: {c3: {epsilon: {3D-L: {value: .inf, tolerance: 1}}}}",
        "bags.c3.epsilon.3D-L.value",
        "must be finite",
    ),
    (
        "bags: {c3: {epsilon: {3D-L: {value: 1, tolerance: -1}}}}",
        "bags.c3.epsilon.3D-L.tolerance",
        "at least 0",
    ),
    (
        "bags: {c3: {epsilon: {3D-L: {value: 1, tolerance: 1, unit: mm}}}}",
        "bags.c3.epsilon.3D-L",
        "unknown key 'unit'",
    ),
    ("bags: {c3: {events: 2}}", "bags.c3.events", "must be a list"),
    ("bags: {c3: {events: [{}]}}", "bags.c3.events[0].source", "must be one of measured"),
    ("bags: {c3: {events: [{source: camera}]}}", "bags.c3.events[0].source", "must be one of"),
    (
        "bags: {c3: {events: [{source: measured, height: 1}]}}",
        "bags.c3.events[0]",
        "unknown key 'height'",
    ),
    (
        "bags: {c3: {events: [{source: measured, peak: high}]}}",
        "bags.c3.events[0].peak",
        "must be a mapping",
    ),
    ("bags: {c3: {warnings: unfinished}}", "bags.c3.warnings", "must be a list of texts"),
    ("bags: {c3: {warnings: [1]}}", "bags.c3.warnings", "must be a list of texts"),
]


@pytest.mark.parametrize(("text", "key", "what"), MISTAKES)
def test_a_mistake_is_one_line_with_file_and_key(tmp_path, text, key, what):
    with pytest.raises(SloshBagError) as caught:
        read(tmp_path, text)
    complaint = str(caught.value)
    start = re.escape(str(tmp_path / "manifest.yaml")) + (r":1: " if key else r"(:1)?: ")
    assert re.match(start + re.escape(key), complaint)
    assert what in complaint
    assert "\n" not in complaint


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("images: 552", "images: many", "7: bags.c3.images: 'many' is not a number of messages"),
        ("1.0e-6}}\n    eps", "none}}\n    eps", "9: bags.c3.sigma.3D-NL.tolerance: 'none'"),
        ("- {source: measured", "- {source: seen", "12: bags.c3.events[0].source: must be"),
        ("drops: 0", "drop: 0", "8: bags.c3: unknown key 'drop'"),
        ("empty: {}", "c3: {}", "14: bags.c3: given twice"),
    ],
)
def test_a_mistake_is_told_with_its_line(tmp_path, old, new, said):
    assert old in WHOLE
    with pytest.raises(SloshBagError) as caught:
        read(tmp_path, WHOLE.replace(old, new))
    assert str(caught.value).startswith(f"{tmp_path / 'manifest.yaml'}:{said}")


# Lines as people and programs write them.
texts = st.text(st.characters(exclude_categories=("C", "Zl", "Zp")), max_size=20)
numbers = st.floats(allow_nan=False, allow_infinity=False)
expected = st.builds(ExpectedNumber, numbers, st.just(0.0))


def _relative(name: str) -> bool:
    """Whether a text can name a bag: it is not empty, absolute or above the manifest."""
    path = PurePosixPath(name)
    return bool(name) and not path.is_absolute() and ".." not in path.parts


names = st.sampled_from(["2D-L", "3D-L", "2D-NL", "3D-NL", "3D-NL+second_mode", "1", "null"])
by_model = st.dictionaries(names, expected, max_size=3)
events = st.builds(
    ExpectedEvent, st.sampled_from(SOURCES), st.none() | expected, st.none() | expected
)
expectations = st.builds(
    Expectation,
    shows=texts,
    model=st.none(),
    tolerance=st.none() | st.floats(0.0, 1e9),
    images=st.none() | st.integers(0, 10**12),
    drops=st.none() | st.integers(0, 10**12),
    sigma=by_model,
    epsilon=by_model,
    events=st.none() | st.lists(events, max_size=3).map(tuple),
    warnings=st.lists(texts, max_size=3).map(tuple),
)


@pytest.fixture(scope="module")
def empty(tmp_path_factory):
    """Returns a path for a manifest in a folder that all examples share."""
    return tmp_path_factory.mktemp("manifest") / "manifest.yaml"


def written(path: Path, bags: dict[str, Expectation]) -> dict[str, Expectation]:
    path.unlink(missing_ok=True)
    write_manifest(path, bags)
    return read_manifest(path)


@settings(max_examples=60, deadline=None)
@given(st.dictionaries(names | texts.filter(_relative), expectations, min_size=1, max_size=2))
def test_what_is_written_is_read_again(empty, bags):
    assert written(empty, bags) == bags


def test_texts_and_tolerances_are_kept(tmp_path):
    path = tmp_path / "manifest.yaml"
    read(tmp_path, WHOLE)
    new = Expectation(
        tolerance=0.0,
        images=551,
        sigma={"3D-NL": ExpectedNumber(0.0002, 1e-9), "3D-L": ExpectedNumber(0.001, 1e-9)},
        epsilon={"3D-NL": ExpectedNumber(0.5, 1e-9)},
        events=(),
        warnings=("c3_0.mcap: unfinished (cut off)", "something new"),
    )
    write_manifest(path, {"c3": new, "more": Expectation(shows="another")})
    bags = read_manifest(path)
    assert list(bags) == ["c3", "empty", "more"]
    assert bags["more"].shows == "another"
    kept = bags["c3"]
    assert kept.shows == "DL22's 3D motion c, in the simulated cell"
    assert kept.warnings == ("unfinished", "something new")
    assert kept.sigma["3D-NL"] == ExpectedNumber(0.0002, 1e-6)
    assert kept.sigma["3D-L"] == ExpectedNumber(0.001, 1e-9)
    assert kept.epsilon["3D-NL"] == ExpectedNumber(0.5, 0.001)
    assert (kept.images, kept.events, kept.tolerance) == (551, (), 0.0)


@pytest.mark.parametrize("model", ["models/m.yaml", "../m.yaml"])
def test_a_model_is_stated_beside_the_manifest(tmp_path, model):
    folder = tmp_path / "bags"
    folder.mkdir()
    write_manifest(folder / "manifest.yaml", {"c3": Expectation(model=folder / model)})
    assert re.search(rf"model: {re.escape(model)}\n", (folder / "manifest.yaml").read_text())
    found = read_manifest(folder / "manifest.yaml")["c3"].model
    assert found.resolve() == (folder / model).resolve()


def test_a_model_from_elsewhere_is_copied_beside_the_manifest(tmp_path):
    """So a copy of the folder has all that its manifest names."""
    folder, path = tmp_path / "bags", tmp_path / "bags" / "manifest.yaml"
    models = [tmp_path / name / "m.yaml" for name in ("one", "two", "same")]
    for number, model in enumerate(models):
        model.parent.mkdir()
        model.write_text(f"container: {number % 2}\n")
    folder.mkdir()
    write_manifest(path, {str(k): Expectation(model=model) for k, model in enumerate(models)})
    found = [bag.model for bag in read_manifest(path).values()]
    assert [model.relative_to(folder).as_posix() for model in found] == [
        "models/m.yaml", "models/m_2.yaml", "models/m.yaml"
    ]  # fmt: skip
    assert [model.read_text() for model in found] == [model.read_text() for model in models]


def test_nothing_is_written_over_what_is_no_manifest(tmp_path):
    path = tmp_path / "manifest.yaml"
    path.write_text("pictures: []\n")
    with pytest.raises(SloshBagError, match="must hold one key, bags"):
        write_manifest(path, {"c3": Expectation()})
    assert path.read_text() == "pictures: []\n"
