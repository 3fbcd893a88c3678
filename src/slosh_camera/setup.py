"""Installs slosh_camera as an ament package."""

from package_setup import install

install(
    ["numba", "numpy>=1.26", "opencv-python-headless>=4.6", "scipy"],
    programs=["camera = slosh_camera.nodes.camera_node:main"],
)
