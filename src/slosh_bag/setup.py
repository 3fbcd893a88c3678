"""Installs slosh_bag as an ament package."""

from package_setup import install

install(
    ["lz4", "matplotlib", "mcap>=1.5", "numba", "numpy>=1.26", "rosbags", "scipy", "zstandard"],
    extras={"tables": ["pandas"]},
    programs=[
        "player = slosh_bag.nodes.player_node:main",
        "recorder = slosh_bag.nodes.recorder_node:main",
    ],
)
