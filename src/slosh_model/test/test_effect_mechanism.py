"""Tests that a new effect needs only one module, which is found and compiled."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import slosh_base
import slosh_model

PACKAGE = Path(slosh_model.__file__).parent
BASE = Path(slosh_base.__file__).parent.parent
"""Where the package below is found."""
PAGE = Path(__file__).resolve().parents[3] / "docs" / "effects" / "adding.md"

# Of the package's own effects and their machinery; fewer compile faster.
KEPT = ("__init__", "base", "registry", "robot_dynamics", "vertical_acceleration")
# One module for each way in which an effect may act.
EFFECTS = {
    "a_drag": """
from slosh_model.effects.base import Effect, Parameter, Stage, compiled

@compiled
def _term(mode, elapsed, q, inputs, p):
    return -p[0] * q[2], -p[0] * q[3], 0.0, 0.0, 0.0

EFFECT = Effect(
    name="a_drag", title="drag", stages=(Stage.DYNAMICS,), equation="k v", source="test",
    parameters=(Parameter("k", "1/s", 0.0, 100.0, 0.0, "drag"),), term=_term,
)
""",
    "added_mass": """
from slosh_model.effects.base import Effect, Parameter, Stage, compiled

@compiled
def _term(mode, elapsed, q, inputs, p):
    return 0.0, 0.0, p[0], 0.0, p[1]

EFFECT = Effect(
    name="added_mass", title="added mass", stages=(Stage.DYNAMICS,), equation="m a", source="test",
    parameters=(
        Parameter("mx", "1", 0.0, 100.0, 0.0, "along x"),
        Parameter("my", "1", 0.0, 100.0, 0.0, "along y"),
    ),
    term=_term,
)
""",
    "double": """
from slosh_model.effects.base import Effect, Parameter, Stage, compiled

@compiled
def _modulation(mode, elapsed, p):
    omega, zeta, c, radius, gain, xi, height, omega_ratio, radius_y, gain_y = mode
    if elapsed < p[0]:
        return mode
    return (
        2.0 * omega, zeta, 4.0 * c, radius, 3.0 * gain, xi, height,
        omega_ratio, radius_y, 3.0 * gain_y,
    )

EFFECT = Effect(
    name="double", title="stiffer later", stages=(Stage.DYNAMICS, Stage.HEIGHT), equation="2",
    source="test", parameters=(Parameter("start", "s", 0.0, 9.0, None, "when"),),
    modulation=_modulation,
)
""",
    "fill": """
from dataclasses import replace
from slosh_model.effects.base import Effect, Parameter, Stage

def _modes(modes, p):
    def deeper(cup):
        return replace(cup, fill_height=cup.fill_height + p["delta"])
    return tuple(replace(mode, container=deeper(mode.container)) for mode in modes)

EFFECT = Effect(
    name="fill", title="fill", stages=(Stage.DYNAMICS, Stage.HEIGHT), equation="h", source="test",
    parameters=(Parameter("delta", "m", -1.0, 1.0, 0.0, "more liquid"),), modes=_modes,
)
""",
    "growing": """
from slosh_model.effects.base import SETTLING, Effect, Parameter, Stage, compiled

@compiled
def _drive(dt, inputs, pose, memory, p):
    if dt == SETTLING:
        memory[1] = 7.0
    else:
        memory[0] += dt
    return inputs[0] + p[0] * memory[0], inputs[1] + memory[1], inputs[2], inputs[3]

EFFECT = Effect(
    name="growing", title="growing input", stages=(Stage.INPUT,), equation="a + k t",
    source="test", parameters=(Parameter("k", "m/s³", -9.0, 9.0, 0.0, "growth"),),
    drive=_drive, drive_memory=2,
)
""",
    "late": """
from slosh_model.effects.base import Effect, Parameter, Stage

EFFECT = Effect(
    name="late", title="late", stages=(Stage.MEASUREMENT,), equation="t", source="test",
    parameters=(Parameter("samples", "1", 0.0, 99.0, 0.0, "2 ms each"),),
    delay=lambda p: 0.002 * p["samples"],
)
""",
    "more_modes": """
from slosh_model.effects.base import Effect, Parameter, Stage
from slosh_model.modes import Mode

def _modes(modes, p):
    return (*modes, Mode(len(modes) + 1, modes[0].container, p["zeta"]))

EFFECT = Effect(
    name="more_modes", title="a mode", stages=(Stage.DYNAMICS,), equation="n", source="test",
    parameters=(Parameter("zeta", "1", 0.0, 0.9, None, "its damping", 0.0),), modes=_modes,
)
""",
    "peak_hold": """
from slosh_model.effects.base import Effect, Stage, compiled

@compiled
def _reading(dt, eta, wall, memory, p):
    memory[1] += dt
    memory[0] = max(memory[0], eta + memory[1])
    return memory[0]

EFFECT = Effect(
    name="peak_hold", title="hold", stages=(Stage.MEASUREMENT,), equation="max", source="test",
    reading=_reading, reading_memory=2,
)
""",
    "ramp": """
from slosh_model.effects.base import Effect, Parameter, Stage, compiled

@compiled
def _term(mode, elapsed, q, inputs, p):
    return p[0] * elapsed, 0.0, 0.0, 0.0, 0.0

EFFECT = Effect(
    name="ramp", title="growing push", stages=(Stage.DYNAMICS,), equation="r t", source="test",
    parameters=(Parameter("rate", "m/s³", 0.0, 100.0, 0.0, "growth"),), term=_term,
)
""",
    "tall": """
from slosh_model.effects.base import Effect, Stage

EFFECT = Effect(
    name="tall", title="tall", stages=(Stage.HEIGHT,), equation="2 eta", source="test",
    height_gain=lambda mode, p: 2.0 * mode.plane_gain,
)
""",
}
PROBE = """
import json
import sys
import numpy as np
from scipy.integrate import solve_ivp
from slosh_model import kernel
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.measure import predicted_heights
from slosh_model.model import Model
from slosh_model.model_text import parse_model
from slosh_model.simulate import Inputs, State, simulate

CUP = Cylinder(0.05, 0.07)
PLAIN = Model(CUP, damping_ratio=0.0)
w = CUP.natural_frequency(1)
t = np.linspace(0.0, 1.0, 501)
push = np.stack([np.sin(20 * t), np.cos(9 * t), 0 * t], axis=1)
free = Inputs(t, np.zeros((501, 3)))
aside = State(0.0, np.array([[0.01, 0.01, 0.0, 0.0]]), np.zeros(4))

def run(model, inputs=free, state=None):
    return simulate(model, inputs, state)[0]

def same(model, other):
    one, two = run(model, Inputs(t, push)), run(other, Inputs(t, push))
    return bool(np.array_equal(one.sh_x, two.sh_x) and np.array_equal(one.modal, two.modal))

def close(values, exact, within=1e-8):
    return bool(np.max(np.abs(values - exact)) < within)

def oscillation(damping, frequency):
    f = np.sqrt(frequency**2 - damping**2)
    return 0.01 * np.exp(-damping * t) * (np.cos(f * t) + damping * np.sin(f * t) / f)

drag = run(PLAIN.with_effect("a_drag", k=2.0), state=aside).modal[:, 0]
heavy = run(PLAIN.with_effect("added_mass", mx=3.0, my=1.0), state=aside).modal[:, 0]
both = run(PLAIN.with_effect("a_drag", k=2.0).with_effect("added_mass", mx=3.0, my=3.0),
           state=aside).modal[:, 0]
ramp = PLAIN.with_effect("ramp", rate=2.0)
first, state = simulate(ramp, Inputs(t[:200], np.zeros((200, 3))))
second, _ = simulate(ramp, Inputs(t[200:], np.zeros((301, 3))), state)
pushed = np.concatenate([first.modal, second.modal])[:, 0, 0]

grown = PLAIN.with_effect("growing", k=3.0).with_effect("robot_dynamics", frequency=500.0)
whole = run(grown)
first, state = simulate(grown, Inputs(t[:200], np.zeros((200, 3))))
second, _ = simulate(grown, Inputs(t[200:], np.zeros((301, 3))), state)
joined = np.concatenate([first.modal, second.modal])
unmoved = run(PLAIN.with_effect("growing", k=3.0)).modal[:, 0]
swing = run(PLAIN.with_effect("double", start=0.0), state=aside)
later = run(PLAIN.with_effect("double", start=0.5), state=aside).modal[:, 0, 0]
before = t < 0.499
msh = predicted_heights(PLAIN, Inputs(t, push), t)
late = predicted_heights(PLAIN.with_effect("late", samples=25.0), Inputs(t, push), t)
held = predicted_heights(PLAIN.with_effect("peak_hold"), Inputs(t, push), t)

film = parse_model(sys.argv[1])
(use,) = film.effects
sigma, size, zeta = *use.parameters.values(), film.mode_constants()[0].damping_ratio
stiff = lambda x: w**2 * (1.0 + sigma / (1.0 + x**2 / size**2))
swung = solve_ivp(
    lambda t, s: [s[1], -stiff(s[0]) * s[0] - 2.0 * zeta * w * s[1]], (0.0, 1.0), [0.01, 0.0],
    "DOP853", t_eval=t, rtol=1e-10, atol=1e-13,
).y[0]
along = State(0.0, np.array([[0.01, 0.0, 0.0, 0.0]]), np.zeros(4))
print(json.dumps({
    "the_page": bool(use.name == "clinging_film" and sigma == 0.2
        and np.max(np.abs(run(film, state=along).modal[:, 0, 0] - swung)) < 1e-7),
    "drive": close(unmoved[:, 0], -3.0 / w**2 * (t - np.sin(w * t) / w)),
    "settling": close(unmoved[:, 1], -7.0 / w**2),
    "drive_memory": bool(np.array_equal(joined, whole.modal)),
    "modulation": close(swing.modal[:, 0, 0], 0.01 * np.cos(2.0 * w * t), 1e-6)
        and close(swing.sh_x, 3.0 * PLAIN.height_gains()[0] * swing.modal[:, 0, 0]),
    "modulation_in_time": close(later[before], 0.01 * np.cos(w * t[before]))
        and not close(later, 0.01 * np.cos(w * t)),
    "delay": close(late[25:], msh[:-25], 1e-7) and not bool(late[:25].any()),
    "reading": close(held[:, 0], np.maximum.accumulate(msh[:, 0] + t)),
    "name": PLAIN.with_effect("a_drag", k=2.0).name,
    "drag": close(drag[:, 0], oscillation(1.0, w)),
    "added_mass": close(heavy[:, 0], oscillation(0.0, w / 2.0))
        and close(heavy[:, 1], oscillation(0.0, w / np.sqrt(2.0))),
    "two_terms": close(both[:, 0], oscillation(0.25, w / 2.0)),
    "elapsed": close(pushed, 2.0 / w**2 * (t - np.sin(w * t) / w)),
    "fill": same(PLAIN.with_effect("fill", delta=0.01),
                 Model(Cylinder(0.05, 0.08), damping_ratio=0.0)),
    "more_modes": same(PLAIN.with_effect("more_modes"), Model(CUP, damping_ratio=0.0, modes=2)),
    "height_gain": bool(np.array_equal(run(PLAIN.with_effect("tall"), Inputs(t, push)).sh_x,
                                       2.0 * run(PLAIN, Inputs(t, push)).sh_x)),
    "off": same(PLAIN, PLAIN.with_effect("a_drag", k=2.0).without_effect("a_drag")),
    "hits": sum(kernel.advance_many.load().stats.cache_hits.values()),
}))
"""


@pytest.fixture
def package(tmp_path):
    """Copies the package with additional effects and a cache of its own."""
    shutil.copytree(PACKAGE, tmp_path / "slosh_model")
    for file in (tmp_path / "slosh_model" / "effects").glob("*.py"):
        if file.stem not in KEPT:
            file.unlink()
    for name, text in EFFECTS.items():
        (tmp_path / "slosh_model" / "effects" / f"{name}.py").write_text(text)
    (tmp_path / "slosh_model" / "effects" / "clinging_film.py").write_text(on_the_page("python"))
    return tmp_path


def on_the_page(language: str) -> str:
    """Returns the code example in a language from the page on adding an effect."""
    (example,) = re.findall(rf"```{language}\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.S)
    return example


def run(root: Path, program: str, *words: str, **environment: str) -> str:
    surroundings = {
        "PATH": os.defpath,
        "PYTHONPATH": os.pathsep.join([str(root), str(BASE)]),
        "XDG_CACHE_HOME": str(root / "cache"),
        "HOME": str(root),
        **environment,
    }
    command = [sys.executable, "-c", program, *words]
    return subprocess.run(
        command, env=surroundings, capture_output=True, text=True, timeout=100, check=True
    ).stdout


@pytest.mark.long
def test_each_kind_of_effect_is_one_module_and_an_edit_is_never_missed(package):
    found = json.loads(run(package, PROBE, on_the_page("yaml")))
    assert found.pop("name") == "2D-L+a_drag"
    assert found.pop("hits") == 0
    assert found == dict.fromkeys(found, True)

    assert json.loads(run(package, PROBE, on_the_page("yaml")))["hits"] == 1  # compiled before

    module = package / "slosh_model" / "effects" / "a_drag.py"
    module.write_text(EFFECTS["a_drag"].replace("-p[0] * q[2]", "-3.0 * p[0] * q[2]"))
    edited = json.loads(run(package, PROBE, on_the_page("yaml")))
    assert edited["hits"] == 0
    assert not edited["drag"]
    assert edited["added_mass"]


SHORT = """
import numpy as np
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.model import Model
from slosh_model.simulate import Inputs, simulate
t = np.linspace(0.0, 0.4, 101)
push = np.stack([3 * np.sin(20 * t), np.cos(9 * t), np.sin(t)], axis=1)
response, _ = simulate(Model(Cylinder(0.05, 0.07)).spatial().nonlinear(), Inputs(t, push))
print(repr(float(response.msh.max())))
"""


def test_works_where_compiling_is_switched_off():
    root = PACKAGE.parent
    plain = run(root, SHORT, NUMBA_DISABLE_JIT="1", XDG_CACHE_HOME="/nonexistent/cache")
    cache = os.environ.get("XDG_CACHE_HOME", os.path.expanduser("~/.cache"))
    compiled = run(root, SHORT, XDG_CACHE_HOME=cache)
    assert float(plain) == pytest.approx(float(compiled), rel=1e-12)
    assert float(plain) > 0.001
