"""Optics of a calibrated camera and a container: lens, pose, refracting walls."""
