"""The picture and the page of `slosh predict`."""
