"""Programs that compile functions in different orders, and one that compares the results.

    python validation/long_runs/compiled_work.py WORK [FOLDER]

Each WORK is what a process of the product does with compiled code, short. `compare` prints, for
each effect, whether the live estimator, the replay's columns and the simulation give the same
bits, and a digest of them; whatever lies in the compile cache, all digests must be equal.
"""

import hashlib
import json
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))
Array = NDArray[np.float64]
SAMPLES, TICK_NS = 200, 3_906_250  # 1/256 s: exact in both clocks


def step(folder: Path) -> None:
    """Simulates one sample, which compiles the simulator."""
    from slosh_model.model import Model
    from slosh_model.shapes.cylinder import Cylinder
    from slosh_model.simulate import Simulator

    Simulator(Model(Cylinder(0.05, 0.07))).step(0.001, 1.0, 0.0, 0.0)


def live(folder: Path) -> None:
    """Runs what the estimator node computes before its first message."""
    from slosh_estimator.estimator import Estimator
    from slosh_model.model import Model
    from slosh_model.shapes.cylinder import Cylinder
    from slosh_motion.inputs.sampling import Sample

    estimator = Estimator(Model(Cylinder(0.05, 0.07)))
    estimator.update(Sample(0, 0.0, 0.0, 0.0, 0.0, True))
    estimator.update(Sample(1_000_000, 1.0, 0.0, 0.0))


def simulate(folder: Path) -> None:
    """Runs `slosh simulate` on a short motion."""
    motion = folder / "motion.csv"
    rows = [f"{k / 100},{np.sin(k / 9)},{np.cos(k / 7) - 1},0" for k in range(100)]
    motion.write_text("t,ax,ay,az\n" + "\n".join(rows) + "\n")
    _slosh("simulate", str(_model()), str(motion), "-o", str(folder / "response.csv"))


def replay(folder: Path) -> None:
    """Runs `slosh replay` on a bag."""
    _slosh("replay", str(ROOT / "bags" / "cut"))


def detect(folder: Path) -> None:
    """Runs `slosh detect` on images of the simulated cell."""
    import cv2

    from slosh_bringup.cell.renderer import CupRenderer
    from slosh_camera.calibrate.camera_file import read_calibration

    camera, images = _model().parent / "camera.yaml", folder / "images"
    images.mkdir()
    renderer = CupRenderer(read_calibration(camera).view)
    for number, height in enumerate((0.0, 0.002, 0.004)):
        cv2.imwrite(str(images / f"{number}.png"), renderer.render(height, 0.0))
    _slosh("detect", str(images), "--camera", str(camera), "-o", str(folder / "heights.csv"))


def discover(folder: Path) -> None:
    """Runs `slosh discover` on a bag, including the proposal of a generic equation term."""
    found = folder / "found"
    _slosh("discover", str(ROOT / "bags" / "cut"), "--model", str(_model()), "-o", str(found))


def compare(folder: Path) -> None:
    """Prints hashes of live, batch and simulated heights for every modelled effect."""
    from example_effects import STRENGTHS

    from slosh_model.effects.registry import EFFECTS

    print(json.dumps({name: _digests(name, STRENGTHS) for name in EFFECTS}))


WORKS: Mapping[str, Callable[[Path], None]] = {
    one.__name__: one for one in (step, live, simulate, replay, detect, discover)
}


def _slosh(*words: str) -> None:
    from slosh_bringup.cli.main import main

    if main(list(words)) != 0:
        raise SystemExit(f"slosh {' '.join(words)} failed")


def _model() -> Path:
    from slosh_bringup.processes import config_folder

    return config_folder() / "model.yaml"


def _digests(name: str, strengths: Mapping[str, Mapping[str, float]]) -> dict[str, object]:
    from example_effects import in_fitting_container

    from slosh_estimator.estimator import Estimator
    from slosh_model.measure import measured_heights
    from slosh_model.model import Model
    from slosh_model.shapes.cylinder import Cylinder
    from slosh_model.simulate import Inputs, simulate
    from slosh_motion.inputs.sampling import Sample, Samples

    cup = Model(Cylinder(0.05, 0.07), damping_ratio=0.02)
    model = in_fitting_container(cup, name).with_effect(name, **strengths[name])
    t = np.arange(SAMPLES) / 256
    push = np.column_stack([4 * np.sin(18 * t), 3 * np.cos(15 * t) - 3, np.sin(20 * t)])
    attitude = np.column_stack(
        [0.1 * np.sin(9 * t), 0.1 * np.cos(8 * t), np.sin(2 * t), np.ones(SAMPLES)]
    )
    inputs = Inputs(t, push, attitude)
    samples = [
        Sample(k * TICK_NS, *push[k], inputs.yaws[k], k == 0, tuple(inputs.poses[k]))
        for k in range(SAMPLES)
    ]
    one_by_one = Estimator(model)
    online = [one_by_one.update(sample) for sample in samples]
    columns = Estimator(model).update_many(Samples.of(samples))
    simulated = [simulate(twin, inputs)[0] for twin in (model.linear(), model.nonlinear())]
    readings = [
        measured_heights(twin, response)[:, 0]
        for twin, response in zip((model.linear(), model.nonlinear()), simulated, strict=True)
    ]
    heights = {
        "live": np.array([[e.linear[2:4], e.nonlinear[2:4]] for e in online]),
        "columns": columns.heights[:, :, 2:4],
        "simulated": np.stack(
            [np.column_stack([one.sh_x, one.sh_y]) for one in simulated], axis=1
        ),
    }
    try:
        from slosh_model.batch import wall_heights
    except ImportError:  # not in every version that this program is run with
        pass
    else:
        twins = [model.linear(), model.nonlinear()] * 4
        heights["batch"] = np.stack(wall_heights(twins, inputs)[:2], axis=1)
    read = {
        "live readings": np.array([[e.linear.reading, e.nonlinear.reading] for e in online]),
        "simulated readings": np.stack(readings, axis=1),
    }
    return {
        "differ": [*_unlike(heights, "live"), *_unlike(read, "live readings")],
        "bits": hashlib.sha256(b"".join(one.tobytes() for one in heights.values())).hexdigest(),
    }


def _unlike(answers: Mapping[str, Array], reference: str) -> list[str]:
    found = []
    for name, values in answers.items():
        # The MSH is a square root in the estimator and a hypotenuse in the simulation.
        within = 1e-15 if "readings" in name else 0.0
        worst = float(np.max(np.abs(values - answers[reference])))
        if not worst <= within:
            found.append(f"{name}: {worst:.3g} m")
    return found


if __name__ == "__main__":
    work, *rest = sys.argv[1:]
    place = Path(rest[0]) if rest else Path()
    (compare if work == "compare" else WORKS[work])(place)
