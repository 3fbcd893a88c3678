"""What a linear model lacks to explain a recording, checked on another: discovery.png."""

import matplotlib.pyplot as plt

from slosh_discovery.discover import discover
from slosh_discovery.discover_data import read_motions
from slosh_model import Cylinder, Model

base = Model(Cylinder(radius=0.05, fill_height=0.07, rim_height=0.135)).spatial()
fit, unseen = read_motions("bags/c3"), read_motions("bags/e3")
finding = discover(fit, base, unseen)
print(finding)
for effect in finding.effects:
    print(effect.name, dict(effect.parameters))
print(finding.to_pandas().head(3))
finding.plot()
plt.savefig("discovery.png")
