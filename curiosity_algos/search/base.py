"""The interface of a search in parameter space."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from curiosity_algos.common.arrays import Float32Array, Float64Array


@runtime_checkable
class Search(Protocol):
    """Asked for parameters, told their fitness, generation by generation."""

    @property
    def center(self) -> npt.NDArray[np.floating[Any]]:
        """The parameters that act while no individual has found a reward, (n_parameters,)."""

    def ask(self) -> Float32Array:
        """A population, shape (P, n_parameters)."""

    def tell(self, fitness: Float64Array) -> None:
        """Learn from the fitness (P,), higher is better, of the last population asked for."""

    def state_dict(self) -> dict[str, Any]:
        """All that a resumed run needs: a tree of arrays, tensors and plain values."""

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave."""


MakeSearch = Callable[[int, np.random.SeedSequence], Search]
"""Makes a search for so many parameters; everything random grows from the seed."""
