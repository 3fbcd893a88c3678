"""Checks by a second source whether a sensor's mounting, scale and signs are right."""
