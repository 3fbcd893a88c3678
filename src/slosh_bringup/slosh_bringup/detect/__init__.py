"""Offline detection: images in, a table and pictures out."""

import os

# Set before NumPy loads, here and in the processes that are started: on matrices of a dozen rows,
# as the detector's, OpenBLAS spends many times the work on waking and awaiting its threads.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
