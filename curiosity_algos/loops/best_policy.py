"""The best policy of a search so far, and when episodes first had a reward and a success."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from curiosity_algos.common.arrays import Float32Array
from curiosity_algos.evaluation.rollouts import Rollouts
from curiosity_algos.state.check import check_like


class BestPolicy:
    """The individual with the highest return so far.

    Attributes:
        value: Its return; -inf before the first generation.
        seed: Of the reset of its episode; None before the first generation.
        parameters: Its own (n_parameters,); None before the first generation.
        has_reward: Whether any individual had a return other than 0, or succeeded.
    """

    def __init__(self, n_parameters: int) -> None:
        self.n_parameters = n_parameters
        self.value = -math.inf
        self.seed: int | None = None
        self.parameters: Float32Array | None = None
        self.has_reward = False

    def add(self, parameters: Float32Array, rollouts: Rollouts, seed: int) -> None:
        """Take in a generation: parameters (P, n_parameters), and the seed of its episodes."""
        highest = np.flatnonzero(rollouts.returns == rollouts.returns.max())
        best = int(highest[np.argmax(rollouts.success[highest])])
        # A success in the last step pays nothing, and is a find all the same.
        is_first = bool(rollouts.success[best]) and not self.has_reward
        self.has_reward |= is_first or bool(np.any(rollouts.returns))
        value = float(rollouts.returns[best])
        if value > self.value or (is_first and value == self.value):
            self.value, self.seed = value, seed
            self.parameters = parameters[best].copy()

    def state_dict(self) -> dict[str, Any]:
        """All attributes; `parameters` are rows, none before the first generation."""
        rows = np.empty((0, self.n_parameters), np.float32)
        return {
            "value": self.value,
            "seed": self.seed or 0,
            "parameters": rows if self.parameters is None else self.parameters[None].copy(),
            "has_reward": self.has_reward,
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave; ValueError for what that cannot give."""
        check_like(state, BestPolicy(self.n_parameters).state_dict(), "best")
        if len(state["parameters"]) > 1 or math.isnan(state["value"]) or state["seed"] < 0:
            raise ValueError("`best` must be one policy, with its return and a seed.")
        self.parameters, self.seed = None, None
        for row in state["parameters"]:
            self.parameters, self.seed = row.copy(), state["seed"]
        self.value, self.has_reward = state["value"], state["has_reward"]
