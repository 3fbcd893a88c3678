"""Installs slosh_estimator as an ament package."""

from package_setup import install

install(
    ["numba", "numpy>=1.26"],
    programs=[
        "estimator = slosh_estimator.nodes.estimator_node:main",
        "monitor = slosh_estimator.nodes.monitor_node:main",
        "sensor = slosh_estimator.nodes.sensor_node:main",
    ],
)
