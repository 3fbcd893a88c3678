"""The root exception of the package."""


class SloshCameraError(ValueError):
    """A calibration, an image or a setting cannot be used; the message says what and where."""
