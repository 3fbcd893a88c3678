"""HTML pages: template, charts, the report of a run, the index of runs."""
