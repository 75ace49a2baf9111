"""Arrays by the type of their entries, as annotations name them."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from curiosity_gym.core import Float32Array, Float64Array, Mask

__all__ = ["Array", "Float32Array", "Float64Array", "Int64Array", "Mask"]

Array = npt.NDArray[Any]
Int64Array = npt.NDArray[np.int64]
