"""The root exception of the package."""


class SloshCameraError(ValueError):
    """Error of an unusable calibration, image or setting; the message says what and where."""
