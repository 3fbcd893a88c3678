"""Texts of the warnings that a calibration gives."""

from __future__ import annotations

import numpy as np

from slosh_camera.calibrate.curves import Curve
from slosh_camera.calibrate.still_fit import StillFit
from slosh_camera.calibrate.tuning import TUNING


def warnings_of(fit: StillFit) -> list[str]:
    """Returns warnings about contradictory or ambiguous edges in the image."""
    checks = {check.name: check for check in fit.curves}
    warnings = []
    floor = checks.get(Curve.BASE.value)
    if floor is not None and floor.share < TUNING.least_share:
        warnings.append(
            "the floor's edge is not where the dimensions predict it; if it is visible, check "
            "radius, fill height, wall thickness and the focal length, which the other edges "
            "do not determine"
        )
    for name in (Curve.LEFT.value, Curve.RIGHT.value, Curve.FRONT.value, Curve.REAR.value):
        check = checks.get(name)
        if check is not None and check.share < TUNING.clear_share:
            warnings.append(
                f"the {name} is visible on {100.0 * check.share:.0f} % of its length, the rest "
                "is hidden or the edge of another object: check that it is where --picture "
                "draws it"
            )
        if check is not None and abs(check.offset) > TUNING.doubtful_offset:
            warnings.append(
                f"the {name} is {check.offset:+.1f} px from where the pose predicts it"
            )
    if fit.residual > TUNING.most_residual:
        warnings.append(
            f"the edges are {fit.residual:.2f} px from the pose, more than "
            f"{TUNING.most_residual:g}: check the intrinsic parameters and the dimensions; "
            "standard errors are increased accordingly"
        )
    worst = max(fit.height_stddev.values())
    if worst > TUNING.most_height_error:
        warnings.append(
            f"heights are known to {1e3 * worst:.1f} mm only; let the container fill more "
            "of the image, or show both the front and the rear line of the level"
        )
    if not np.isfinite(fit.residual):
        warnings.append(
            "the container's edges are not visible, so nothing checks the board's pose"
        )
    return warnings
