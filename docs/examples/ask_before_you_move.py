# %% [markdown]
# # Prediction, step by step
#
# A cup of water is carried 40 cm: the height of the water, the fastest safe duration, and an
# optimisation with SciPy. This needs no ROS:
#
# ```
# pip install ./src/slosh_model ./src/slosh_base ./src/slosh_plan matplotlib
# ```
#
# `slosh_model` simulates and computes gradients; it needs `slosh_base`.
#
# ## Candidates
#
# The cup: 50 mm radius, water to 70 mm, the nonlinear model in three dimensions. The motion: the
# quintic polynomial, in three durations.

# %%
import matplotlib.pyplot as plt
import numpy as np

from slosh_model import Cylinder, Model
from slosh_model.motion_profiles import quintic
from slosh_plan import HeightLimits, Trajectory, predict, safe_scales

cup = Model(Cylinder(radius=0.05, fill_height=0.07)).spatial().nonlinear()


def carried(duration, distance=0.4):
    t = np.linspace(0.0, duration, round(1000 * duration) + 1)
    position = np.outer(distance * quintic(t / duration)[0], [1.0, 0.0, 0.0])
    return Trajectory.from_poses(t, position, name=f"{duration:.2f} s")


candidates = [carried(duration) for duration in (0.8, 1.0, 1.3)]

# %% [markdown]
# ## Prediction
#
# The highest height, and the height after the motion:

# %%
limits = HeightLimits(height=0.015, residual=0.002)
for answer in predict(cup, candidates, limits=limits):
    peak, after = 1e3 * answer.nonlinear.peak, 1e3 * answer.nonlinear.residual
    print(f"{answer.name}: {peak:4.1f} mm, afterwards {after:4.1f} mm, kept: {answer.kept}")

# %% [markdown]
# Over time:

# %%
from slosh_model import simulate

figure, axes = plt.subplots(figsize=(7.5, 2.8))
for motion in candidates:
    response = simulate(cup, motion.inputs(horizon=0.8))[0]
    axes.plot(response.t, 1e3 * response.msh, label=motion.name)
axes.axhline(15.0, color="tab:red", linestyle=":", label="limit")
axes.set(xlabel="time [s]", ylabel="height [mm]")
axes.legend()

# %% [markdown]
# ## Safe durations
#
# Slower is not always safer: the residual wave oscillates with the duration.

# %%
found = safe_scales(cup, carried(1.0), limits)
for first, last in found.islands:
    print(f"safe: {first:.3f} … {last:.3f} s")
print(f"safe from {found.safe_from:.3f} s on")

# %%
durations = np.linspace(0.7, 2.2, 120)
answers = predict(cup, [carried(duration) for duration in durations])
figure, axes = plt.subplots(figsize=(7.5, 2.8))
axes.plot(durations, [1e3 * one.nonlinear.peak for one in answers], label="highest")
axes.plot(durations, [1e3 * one.nonlinear.residual for one in answers], label="after the end")
axes.axhline(15.0, color="tab:red", linestyle=":", label="limits")
axes.axhline(2.0, color="tab:red", linestyle=":")
axes.set(xlabel="duration [s]", ylabel="height [mm]", ylim=(0.0, 40.0))
axes.legend()

# %% [markdown]
# ## Selection
#
# The fastest motion that keeps both limits:

# %%
fastest = found.islands[0][0] if found.islands else found.safe_from
accepted = carried(1.0).scaled(1.001 * fastest)
(answer,) = predict(cup, accepted, limits=limits)
print(f"{accepted.duration:.3f} s, {1e3 * answer.nonlinear.peak:.1f} mm, kept: {answer.kept}")

# %% [markdown]
# ## Input shaping
#
# The waves of the two copies of the ZV filter ([others](shape.md)) nearly cancel.

# %%
from slosh_plan.shaping.filters import Damped, zero_vibration
from slosh_plan.shaping.shaped import course_of, shaped

first_mode = cup.mode_constants()[0]
zv = zero_vibration(Damped(first_mode.natural_frequency, first_mode.damping_ratio))
motion = shaped(course_of(carried(0.8)), zv)
(answer,) = predict(cup, Trajectory(motion.t, motion.acceleration, name="ZV"), limits=limits)
print(
    f"{motion.duration:.3f} s, {1e3 * answer.nonlinear.peak:.1f} mm, "
    f"afterwards {1e3 * answer.nonlinear.residual:.2f} mm"
)

# %% [markdown]
# ## Your own optimiser
#
# `peak_gradient` gives the derivative of the highest height by every sample of the acceleration
# (adjoint of the simulation). Here SciPy changes the polynomial, in the same 0.8 s, to minimise
# the height. The maximum is not smooth, so the smooth maximum is minimised.

# %%
from scipy.optimize import minimize

from slosh_model import Inputs
from slosh_model.gradient import peak_gradient

duration, distance = 0.8, 0.4
t = np.linspace(0.0, duration, 801)
u = t / duration
bumps = np.stack([(u * (1.0 - u)) ** 4 * (1.0 - 2.0 * u) ** n for n in (1, 3, 5)])
shapes = np.gradient(np.gradient(bumps, u, axis=1), u, axis=1) * 256.0
unit = distance / duration**2


def cost(weights):
    acceleration = np.zeros((len(t), 3))
    acceleration[:, 0] = unit * (quintic(u)[2] + weights @ shapes)
    found = peak_gradient(cup, Inputs(t, acceleration), smoothing=2e-4)
    return 1e3 * found.height, 1e3 * unit * shapes @ found.gradient[:, 0]


best = minimize(cost, np.zeros(3), jac=True, method="BFGS", options={"maxiter": 40})
figure, axes = plt.subplots(figsize=(7.5, 2.8))
for weights, label in ((np.zeros(3), "quintic"), (best.x, "least height")):
    acceleration = np.zeros((len(t), 3))
    acceleration[:, 0] = unit * (quintic(u)[2] + weights @ shapes)
    response = simulate(cup, Inputs(t, acceleration))[0]
    axes.plot(t, 1e3 * response.msh, label=label)
    print(f"{label}: {1e3 * response.msh.max():.1f} mm")
axes.set(xlabel="time [s]", ylabel="height [mm]")
axes.legend()

# %% [markdown]
# Supported are the linear and the nonlinear model of a cylinder and the linear one of a rectangle,
# in two and three dimensions, with effects that change only the modes; others are refused by
# name. For limits and paths use [`slosh plan`](plan.md).
