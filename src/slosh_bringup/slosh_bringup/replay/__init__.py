"""Parts of `slosh replay`: bags with manifests, pages, tables, results for CI."""
