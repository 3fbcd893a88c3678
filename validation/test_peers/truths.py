"""Test liquids whose hidden effect the candidate terms express exactly, and a motion."""

import numpy as np
from scipy.spatial.transform import Rotation

from slosh_model.simulate import Inputs
from validation.blind.truth_model import Truth
from validation.peers.drive import drive_at
from validation.peers.library import true_coefficients

CUP = Truth(0.05, 0.07, damping_ratio=0.02)
CURVED = CUP.plus("surface_nonlinearity", {"alpha": 0.58})
LIFTED = CURVED.plus("vertical_acceleration", {})
HIDDEN = {
    "vertical_acceleration": (CURVED, {}),
    "surface_nonlinearity": (CUP, {"alpha": 0.7}),
    "damping_mismatch": (LIFTED, {"factor": 1.8}),
    "quadratic_damping": (LIFTED, {"beta": 0.2}),
    "contact_line_friction": (LIFTED, {"mu": 0.004}),
    "fill_level": (CUP.plus("vertical_acceleration", {}), {"delta": -0.01}),
    "anisotropic_stiffness": (LIFTED, {"e": 0.05, "axis": 0.7}),
    "yaw_coupling": (CUP, {"kappa": 0.6}),
    "gravity_tilt": (LIFTED, {}),
    "lever_arm": (LIFTED, {"x": 0.1, "y": -0.07, "z": 0.2}),
    "accel_gain": (LIFTED, {"gain": 0.8}),
}


def motion():
    """Returns a motion of 2 s in all directions, with lift, yaw and tilt."""
    t = np.arange(0.0, 2.0, 1.0 / 250.0)
    swell = np.sin(np.pi * t / 2.0) ** 4
    waves = [3.0 * np.sin(17.0 * t), 2.0 * np.cos(15.0 * t), 2.0 * np.sin(24.0 * t)]
    angle = 0.5 - 0.5 * np.cos(np.pi * t)
    zero = np.zeros_like(t)
    spin = Rotation.from_rotvec(np.column_stack([zero, zero, 1.2 * angle]))
    attitude = Rotation.from_rotvec(np.outer(0.1 * angle, [0.6, 0.8, 0.0])) * spin
    return Inputs(t, np.column_stack([swell * wave for wave in waves]), attitude.as_quat())


def truth_of(effect):
    base, parameters = HIDDEN[effect]
    return base, base.plus(effect, parameters)


def coefficients(base, truth, inputs):
    told, own = (drive_at(each, inputs, inputs.t[:1]) for each in (base, truth))
    squared = float(own.squared[0] / told.squared[0])
    return true_coefficients(base, truth, squared, float(own.damping[0] / told.damping[0]))
