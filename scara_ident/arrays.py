"""The type of all arrays of real numbers; docstrings give their shapes."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
