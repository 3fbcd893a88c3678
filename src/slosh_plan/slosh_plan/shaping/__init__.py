"""Motions that leave no wave of one frequency behind: for machines that run no optimiser."""
