"""Finds which effect a sloshing model lacks, from recordings."""
