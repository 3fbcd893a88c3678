"""Creates synthetic test cases with hidden effects, by which discoveries are scored.

case = make_case("single", index=3, seed=1)
finding = discover(case.motions, case.base, case.holdout)
row = score_case(case, finding)                      # validation.blind.score
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from slosh_discovery.discover.motion import MeasuredMotion
from slosh_model.model import Model
from slosh_model.simulate import Inputs
from validation.blind.dirt import Dirt
from validation.blind.hidden import LISTED, OUTSIDE, Hidden, sign
from validation.blind.motions import Need, robot_motion
from validation.blind.record import Record, record
from validation.blind.truth import simulate
from validation.blind.truth_model import Truth

Array = NDArray[np.float64]
Random = np.random.Generator

KINDS = ("single", "pairs", "none", "outside", "wrong_parameter")
VISIBLE = 3.0
"""An effect counts where it changes the height by more than this many times the noise."""
NOISE = (1.0e-4, 1.0e-3)
ATTEMPTS = 25
LARGEST_SHARE = 0.75  # of R: higher waves break
PAUSE = 30.0  # between a session's motions [s]
WEAK_EVERY = 8  # one case in so many is kept however weak its effect is
SAME = (frozenset({"accel_gain", "height_scale"}),)
"""Effects that no motion separates while the base is linear, planar and upright."""
WRONG = ("damping_ratio", "alpha", "fill_height")
NAMED_AS = {
    "damping_ratio": "damping_mismatch",
    "alpha": "surface_nonlinearity",
    "fill_height": "fill_level",
}


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """A test case of the discovery: measured motions, base model, and the hidden effects.

    Attributes:
        name: kind, seed and index; the same name is always the same case.
        kind: one of KINDS.
        base: the model that the workflow is given.
        motions, holdout: what it may fit to, and what it may only be judged on.
        hidden: names of what the base lacks.
        parameters: theirs, by name.
        strength: by name: rms by which it changes the heights of `motions`, in noises: that of
            the heights and what the inputs' does to them.
        noise: standard deviation of the noise [m].
        sensor: "msh", "12 azimuths" or "36 azimuths".
        equivalent: sets of names that these data cannot tell apart.
        bias: of the accelerometer [m/s²]: as a constant tilt, so that this is right to say, too.
        wrong: for "wrong_parameter": the parameter, its given and its true value.
        truth: what acts, all of it.
    """

    name: str
    kind: str
    base: Model
    motions: tuple[MeasuredMotion, ...]
    holdout: tuple[MeasuredMotion, ...]
    hidden: tuple[str, ...]
    parameters: Mapping[str, Mapping[str, float]]
    strength: Mapping[str, float]
    noise: float
    sensor: str
    equivalent: tuple[frozenset[str], ...]
    truth: Truth
    wrong: tuple[str, float, float] | None = None
    bias: float = 0.0

    @property
    def base_name(self) -> str:
        """Name of the base model: 2D-L, 3D-L, 2D-NL or 3D-NL."""
        space = "3D" if self.base.has("vertical_acceleration") else "2D"
        return f"{space}-{'NL' if self.base.has('surface_nonlinearity') else 'L'}"

    @property
    def counts(self) -> bool:
        """Whether each hidden effect changes the heights by more than 3 noise deviations."""
        return all(self.strength[name] > VISIBLE for name in self.hidden)


@dataclass(frozen=True, slots=True)
class _Plan:
    """Contents of a test case before its motions are made: models, hidden effects, needs."""

    base: Truth
    truth: Truth
    hidden: tuple[str, ...]
    need: Need
    traits: tuple[Hidden, ...]
    wrong: tuple[str, float, float] | None = None


def make_case(
    kind: str, index: int, seed: int = 0, effect: str | None = None, dirt: Dirt | None = None
) -> Case:
    """Creates the test case of a kind, index and seed, with a given or a random hidden effect.

    With dirt it is the same case, but for what its sensor and its inputs do.

    Raises:
        ValueError: an unknown kind or effect.
        RuntimeError: no such case found in many attempts.
    """
    if kind not in KINDS:
        raise ValueError(f"{kind} is no kind of case: {', '.join(KINDS)}")
    if effect is not None and effect not in {**LISTED, **OUTSIDE}:
        raise ValueError(f"{effect} is no effect that a case can hide")
    key = zlib.crc32(f"{kind} {effect or ''}".encode())
    random = np.random.default_rng([seed, key, index])
    names = hidden_names(random, kind, index, effect)
    # every eighth round of the list takes what comes
    weak = kind == "single" and index // len(LISTED) % WEAK_EVERY == WEAK_EVERY - 1
    name = case_name(kind, index, seed, effect, dirt)
    best: Case | None = None
    for _ in range(ATTEMPTS):
        case = _attempt(random, kind, name, names, dirt)
        if case is None:
            continue
        if case.counts or weak:
            return case
        if best is None or min(case.strength.values()) > min(best.strength.values()):
            best = case
    if best is None:
        raise RuntimeError(f"{name}: no case found that hides {' + '.join(names)}")
    return best


def case_name(kind: str, index: int, seed: int, effect: str | None, dirt: Dirt | None) -> str:
    """Returns the unique name of a test case."""
    words = [
        kind,
        str(seed),
        str(index),
        *([effect] if effect else []),
        *([dirt.tag] if dirt else []),
    ]
    return "-".join(words)


def hidden_names(random: Random, kind: str, index: int, effect: str | None) -> tuple[str, ...]:
    """Returns the names of a case's hidden effects; every effect is used in turn."""
    listed = list(LISTED)
    if kind == "none":
        return ()
    if kind == "outside":
        outside = list(OUTSIDE)
        return (effect or outside[index % len(outside)],)
    first = effect or listed[index % len(listed)]
    if kind in ("single", "wrong_parameter"):
        return (first,)
    while True:
        second = listed[random.integers(len(listed))]
        if second != first and frozenset({first, second}) not in SAME:
            return (first, second)


def _attempt(
    random: Random, kind: str, name: str, names: tuple[str, ...], dirt: Dirt | None
) -> Case | None:
    plan = _plan(random, kind, names)
    if plan is None:
        return None
    count, kept = int(random.integers(3, 7)), int(random.integers(1, 3))
    try:
        inputs = [
            robot_motion(random, plan.truth.without(*plan.hidden), plan.need)
            for _ in range(count + kept)
        ]
    except RuntimeError:
        return None
    if not all(_sane(plan.truth, motion) for motion in inputs):
        return None
    sessions = np.cumsum([0.0] + [m.t[-1] - m.t[0] + PAUSE for m in inputs])[:-1]
    how = Record.draw(random, plan.traits)
    change = {
        lost: how.change(plan.truth, lacking, inputs[:count], sessions[:count])
        for lost, lacking in _lacking(plan).items()
    }
    noise = _noise(random, [change[hidden] for hidden in plan.hidden])
    how = replace(how, noise=noise, dirt=dirt)
    rows = [
        record(random, plan.truth, motion, how, f"motion {i + 1}", session)
        for i, (motion, session) in enumerate(zip(inputs, sessions, strict=True))
    ]
    felt = [row.inputs for row in rows[:count]]
    seen = math.hypot(noise, how.driven(plan.truth, inputs[:count], felt, sessions[:count]))
    return Case(
        name,
        kind,
        plan.base.as_model(),
        tuple(rows[:count]),
        tuple(rows[count:]),
        plan.hidden,
        {hidden: plan.truth.effects[hidden] for hidden in plan.hidden},
        {lost: size / seen for lost, size in change.items()},
        noise,
        how.sensor,
        _equivalent(plan),
        plan.truth,
        plan.wrong,
        0.0 if dirt is None else dirt.input_bias,
    )


def _noise(random: Random, changes: list[float]) -> float:
    """Draws a height noise from 0.1 to 1 mm that does not hide a visible effect."""
    noise = float(np.exp(random.uniform(*np.log(NOISE))))
    most = min(changes, default=np.inf) / VISIBLE
    if NOISE[0] < most < noise:
        noise = float(np.exp(random.uniform(np.log(NOISE[0]), np.log(most))))
    return noise


def _sane(truth: Truth, motion: Inputs) -> bool:
    """Whether the simulated wave is finite and lower than a fraction of the cup's radius."""
    height = float(np.max(simulate(truth, motion).msh))
    return bool(np.isfinite(height) and height < LARGEST_SHARE * truth.radius)


def _lacking(plan: _Plan) -> dict[str, Truth]:
    """Returns, for each hidden effect, the true liquid without this effect."""
    without = {name: plan.truth.without(name) for name in plan.hidden}
    if plan.wrong is not None:
        without[plan.wrong[0]] = _with_parameter(plan.truth, plan.wrong[0], plan.wrong[1])
    return without


def _equivalent(plan: _Plan) -> tuple[frozenset[str], ...]:
    bent = plan.truth.has("surface_nonlinearity") or plan.truth.has("gravity_tilt")
    lifted = plan.truth.has("vertical_acceleration") and plan.need.vertical
    if bent or lifted or len(plan.hidden) != 1:
        return ()
    return tuple(group for group in SAME if group & set(plan.hidden))


def _plan(random: Random, kind: str, names: tuple[str, ...]) -> _Plan | None:
    """Draws base model, hidden effects and requirements on the motions; None if they conflict."""
    traits = tuple({**LISTED, **OUTSIDE}[name] for name in names)
    base = _base(random, traits)
    need = _need(random, traits, base, names)
    if need is None:
        return None
    if need.tilt and "gravity_tilt" not in names:
        base = base.plus("gravity_tilt", {})
    truth = base
    for name, trait in zip(names, traits, strict=True):
        truth = truth.plus(name, trait.draw(random, base))
    if kind != "wrong_parameter":
        return _Plan(base, truth, names, need, traits)
    wrong = _wrong(random, base, names)
    if wrong is None:
        return None
    return _Plan(_with_parameter(base, wrong[0], wrong[1]), truth, names, need, traits, wrong)


def _base(random: Random, traits: tuple[Hidden, ...]) -> Truth:
    radius = random.uniform(0.04, 0.06)
    effects: dict[str, dict[str, float]] = {}
    if random.random() < 0.5 and not any(trait.planar_base for trait in traits):
        effects["vertical_acceleration"] = {}
    if random.random() < 0.5 and not any(trait.linear_base for trait in traits):
        effects["surface_nonlinearity"] = {"alpha": 0.58}
    return Truth(
        radius,
        radius * random.uniform(0.8, 1.8),
        float(np.exp(random.uniform(np.log(1e-6), np.log(1e-5)))),
        None if random.random() < 0.4 else random.uniform(0.004, 0.03),
        effects,
    )


def _need(
    random: Random, traits: tuple[Hidden, ...], base: Truth, names: tuple[str, ...]
) -> Need | None:
    """Combines what the hidden effects require of the motions; None if that is contradictory."""
    needs = [trait.need for trait in traits]
    upright = any(trait.upright for trait in traits)
    yaw, tilt = (any(getattr(need, name) for need in needs) for name in ("yaw", "tilt"))
    if upright and (yaw or tilt):
        return None
    yaw = yaw or (not upright and random.random() < 0.25)
    tilt = tilt or (not upright and random.random() < (0.5 if "lever_arm" in names else 0.15))
    vertical = any(need.vertical for need in needs)
    lifted = base.has("vertical_acceleration") and random.random() < 0.8
    return Need(
        vertical=vertical or lifted,
        yaw=yaw,
        tilt=tilt,
        fast=any(need.fast for need in needs),
        columns=str(random.choice(["both", "both", "attitude", "rates"])),
    )


def _wrong(random: Random, base: Truth, names: tuple[str, ...]) -> tuple[str, float, float] | None:
    """Draws a base model parameter that is wrong: its name, the wrong and the true value."""
    which = str(random.choice(WRONG))
    if NAMED_AS[which] in names:
        return None
    if which == "alpha":
        if not base.has("surface_nonlinearity"):
            return None
        return which, float(random.choice([0.1, 0.3, 1.0, 1.3])), 0.58
    if which == "fill_height":
        given = base.fill_height + sign(random) * random.uniform(0.006, 0.02)
        return which, max(given, 0.4 * base.radius), base.fill_height
    if base.damping_ratio is None:
        return None
    factor = random.uniform(0.35, 0.7) if random.random() < 0.5 else random.uniform(1.5, 3.0)
    return which, base.damping_ratio * factor, base.damping_ratio


def _with_parameter(truth: Truth, which: str, value: float) -> Truth:
    if which == "alpha":
        return truth.plus("surface_nonlinearity", {"alpha": value})
    if which == "fill_height":
        return replace(truth, fill_height=value)
    return replace(truth, damping_ratio=value)
