"""What every exploration bonus does, whichever algorithm holds it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
import torch as th
from gymnasium import spaces


class Bonus(Protocol):
    """Scores transitions, high where few like them were seen, and learns from them."""

    def score(
        self,
        observations: npt.NDArray[np.float32],
        actions: npt.NDArray[Any],
        next_observations: npt.NDArray[np.float32],
    ) -> npt.NDArray[np.float32]:
        """Bonus of each transition, shape (n,)."""
        ...

    def score_trajectory(
        self, observations: npt.NDArray[np.float32], actions: npt.NDArray[Any]
    ) -> npt.NDArray[np.float32]:
        """Bonus of each of the T transitions among T + 1 consecutive observations, shape (T,)."""
        ...

    def observe(self, observations: th.Tensor) -> None:
        """Take observations (n, O) that entered the buffer into the running statistics."""
        ...

    def update(
        self, observations: th.Tensor, actions: th.Tensor, next_observations: th.Tensor
    ) -> Mapping[str, float]:
        """One gradient step on a batch; the losses before it."""
        ...

    def state_dict(self) -> dict[str, Any]:
        """Everything that a resumed run needs: weights, optimizer, statistics."""
        ...

    def load_state_dict(self, state: Mapping[str, Any], strict: bool = True) -> Any:
        """Take over what `state_dict` gave."""
        ...


def action_size(action_space: spaces.Space[Any]) -> int:
    """Numbers that encode one action: a Box's entries, or a one-hot of a Discrete's."""
    if isinstance(action_space, spaces.Discrete):
        return int(action_space.n)
    assert isinstance(action_space, spaces.Box)
    return int(np.prod(action_space.shape))
