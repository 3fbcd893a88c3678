"""Topic and service names, relative to the cell's namespace."""

from __future__ import annotations

from typing import Final

NAMESPACE: Final = "/slosh"
"""The default namespace of a cell."""

ACCEL: Final = "accel"
IMU: Final = "imu"
POSE: Final = "pose"
IMAGE: Final = "camera/image_raw"
IMAGE_COMPRESSED: Final = "camera/image_raw/compressed"
CAMERA_INFO: Final = "camera/camera_info"
FREE_SURFACE: Final = "free_surface"
ESTIMATE: Final = "estimate"
EXPECTED_READING: Final = "expected_reading"
"""Of models with effects on the measurement, beside each estimate."""
ESTIMATOR_STATE: Final = "estimator_state"
"""What the estimator's next answers depend on, some times a second."""
COMPARISON: Final = "comparison"
LIMIT_EVENT: Final = "limit_event"
SETTINGS: Final = "settings"
PLANNED_TRAJECTORY: Final = "planned_trajectory"
"""What the robot is about to do, by whoever planned it."""
PREDICTION: Final = "prediction"
PREDICTION_OUTCOME: Final = "prediction_outcome"
DIAGNOSTICS: Final = "/diagnostics"

PREDICT: Final = "predict"
PLAN: Final = "plan"
PLAN_MOTION: Final = "plan_motion"
"""The action: what `plan` does, with feedback and an end at any time."""
LOAD_MODEL: Final = "load_model"
RESET: Final = "reset"

TRUTH: Final = "cell/truth"
"""Exact heights, by the simulated cell alone."""
SUMMARY: Final = "cell/summary"
"""What the simulated cell has published, by topic, as JSON; latched."""
