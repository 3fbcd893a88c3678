"""Results of a plan: the page and the document `plan.json`."""
