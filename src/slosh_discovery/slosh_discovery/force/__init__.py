"""Natural frequency, damping ratio and sloshing mass from the force under a container.

A pure core: `record` holds what was measured, `prepared` brings it onto one grid, `liquid` gives
the liquid's force, `fit` identifies, `result` says what was found.
"""
