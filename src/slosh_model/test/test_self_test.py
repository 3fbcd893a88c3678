"""Tests that compiled code that differs from its source is refused."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from slosh_base.compiled.compilation import EntryPoint
from slosh_model import batch_kernel, kernel
from slosh_model.effects.registry import PARAMETER_COUNT
from slosh_model.errors import SloshModelError
from slosh_model.model import Model
from slosh_model.self_test import compare, reference_models, reference_motion
from slosh_model.simulate import simulate

CHECKED = {
    "advance_many": (kernel.advance_many, -1),
    "step": (kernel.step, 0),
    "read_many": (kernel.read_many, -1),
    "advance_block": (batch_kernel.advance_block, -1),
}


@pytest.mark.parametrize("name", list(CHECKED))
def test_a_number_that_is_wrong_in_the_seventh_digit_is_seen(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    entry, changed = CHECKED[name]
    right = entry.load()

    def wrong(*arguments: Any) -> Any:
        returned = right(*arguments)
        arguments[changed].flat[-1] *= 1.0 + 1e-7
        return returned

    fresh(entry, wrong, monkeypatch)
    with pytest.raises(SloshModelError, match=f"self-test: the compiled .*{name} gives"):
        entry.load()
    with pytest.raises(SloshModelError):  # and again: it does not count as loaded
        entry.load()


@pytest.mark.parametrize("name", list(CHECKED))
def test_what_does_nothing_is_seen(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    entry, _ = CHECKED[name]
    fresh(entry, lambda *arguments: (0.0, 0.0) if entry is kernel.step else None, monkeypatch)
    with pytest.raises(SloshModelError):
        entry.load()


def test_right_code_passes(monkeypatch: pytest.MonkeyPatch) -> None:
    for entry, _ in CHECKED.values():
        right = entry.load()
        fresh(entry, right, monkeypatch)
        assert entry.load() is right


def test_the_reference_shows_every_effect() -> None:
    """Tests that each effect changes the heights of the reference motion."""
    models = list(reference_models())
    motion = reference_motion()
    assert np.ptp(motion.yaws) > 0.1
    for plain, every in zip(models[::2], models[1::2], strict=True):
        for use in every.effects:
            without = every.without_effect(use.name)
            assert heights(every) != heights(without), use.name
        assert plain.effects == ()
    # Compiled code tells containers apart by this alone.
    assert {model.container.cornered for model in models} == {False, True}


def heights(model: Model) -> bytes:
    response, _ = simulate(model, reference_motion())
    return response.sh_x.tobytes() + response.sh_y.tobytes()


def test_not_a_number_in_both_is_equal() -> None:
    state = np.full(len(reference_motion().t), np.nan)
    compare(
        kernel.read_many, reference_motion().t, 0.0, np.full((len(state), 2), np.nan), 0.1,
        np.full(2, 0.05), 0.07, False, np.empty((0, 2)), np.zeros(PARAMETER_COUNT), np.zeros(8),
        state,
    )  # fmt: skip


def fresh(entry: EntryPoint, call: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> None:
    """Makes an entry point appear as not loaded; it will load `call`."""
    monkeypatch.setattr(entry, "_call", None)
    monkeypatch.setattr(entry, "_compile", lambda: call)
