"""How high the liquid rises when a cup is carried 40 cm, linear and nonlinear: heights.png."""

import matplotlib.pyplot as plt
import numpy as np

import slosh
from slosh_model.motion_profiles import quintic

t = np.arange(0.0, 3.0, 0.001)
share = quintic(np.clip(t / 1.2, 0.0, 1.0))[2] * (t < 1.2) / 1.2**2  # of the way, per s²
motion = slosh.Motion(t, np.outer(0.4 * share, [1.0, 0.0, 0.0]))

cup = slosh.Model.from_cup(diameter=0.1, fill_height=0.07)
axes = None
for model in (cup.linear(), cup):
    response = slosh.simulate(model, motion)
    print(model.name, response)
    axes = response.plot(axes, label=model.name)
axes.legend()
plt.savefig("heights.png")
