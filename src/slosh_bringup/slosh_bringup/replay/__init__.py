"""Below `slosh replay`: bags and what their manifests state, pages, tables, results for a CI."""
