"""From recordings to findings: which effect a model of sloshing lacks."""
