"""What a linear model lacks to explain a recording, checked on another: discovery.png."""

from pathlib import Path

import matplotlib.pyplot as plt

import slosh

BAGS = Path(__file__).resolve().parent.parent / "bags"
base = slosh.Model.from_cup(diameter=0.1, fill_height=0.07, rim_height=0.135).linear()
finding = slosh.discover(BAGS / "c3", base, holdout=BAGS / "e3")
print(finding)
for effect in finding.effects:
    print(effect.name, dict(effect.parameters))
print(finding.to_pandas().head(3))
finding.plot()
plt.savefig("discovery.png")
