"""Installs slosh_shapes as an ament package."""

from package_setup import install

install(
    ["numpy>=1.26", "scipy"],
    extras={"modes": ["scikit-fem"]},
    add_on="shapes = slosh_shapes.addon:ADDON",
)
