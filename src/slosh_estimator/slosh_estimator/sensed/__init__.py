"""Liquid heights from a force sensor under the container or from level sensors."""
