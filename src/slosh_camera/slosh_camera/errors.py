"""The package's root exception."""


class SloshCameraError(ValueError):
    """A calibration, image or setting that cannot be used; the message says what and where."""
