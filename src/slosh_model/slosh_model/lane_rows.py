"""Positions of the quantities of vectorised simulations in one array; see `batch_kernel`.

Each name is the place of a quantity's first row in a flat array; row r of it, in lane k, is at
`place + r LANES + k`.
"""

from __future__ import annotations

from collections.abc import Mapping

from slosh_model.effects.registry import PARAMETER_COUNT
from slosh_model.indices import INPUT_COUNT, MODE_COUNT, POSE_COUNT, STATE_COUNT, TERM_COUNT

LANES = 32
"""Trajectories of a block, at most: what they need lies in the processor's first cache."""


def _places(**rows: int) -> tuple[Mapping[str, int], int]:
    places, end = {}, 0
    for name, count in rows.items():
        places[name] = end
        end += count * LANES
    return places, end


_PLACES, LENGTH = _places(
    mode=MODE_COUNT,  # its constants at the moment; rows as in `indices`
    constants=MODE_COUNT,  # the same without what changes them with time
    state=STATE_COUNT,  # where the slope is taken
    start=STATE_COUNT,  # the same at the begin of a Runge-Kutta step
    total=STATE_COUNT,  # the method's sum of slopes
    sums=TERM_COUNT,  # of the effects' terms
    acceleration=2,  # of the mass
    inputs=INPUT_COUNT,  # at the moment
    left_inputs=INPUT_COUNT,  # the same at the ends of the step
    right_inputs=INPUT_COUNT,
    old_inputs=INPUT_COUNT,  # and of the last two samples
    new_inputs=INPUT_COUNT,
    pose=POSE_COUNT,  # of the last sample
    yaw=1,
    elapsed=1,  # time since rest, at the last sample but one
    interval=1,  # from there to the last one
    begin=1,  # time since rest at the begin of the Runge-Kutta step
    step=1,  # its length
    moment=1,  # time since rest where the slope is taken
    heights=2,  # at +x and +y
    static_height=2,  # per acceleration, along x and y
    axes=1,  # azimuth of the modes' axes
    along=2,  # direction of a mode that moves along one line
    lift=1,  # 1 where the vertical acceleration acts
    parameters=PARAMETER_COUNT,  # the effects' switches and parameters
)

MODE, CONSTANTS = _PLACES["mode"], _PLACES["constants"]
STATE, START, TOTAL = _PLACES["state"], _PLACES["start"], _PLACES["total"]
SUMS, ACCELERATION = _PLACES["sums"], _PLACES["acceleration"]
INPUTS, POSE, YAW = _PLACES["inputs"], _PLACES["pose"], _PLACES["yaw"]
LEFT_INPUTS, RIGHT_INPUTS = _PLACES["left_inputs"], _PLACES["right_inputs"]
OLD_INPUTS, NEW_INPUTS = _PLACES["old_inputs"], _PLACES["new_inputs"]
HEIGHTS, PARAMETERS = _PLACES["heights"], _PLACES["parameters"]
STATIC_HEIGHT, LIFT = _PLACES["static_height"], _PLACES["lift"]
AXES, ALONG = _PLACES["axes"], _PLACES["along"]
ELAPSED, INTERVAL = _PLACES["elapsed"], _PLACES["interval"]
BEGIN, STEP, MOMENT = _PLACES["begin"], _PLACES["step"], _PLACES["moment"]
