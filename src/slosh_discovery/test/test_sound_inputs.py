"""A faulty accelerometer is told before a discovery or an identification blames physics."""

from dataclasses import replace

import numpy as np
import pytest
from example_motions import BASE, measured

from slosh_discovery.discover import Verdict, discover
from slosh_discovery.errors import SloshDiscoveryError
from slosh_discovery.identify import identify
from slosh_model import Inputs


def faulty(seed, kind):
    motion = measured(BASE, seed)
    t, values = motion.inputs.t, motion.inputs.acceleration.copy()
    if kind == "clipped":
        limit = 0.7 * np.abs(values).max()
        values = values.clip(-limit, limit)
    else:
        row = np.searchsorted(t, 1.2)
        values[row : row + 50] = values[row]  # 0.2 s
    return replace(motion, inputs=Inputs(t, values))


@pytest.mark.first(1)
@pytest.mark.parametrize(("kind", "what"), [("clipped", "is clipped at"), ("frozen", "repeats")])
@pytest.mark.parametrize("ask", [discover, identify])
def test_motions_with_a_faulty_input_are_left_out_and_told(ask, kind, what):
    sound = [measured(BASE, seed) for seed in range(2)]
    found = ask([*sound, faulty(2, kind)], BASE, holdout=[faulty(3, kind)])
    told = [remark for remark in found.remarks if "left out" in remark]
    assert [remark[:8] for remark in told] == ["motion 2", "motion 3"]
    assert all(what in remark and "record again" in remark for remark in told)
    kept = [motion.name if ask is identify else motion.motion.name for motion in found.motions]
    assert kept == ["motion 0", "motion 1"]
    if ask is discover:
        assert found.verdict is Verdict.NONE
    with pytest.raises(SloshDiscoveryError, match=f"no motion with a sound input: .*{what}"):
        ask([faulty(seed, kind) for seed in range(3)], BASE)
