# %% [markdown]
# # Prediction, step by step
#
# A cup of water is carried 40 cm: the height of the water, the fastest safe duration, and a
# filter of the motion. This needs no ROS:
#
# ```
# pip install ./src/slosh_model ./src/slosh_base ./src/slosh_plan matplotlib
# ```
#
# `slosh_model` simulates; it needs `slosh_base`.
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
