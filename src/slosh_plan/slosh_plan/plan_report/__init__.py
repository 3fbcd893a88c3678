"""A plan for people and programs: the page and the document `plan.json`."""
