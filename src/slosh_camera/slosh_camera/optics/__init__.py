"""Optics of a calibrated camera and a container: lens, pose and refracting walls."""
