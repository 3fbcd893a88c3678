"""Results of a plan as HTML page and as document `plan.json`."""
