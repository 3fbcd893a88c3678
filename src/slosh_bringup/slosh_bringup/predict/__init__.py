"""Picture and HTML page of `slosh predict`."""
