"""Tests the packages from Python without tools/run: notebooks, tables and charts."""

import ast
import json
import os
import subprocess
import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest

from slosh_discovery.discover import MeasuredMotion, discover
from slosh_model import Cylinder, Inputs, Model, predicted_heights, simulate
from slosh_motion import MotionTable, read_motion_table, write_motion_table
from slosh_replay import replay_bag

mpl.use("Agg")
ROOT = Path(__file__).resolve().parent.parent
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
NOTEBOOK = ROOT / "examples" / "first_steps.ipynb"
MODEL = Model(Cylinder(radius=0.05, fill_height=0.07)).spatial()
T = np.arange(0.0, 3.0, 0.004)
MOTION = Inputs(T, np.outer(3.0 * np.sin(9.0 * T) * (T < 1.5), [1.0, 0.3, 0.0]))


def python(folder, *words):
    """Runs the environment's Python as a notebook would, without a shell's variables."""
    environment = {"PATH": os.defpath, "HOME": os.environ.get("HOME", "/"), "MPLBACKEND": "Agg"}
    for name in ("XDG_CACHE_HOME", "NUMBA_CACHE_DIR"):  # where the compiled code is
        if name in os.environ:
            environment[name] = os.environ[name]
    done = subprocess.run(
        [sys.executable, *map(str, words)], cwd=folder, env=environment, text=True,
        capture_output=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def code_of(notebook):
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    return ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]


def imports_of(text):
    nodes = [
        node for node in ast.parse(text).body if isinstance(node, ast.Import | ast.ImportFrom)
    ]
    return "\n".join(map(ast.unparse, nodes))


def test_the_environments_interpreter_finds_the_packages_by_itself(tmp_path):
    texts = [path.read_text(encoding="utf-8") for path in EXAMPLES]
    texts.append("\n".join(code_of(NOTEBOOK)).replace(";", ""))
    script = "\n".join(map(imports_of, texts)) + (
        "\nimport rclpy, slosh_bag, slosh_bringup, slosh_camera, slosh_discovery, slosh_report"
        "\nfrom slosh_msgs.msg import SloshEstimate\nprint(SloshEstimate().header.frame_id, 'in')"
    )
    assert "import slosh\n" in script
    assert python(tmp_path, "-c", script) == " in\n"


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_is_short(path):
    assert len(path.read_text(encoding="utf-8").splitlines()) <= 20


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("name", "picture", "words"),
    [
        ("simulate_and_plot", "heights.png", ["3D-L Response", "3D-NL Response"]),
        ("replay_and_compare", "replay.png", ["4609 of 4609 bit for bit", "3D-NL: MAE 0.1"]),
        pytest.param(
            "discover_from_python", "discovery.png", ["named surface_nonlinearity"],
            marks=pytest.mark.long,
        ),
    ],
)  # fmt: skip
def test_an_example_runs_in_any_folder(tmp_path, name, picture, words):
    told = python(tmp_path, ROOT / "examples" / f"{name}.py")
    for word in words:
        assert word in told
    assert (tmp_path / picture).read_bytes().startswith(b"\x89PNG")


def test_each_example_is_run():
    assert {path.stem for path in EXAMPLES} == {
        "discover_from_python", "replay_and_compare", "simulate_and_plot",
    }  # fmt: skip


@pytest.mark.long
def test_the_notebook_runs_in_the_projects_folder_and_in_its_own(tmp_path):
    for name in ("bags", "src", "addons"):
        (tmp_path / name).symlink_to(ROOT / name)
    cells = [text.rstrip(";") for text in code_of(NOTEBOOK)]
    cells.append("print(repr(response), repr(replayed), repr(finding), sep='\\n')")
    (tmp_path / "examples").mkdir()
    for place in (tmp_path, tmp_path / "examples"):
        told = python(place, "-c", "\n".join(cells))
        kept = NOTEBOOK.read_text(encoding="utf-8")
        for line in told.splitlines():
            assert json.dumps(line, ensure_ascii=False)[1:-1] in kept


@pytest.fixture(scope="module")
def results():
    heights = predicted_heights(MODEL, MOTION, T[::10])[:, 0]
    measured = MeasuredMotion("m", MOTION, T[::10], msh=1.2 * heights)
    table = MotionTable(T, MOTION.acceleration, msh=np.full(len(T), np.nan))
    return {
        "inputs": MOTION,
        "response": simulate(MODEL, MOTION)[0],
        "table": table,
        "measured": measured,
        "replay": replay_bag(str(ROOT / "bags" / "c3")),
        "finding": discover([measured], MODEL),
    }


def test_a_motion_table_goes_through_pandas_and_back(tmp_path):
    eta = np.sin(T)[:, np.newaxis] * [0.001, 0.002]
    table = MotionTable(
        T, MOTION.acceleration, attitude=np.tile([0.0, 0.0, 0.0, 1.0], (len(T), 1)),
        msh=np.where(T > 1.0, np.nan, 0.01), eta_azimuth=np.radians([0.0, 90.0]), eta=eta,
    )  # fmt: skip
    table.to_pandas().to_csv(tmp_path / "pandas.csv")
    write_motion_table(str(tmp_path / "ours.csv"), table)
    ours, theirs = (
        read_motion_table(str(tmp_path / f"{name}.csv")) for name in ("ours", "pandas")
    )
    for name in ("t", "acceleration", "attitude", "msh", "eta"):
        assert np.array_equal(getattr(ours, name), getattr(theirs, name), equal_nan=True)
    motion = ours.inputs()
    assert np.array_equal(simulate(MODEL, motion)[0].msh, simulate(MODEL, MOTION)[0].msh)


@pytest.mark.parametrize(
    ("name", "labels"),
    [
        ("response", ["here"]),
        ("replay", ["measured", "2D-L", "3D-L", "2D-NL", "3D-NL"]),
        ("finding", ["measured", "before", "after"]),
    ],
)
def test_heights_are_drawn_in_millimetres_over_seconds(results, name, labels):
    value = results[name]
    axes = value.plot(label="here") if name == "response" else value.plot()
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("time [s]", "height [mm]")
    lines = axes.get_lines()
    assert [line.get_label() for line in lines] == labels
    drawn = {
        "response": lambda: value.msh,
        "replay": lambda: value.heights["3D-NL"],
        "finding": lambda: value.motions[0].after_heights[:, 0],
    }[name]()
    assert np.allclose(lines[-1].get_ydata(), 1e3 * drawn, equal_nan=True)
    if name == "response":
        assert value.plot(axes) is axes
        assert len(axes.get_lines()) == 2


@pytest.mark.parametrize(("library", "ask"), [("pandas", "to_pandas"), ("matplotlib", "plot")])
def test_without_the_library_one_line_says_which(results, monkeypatch, library, ask):
    class Absent:
        def find_spec(self, name, *_):
            if name == library:
                raise ModuleNotFoundError(f"No module named {name!r}", name=name)

    for name in [name for name in sys.modules if name.partition(".")[0] == library]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setattr(sys, "meta_path", [Absent(), *sys.meta_path])
    for name in ("response", "replay", "finding"):
        with pytest.raises(ImportError, match=f"needs {library}: pip install {library}$"):
            getattr(results[name], ask)()
