"""Finds which physical effect a sloshing model lacks, from recordings."""
