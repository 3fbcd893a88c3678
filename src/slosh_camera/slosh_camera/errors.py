"""The package's root exception."""


class SloshCameraError(ValueError):
    """A calibration, an image or a setting cannot be used; the message says what and where."""
