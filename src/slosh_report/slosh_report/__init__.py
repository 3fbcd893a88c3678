"""Pages: the template, its charts, the page of a run, the index of runs."""
