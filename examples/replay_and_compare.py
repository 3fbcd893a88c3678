"""Replays a recording with two models and lays them beside the camera: replay.png."""

import sys
from pathlib import Path

import matplotlib.pyplot as plt

import slosh

BAGS = Path(__file__).resolve().parent.parent / "bags"
result = slosh.replay(sys.argv[1] if len(sys.argv) > 1 else BAGS / "c3")
print(result)
for accuracy in result.accuracy:
    print(f"{accuracy.name}: MAE {1e3 * accuracy.sigma:.2f} mm, ε {accuracy.epsilon:+.1%}")
worst = (result.to_pandas()["measured"] - result.to_pandas()["3D-NL"]).abs().idxmax()
print(f"the nonlinear model is farthest off {worst:.2f} s after the first image")
result.plot()
plt.savefig("replay.png")
