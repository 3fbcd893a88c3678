"""HTML page with the results of an identification from a measured force."""
