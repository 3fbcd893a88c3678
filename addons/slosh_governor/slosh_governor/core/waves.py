"""Compiled simulation of the usual nonlinear (NL) models, several in parallel vector lanes.

A lane is a model in a candidate motion. Most containers' models have one mode and the effects
`vertical_acceleration` and `surface_nonlinearity` or `pendulum_nonlinearity`: their equations are
solved for the accelerations beforehand, in quantities without a unit, so that all lanes of a row
are one sequence of vector instructions. Others are simulated by `slosh_model.batch_kernel`.
"""

from __future__ import annotations

from slosh_base.compiled.compilation import compiled
from slosh_governor.core.layout import MODELS
from slosh_model.constants import GRAVITY
from slosh_model.effects.registry import SLOTS
from slosh_model.layout import divided, records
from slosh_model.model import Model
from slosh_model.simulate import store_of

LANES = MODELS
OTHER, PARABOLOID, PENDULUM = range(3)
"""Kinds of models: any; a mass on a paraboloid in a round wall (DL22, eqs. (11), (14)), or the
linear model there; a pendulum along each axis of a rectangle (TM20, eq. (6))."""
STEEPEST = 1.25
"""Largest angle of a pendulum for which its sine and cosine are computed here [rad]."""
_EVERY = 8
"""Rows after which heights are compared with the ceiling."""
_TERMS = {"vertical_acceleration", "surface_nonlinearity", "pendulum_nonlinearity"}
_LIFT, _CURVED = SLOTS["vertical_acceleration"], SLOTS["surface_nonlinearity"]

(
    X, Y, VX, VY, OLD_X, OLD_Y, OLD_G, NEW_X, NEW_Y, NEW_G, SCALE_X, SCALE_Y, STIFF_X, STIFF_Y,
    DRAG_X, DRAG_Y, CURVED, SPRING, GAIN_X, GAIN_Y, HEIGHT_X, HEIGHT_Y, TOP, LAST_X, LAST_Y,
    STEEP, END, LIFTED, STATIC_X, STATIC_Y,
) = range(0, 30 * LANES, LANES)  # fmt: skip
"""Places in the work array of quantities that have a value for each lane: state; acceleration and
relative gravity at the last row and the next one; scales of the state; constants of the equations;
heights and the greatest so far; greatest and last greatest after the stop; square of the steepest
angle; row of the rest; change of gravity by acceleration [s²/m]; height that follows the
acceleration at once."""
QUANTITIES = 30
WORK = QUANTITIES * LANES
"""Length of that array."""


def kind_of(model: Model) -> int:
    """Classifies a model: PARABOLOID or PENDULUM if it can be simulated in vectors, else OTHER."""
    store = store_of(model)
    runs, modes = divided(store)
    run, mode = runs[0], modes[0]
    terms = {effect.name for effect, _ in model.uses("term")}
    # Without yaw the drag by yaw is nothing.
    drives = {effect.name for effect, _ in model.uses("drive")} - {"yaw_coupling"}
    plain = terms <= _TERMS and not drives and not model.uses("modulation") and len(modes) == 1
    turned = run["axes"] or mode["along_x"] or mode["along_y"] or run["corner_count"]
    if not plain or turned:
        return OTHER
    if "pendulum_nonlinearity" in terms:
        return PENDULUM if terms < _TERMS and run["cornered"] else OTHER
    return OTHER if run["cornered"] or mode["frequency_ratio"] != 1.0 else PARABOLOID


@compiled
def _load(w, k, store, pendulum, end):  # type: ignore[no-untyped-def]
    """Loads a model's state and constants into a lane, in units of the radius or in rad."""
    runs, modes = records(store)
    run, mode = runs[0], modes[0]
    omega, parameters = mode["natural_frequency"], run["parameters"]
    across = omega * mode["frequency_ratio"]
    scale_x = omega * omega / GRAVITY if pendulum else 1.0 / mode["radius"]
    scale_y = across * across / GRAVITY if pendulum else scale_x
    curved = parameters[_CURVED]
    w[X + k], w[VX + k] = scale_x * mode["x"], scale_x * mode["vx"]
    w[Y + k], w[VY + k] = scale_y * mode["y"], scale_y * mode["vy"]
    w[SCALE_X + k], w[SCALE_Y + k] = scale_x, scale_y
    w[STIFF_X + k], w[STIFF_Y + k] = omega * omega, across * across
    w[DRAG_X + k] = 2.0 * mode["damping_ratio"] * omega
    w[DRAG_Y + k] = 2.0 * mode["damping_ratio"] * across
    w[CURVED + k] = curved * mode["curvature"] * mode["curvature"]
    w[SPRING + k] = curved * omega * omega * parameters[_CURVED + 1]
    w[GAIN_X + k] = mode["height_gain"] / scale_x
    w[GAIN_Y + k] = mode["height_gain_y"] / scale_y
    w[STATIC_X + k], w[STATIC_Y + k] = (
        run["static_height"] / scale_x,
        run["static_height_y"] / scale_y,
    )
    w[OLD_X + k], w[OLD_Y + k] = scale_x * run["ax"], scale_y * run["ay"]
    w[LIFTED + k], w[END + k] = parameters[_LIFT] / GRAVITY, end
    w[OLD_G + k] = 1.0 + run["az"] * w[LIFTED + k]


@compiled
def _on_paraboloid(w, k, x, y, vx, vy, ax, ay, g):  # type: ignore[no-untyped-def]
    """Returns the acceleration of a mass on a paraboloid, divided by the radius [1/s²].

    (I + c q qᵀ) q̈ = f is solved for q̈.
    """
    c, drag = w[CURVED + k], w[DRAG_X + k]
    square = x * x + y * y
    pull = c * (drag * (x * vx + y * vy) + (vx * vx + vy * vy)) + w[SPRING + k] * square
    pull += w[STIFF_X + k] * g
    fx, fy = -pull * x - drag * vx - ax, -pull * y - drag * vy - ay
    back = c * (x * fx + y * fy) / (1.0 + c * square)
    return fx - back * x, fy - back * y


@compiled
def _swing(angle, rate, a, stiffness, drag):  # type: ignore[no-untyped-def]
    """Returns a pendulum's angular acceleration [rad/s²]; sine and cosine by series to 1e-11."""
    u = angle * angle
    sine = 1.0 / 39916800.0 - u * (1.0 / 6227020800.0)
    sine = 1.0 / 362880.0 - u * sine
    sine = 1.0 / 5040.0 - u * sine
    sine = 1.0 / 120.0 - u * sine
    sine = 1.0 / 6.0 - u * sine
    cosine = 1.0 / 3628800.0 - u * (1.0 / 479001600.0 - u * (1.0 / 87178291200.0))
    cosine = 1.0 / 40320.0 - u * cosine
    cosine = 1.0 / 720.0 - u * cosine
    cosine = 1.0 / 24.0 - u * cosine
    cosine = 1.0 - u * (0.5 - u * cosine)
    return -stiffness * (angle - angle * u * sine) - cosine * (a + drag * cosine * rate)


@compiled
def _slope(pendulum, w, k, q, ax, ay, g):  # type: ignore[no-untyped-def]
    """Returns the second time derivatives of a wave's x and y coordinates in one lane."""
    x, y, vx, vy = q
    if not pendulum:
        return _on_paraboloid(w, k, x, y, vx, vy, ax, ay, g)
    along = _swing(x, vx, ax, w[STIFF_X + k] * g, w[DRAG_X + k])
    return along, _swing(y, vy, ay, w[STIFF_Y + k] * g, w[DRAG_Y + k])


@compiled
def _advance(pendulum, w, k, step):  # type: ignore[no-untyped-def]
    """Makes one Runge-Kutta step of a lane, from one row to the next."""
    x, y, vx, vy = w[X + k], w[Y + k], w[VX + k], w[VY + k]
    ax, ay, g = w[OLD_X + k], w[OLD_Y + k], w[OLD_G + k]
    bx, by, h = w[NEW_X + k], w[NEW_Y + k], w[NEW_G + k]
    mx, my, m, half = 0.5 * (ax + bx), 0.5 * (ay + by), 0.5 * (g + h), 0.5 * step
    ax1, ay1 = _slope(pendulum, w, k, (x, y, vx, vy), ax, ay, g)
    vx2, vy2 = vx + half * ax1, vy + half * ay1
    q = (x + half * vx, y + half * vy, vx2, vy2)
    ax2, ay2 = _slope(pendulum, w, k, q, mx, my, m)
    vx3, vy3 = vx + half * ax2, vy + half * ay2
    q = (x + half * vx2, y + half * vy2, vx3, vy3)
    ax3, ay3 = _slope(pendulum, w, k, q, mx, my, m)
    vx4, vy4 = vx + step * ax3, vy + step * ay3
    q = (x + step * vx3, y + step * vy3, vx4, vy4)
    ax4, ay4 = _slope(pendulum, w, k, q, bx, by, h)
    sixth = step / 6.0
    w[X + k] = x + sixth * (vx + 2.0 * (vx2 + vx3) + vx4)
    w[Y + k] = y + sixth * (vy + 2.0 * (vy2 + vy3) + vy4)
    w[VX + k] = vx + sixth * (ax1 + 2.0 * (ax2 + ax3) + ax4)
    w[VY + k] = vy + sixth * (ay1 + 2.0 * (ay2 + ay3) + ay4)


@compiled
def _advance_on_paraboloid(lanes, w, step):  # type: ignore[no-untyped-def]
    for k in range(lanes):
        _advance(False, w, k, step)


@compiled
def _advance_pendulum(lanes, w, step):  # type: ignore[no-untyped-def]
    for k in range(lanes):
        _advance(True, w, k, step)


@compiled
def _heights(w, k):  # type: ignore[no-untyped-def]
    """Returns the wall heights of one lane at the container's +x and +y side [m]."""
    g = w[NEW_G + k]
    light = 1.0 / (g if g > 0.5 else 0.5)
    x = w[GAIN_X + k] * w[X + k] - w[STATIC_X + k] * light * w[NEW_X + k]
    return x, w[GAIN_Y + k] * w[Y + k] - w[STATIC_Y + k] * light * w[NEW_Y + k]


@compiled
def _watch_round(lanes, w):  # type: ignore[no-untyped-def]
    """Updates the heights of all lanes, and each lane's maximum square on a round wall [m²]."""
    for k in range(lanes):
        x, y = _heights(w, k)
        w[HEIGHT_X + k], w[HEIGHT_Y + k], top = x, y, w[TOP + k]
        square = x * x + y * y
        w[TOP + k] = square if square > top else top


@compiled
def _watch_rectangle(lanes, w, row):  # type: ignore[no-untyped-def]
    """Updates the heights of all lanes, and each lane's greatest height at the corners [m].

    After the stop the crests of both axes may meet at any time.
    """
    for k in range(lanes):
        x, y = _heights(w, k)
        w[HEIGHT_X + k], w[HEIGHT_Y + k], top = x, y, w[TOP + k]
        rests = 1.0 if row >= w[END + k] else 0.0
        last_x, last_y = rests * w[LAST_X + k], rests * w[LAST_Y + k]
        x, y = abs(x), abs(y)
        last_x, last_y = x if x > last_x else last_x, y if y > last_y else last_y
        w[LAST_X + k], w[LAST_Y + k] = last_x, last_y
        w[TOP + k] = last_x + last_y if last_x + last_y > top else top
        u, v, steep = w[X + k] * w[X + k], w[Y + k] * w[Y + k], w[STEEP + k]
        u = u if u > v else v
        w[STEEP + k] = u if u > steep else steep


@compiled
def _take_inputs(lanes, w, inputs, row):  # type: ignore[no-untyped-def]
    for k in range(lanes):
        w[NEW_X + k] = inputs[row, 0, k]
    for k in range(lanes):
        w[NEW_Y + k] = inputs[row, 1, k]
    for k in range(lanes):
        w[NEW_G + k] = inputs[row, 2, k]
    for k in range(lanes):
        w[NEW_X + k], w[NEW_Y + k] = w[SCALE_X + k] * w[NEW_X + k], w[SCALE_Y + k] * w[NEW_Y + k]
        w[NEW_G + k] = 1.0 + w[LIFTED + k] * w[NEW_G + k]


@compiled
def _exceeds(lanes, w, ceiling):  # type: ignore[no-untyped-def]
    """Whether the greatest height (or its square) in any lane exceeds a ceiling."""
    highest = 0.0
    for k in range(lanes):
        highest = max(highest, w[TOP + k])
    return highest > ceiling


@compiled
def begin_waves(stores, size, which, models, ends, pendulum, w):  # type: ignore[no-untyped-def]
    """Loads models and candidate motions into the lanes; unused lanes repeat the first lane.

    Args:
        stores: (MODELS, …) of a container.
        size: of its store.
        which: (N,) candidates.
        models: (M,) models; N M lanes at most LANES.
        ends: (CANDIDATES,) rows until each is at rest.
        pendulum: whether the models' kind is PENDULUM.
        w: (WORK,) zeros; changed.
    """
    count = models.shape[0]
    for k in range(LANES):
        lane = k if k < which.shape[0] * count else 0
        store = stores[models[lane % count], :size]
        _load(w, k, store, pendulum, float(ends[which[lane // count]]))


@compiled
def simulate_waves(w, inputs, intervals, count, pendulum, ceiling, heights):  # type: ignore[no-untyped-def]
    """Simulates the waves of all simulations; ends early after a height above the ceiling.

    Args:
        w: (WORK,) as `begin_waves` leaves it; changed: TOP is the greatest height of each lane
            [m], of a paraboloid its square [m²].
        inputs: (rows, 3, LANES) acceleration [m/s²].
        intervals: (rows - 1,) [s].
        count: of the rows.
        pendulum: as in `begin_waves`.
        ceiling: [m].
        heights: (rows, 2, LANES) receives the wall heights but for the first row [m].

    Returns:
        the number of rows that are simulated, the first one counted.
    """
    lanes = w.shape[0] // QUANTITIES  # a constant would unroll the loops into scalar code
    most = ceiling if pendulum else ceiling * ceiling
    for row in range(1, count):
        _take_inputs(lanes, w, inputs, row)
        step = intervals[row - 1]
        if pendulum:
            _advance_pendulum(lanes, w, step)
        else:
            _advance_on_paraboloid(lanes, w, step)
        for k in range(3 * LANES):
            w[OLD_X + k] = w[NEW_X + k]
        if pendulum:
            _watch_rectangle(lanes, w, float(row))
        else:
            _watch_round(lanes, w)
        for k in range(lanes):
            heights[row, 0, k] = w[HEIGHT_X + k]
        for k in range(lanes):
            heights[row, 1, k] = w[HEIGHT_Y + k]
        if row % _EVERY == 0 and _exceeds(lanes, w, most):
            return row + 1
    return count
