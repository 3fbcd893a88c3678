"""Installs slosh_testing as an ament package."""

from package_setup import install

install(
    ["numpy>=1.26", "PyYAML", "mcap", "opencv-python-headless>=4.6", "pytest", "rosbags", "scipy"]
)
