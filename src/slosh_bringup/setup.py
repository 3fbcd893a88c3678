"""Installs slosh_bringup as an ament package."""

from package_setup import install

install(
    [
        "PyYAML",
        "distributed>=2025.1",
        "jinja2",
        "matplotlib",
        "numpy>=1.26",
        "opencv-python-headless>=4.6",
        "scipy",
        "starlette>=0.40",
        "tqdm",
        "uvicorn>=0.35",
        "websockets>=14",
    ],
    extras={"completion": ["argcomplete"]},
    programs=[
        "cell = slosh_bringup.nodes.cell_node:main",
        "markers = slosh_bringup.nodes.markers_node:main",
        "watch = slosh_bringup.nodes.watch_node:main",
    ],
)
