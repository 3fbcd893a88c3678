"""The ROS nodes of this package."""

import os

# Set before NumPy loads: on matrices of a dozen rows, as the detector's, OpenBLAS spends many
# times the work on waking and awaiting its threads.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
