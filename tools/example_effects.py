"""Lists every modelled effect with parameters that clearly change the heights, for tests."""

from __future__ import annotations

from dataclasses import replace

from slosh_model.effects.registry import EFFECTS
from slosh_model.model import Model
from slosh_model.shapes.rectangle import Rectangle

STRENGTHS: dict[str, dict[str, float]] = {
    "vertical_acceleration": {},
    "surface_nonlinearity": {"alpha": 0.7},
    "pendulum_nonlinearity": {},
    "second_mode": {"damping_ratio": 0.03},
    "quasi_static_modes": {"kappa": 0.9},
    "damping_mismatch": {"factor": 3.0},
    "quadratic_damping": {"beta": 2.0},
    "contact_line_friction": {"mu": 0.02},
    "fill_level": {"delta": -0.03},
    "frequency_mismatch": {"factor": 0.97},
    "fill_loss": {"rate": 0.01, "fixed_zero": 1.0},
    "anisotropic_stiffness": {"e": 0.1, "axis": 0.4},
    "yaw_coupling": {"kappa": 0.5},
    "gravity_tilt": {},
    "static_tilt": {"roll": 0.03, "pitch": -0.02},
    "lever_arm": {"x": 0.1, "y": -0.05, "z": 0.2},
    "robot_dynamics": {"frequency": 40.0, "damping_ratio": 0.6},
    "accel_gain": {"gain": 1.3},
    "time_offset": {"tau": 0.04},
    "clock_drift": {"rate": 0.015, "offset": 0.02},
    "height_scale": {"gain": 1.2},
    "height_offset": {"offset": 0.003},
    "frame_saturation": {"cap": 0.004},
    "visible_arc": {"centre": 0.5, "width": 1.0},
    "crest_asymmetry": {"kappa": 0.6},
    "surface_tension": {"tension": 4e-4},
    "swirl_stiffening": {"gamma": 2.0},
    "amplitude_stiffening": {"kappa": 2.0},
    "amplitude_damping": {"gamma": 30.0},
    "bound_modes": {"kappa": 1.2, "damping_ratio": 0.05},
    "sensor_lag": {"time": 0.02},
    "sensor_tilt": {"e_x": 0.03, "e_y": -0.02},
    "draining_film": {"speed": 0.02},
}


def in_fitting_container(model: Model, name: str) -> Model:
    """Returns the model, in a rectangular tank if the effect applies only to rectangles."""
    if EFFECTS[name].fits(model.container.section):
        return model
    tank = Rectangle(0.1, 0.08, model.container.fill_height)
    return replace(model.linear(), container=tank, limits=tank.validated)
