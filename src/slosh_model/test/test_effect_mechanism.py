"""An effect is one module: a new one in the folder is found, compiled in and cached anew."""

import shutil
import subprocess
import sys
from pathlib import Path

import slosh_model

PACKAGE = Path(slosh_model.__file__).parent
DRAG = """
from numba import njit
from slosh_model.effects.base import Effect, Parameter, Stage

@njit
def _term(mode, x, y, vx, vy, ax, ay, az, elapsed, p):
    return -p[0] * vx, -p[0] * vy, 0.0, 0.0, 0.0

def _modes(modes, parameters):
    return modes

EFFECT = Effect(
    name="a_drag", title="drag", stages=(Stage.DYNAMICS,), equation="k v", source="test",
    parameters=(Parameter("k", "1/s", 0.0, 100.0, 0.0, "drag"),), term=_term, modes=_modes,
)
"""
PROBE = """
import numpy as np
from slosh_model.containers import Cylinder
from slosh_model.model import Model
from slosh_model.simulate import Inputs, State, simulate
model = Model(Cylinder(0.05, 0.07), damping_ratio=0.0).with_effect("a_drag", k=2.0)
t = np.linspace(0.0, 1.0, 501)
state = State(0.0, np.array([[0.01, 0.0, 0.0, 0.0]]), np.zeros(4))
x = simulate(model, Inputs(t, np.zeros((501, 3))), state)[0].modal[:, 0, 0]
w = np.sqrt(model.container.natural_frequency(1) ** 2 - 1.0)
exact = 0.01 * np.exp(-t) * (np.cos(w * t) + np.sin(w * t) / w)
print(model.name, np.max(np.abs(x - exact)) < 1e-9)
"""


def run_probe(root: Path) -> str:
    environment = {
        "PATH": "/usr/bin:/bin", "PYTHONPATH": str(root), "XDG_CACHE_HOME": str(root / "cache"),
        "HOME": str(root),
    }  # fmt: skip
    command = [sys.executable, "-c", PROBE]
    done = subprocess.run(
        command, env=environment, capture_output=True, text=True, timeout=100, check=False
    )
    return done.stdout + done.stderr


def test_a_new_module_is_an_effect_and_an_edit_is_never_missed(tmp_path):
    shutil.copytree(PACKAGE, tmp_path / "slosh_model")
    module = tmp_path / "slosh_model" / "effects" / "a_drag.py"
    module.write_text(DRAG)
    assert "2D-L+a_drag True" in run_probe(tmp_path)
    module.write_text(DRAG.replace("-p[0] * vx", "+p[0] * vx"))
    assert "2D-L+a_drag False" in run_probe(tmp_path)
