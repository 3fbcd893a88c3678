"""Texts of a validation report: subject, method, and versions of software and data."""

from __future__ import annotations

import hashlib
import math
import platform
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version

from slosh_base.compiled.arithmetic import arithmetic_fingerprint
from slosh_base.compiled.compile_cache import sources_digest
from slosh_estimator import SOURCES
from slosh_fleet.validation.criteria import COVERAGE
from slosh_model.effects.registry import EFFECTS
from slosh_model.errors import SloshModelError
from slosh_model.mode_table import mode_table
from slosh_model.model import Model
from slosh_replay.in_force import in_force, last_starts
from slosh_replay.recorded_run import RecordedRun
from slosh_replay.replay.report import shown_models
from slosh_replay.replay.result import ReplayResult
from slosh_report.run_report import Fact

LIBRARIES = ("numpy", "scipy", "numba", "opencv-python-headless", "mcap", "rosbags", "matplotlib")


def subject(model: Model, results: Sequence[ReplayResult], motion: str) -> tuple[Fact, ...]:
    """Describes the container, its liquid, its first mode and the motion.

    Args:
        model: of all recordings.
        results: their replays.
        motion: its name, as given; empty: none was given.
    """
    container, liquid = model.container, model.liquid
    rim = container.height_below_rim(0.0)
    above = "" if rim is None else f", rim {1e3 * rim:g} mm above the still level"
    facts = {
        "container": f"{container.shape}, {container.described}{above}",
        "liquid": f"density {liquid.density:g} kg/m³, kinematic viscosity "
        f"{1e6 * liquid.kinematic_viscosity:g} mm²/s",
        "first mode": _first_mode(model),
        "motion": motion or "as recorded; no name was given (--motion)",
        "recordings": f"{len(results)}: {', '.join(result.name for result in results)}",
    }
    return tuple(Fact(label, text) for label, text in facts.items())


def _first_mode(model: Model) -> str:
    try:
        first = mode_table(model, 1)[0]
    except SloshModelError as error:
        return f"cannot be computed: {error}"
    frequency = first.natural_frequency / math.tau
    return f"natural frequency {frequency:.3f} Hz, damping ratio {first.damping_ratio:.4f}"


def method(model: Model, runs: Sequence[RecordedRun], results: Sequence[ReplayResult],
           further: float) -> tuple[Fact, ...]:  # fmt: skip
    """Describes models, measurement, comparison and decision rule.

    Args:
        model: of all recordings.
        runs, results: recordings and their replays.
        further: standard uncertainty of the measurement beside the camera's own [m].
    """
    settings = in_force(last_starts(runs[0]))
    linear, nonlinear = shown_models(results[0])
    facts = {
        "models": f"{linear} and {nonlinear}. L is the linear model of DL22, eqs. (12) and (15), "
        "NL the nonlinear one, eqs. (11) and (14); heights by its tables 1 and 2. DL22: Di Leva, "
        "Carricato, Gattringer, Müller, Sloshing dynamics estimation for liquid-filled containers "
        "performing 3-dimensional motions, Multibody Syst. Dyn., 2022.",
        **{
            f"effect {use.name}": f"{EFFECTS[use.name].meaning} ({EFFECTS[use.name].source})"
            for use in model.effects
        },
        "input of the models": f"{results[0].source}; open loop, no measurement enters",
        "measurement": "The liquid's line on the wall is found in each camera image; its highest "
        "point above the still level is the measured height, with a standard deviation from the "
        f"edge's sharpness and the calibration. {settings.get('calibration', '')}".strip(),
        "uncertainty": f"U is expanded with k = {COVERAGE:g}: the stated standard deviation"
        + (f" and {1e3 * further:g} mm beside it (--uncertainty)." if further else " alone."),
        "comparison": "The estimate is interpolated at each image's time stamp. MAE is the mean "
        "absolute error (σ, DL22 eq. (33)), ε the relative error of the highest height (DL22 eq. "
        "(32)). Single spikes are left out; a line that leaves the view counts as a lower bound.",
        "decision": "pass if value + U does not exceed the limit; fail if value − U exceeds it; "
        "undecided otherwise, and where data are missing or a recording is not whole.",
        "repetition": "All estimates were computed anew from the recorded input and compared "
        "with the recorded ones, bit for bit.",
    }
    return tuple(Fact(label, text) for label, text in facts.items())


def versions(runs: Sequence[RecordedRun], model_text: str) -> tuple[Fact, ...]:
    """Returns the versions of software, and digests of settings and message definitions.

    Args:
        runs: the recordings.
        model_text: the model file.
    """
    facts = {
        "slosh": version("slosh_report"),
        "Python": platform.python_version(),
        "libraries": ", ".join(
            f"{name} {found}" for name in LIBRARIES if (found := _version(name))
        ),
        "sources of the estimator": f"{sources_digest(*SOURCES)} (rounding "
        f"{arithmetic_fingerprint()})",
        "model, SHA-256": _sha256(model_text),
        "camera calibration, SHA-256": _joined(map(_calibration, runs)),
        "message definitions, SHA-256": _joined(map(_definitions, runs)),
    }
    for node in ("estimator", "monitor", "camera"):
        starts = [last_starts(run).get(node) for run in runs]
        codes = [f"{start.code} (rounding {start.arithmetic})" for start in starts if start]
        if codes:
            facts[f"recorded {node}, sources"] = _joined(codes)
    return tuple(Fact(label, text) for label, text in facts.items())


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return ""


def _calibration(run: RecordedRun) -> str:
    camera = last_starts(run).get("camera")
    text = camera.files.get("calibration") if camera else None
    return "none was recorded" if text is None else _sha256(text)


def _definitions(run: RecordedRun) -> str:
    """Returns the digest of all message definitions in a recording, sorted by name."""
    found = {
        (schema.name, bytes(schema.data))
        for file in run.reader.files
        for schema in run.reader.survey(file).schemas.values()
    }
    digest = hashlib.sha256()
    for name, data in sorted(found):
        digest.update(name.encode() + b"\0" + data + b"\0")
    return digest.hexdigest()


def _joined(texts: object) -> str:
    return "; ".join(dict.fromkeys(texts))  # type: ignore[call-overload]


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
