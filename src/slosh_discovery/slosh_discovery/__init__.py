"""Accuracy metrics, clock alignment and reports for slosh models."""
