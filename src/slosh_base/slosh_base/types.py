"""NumPy array types by element type."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Floating-point numbers."""
Integers = NDArray[np.int64]
"""Whole numbers: indices, counts, stamps [ns]."""
BoolArray = NDArray[np.bool_]
"""Yes or no for each element."""
