"""HTML pages: template, charts, the page of a run, the index of runs."""
