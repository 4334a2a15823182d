"""Types of arrays: what every room writes in its signatures."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
Indices = NDArray[np.intp]  # what np.flatnonzero and np.argmin give
