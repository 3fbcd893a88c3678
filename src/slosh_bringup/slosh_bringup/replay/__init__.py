"""Parts of `slosh replay`: tasks, HTML pages, index and results for CI."""
