"""A policy that takes the actions of one episode, whatever it observes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium import spaces
from stable_baselines3.common.policies import BasePolicy

from curiosity_algos.common.arrays import Array
from curiosity_algos.evaluation.flat_spaces import FlatActions, FlatObservations
from curiosity_algos.evaluation.mlp import build_mlp


class OpenLoopPolicy(BasePolicy):
    """Takes the actions of an episode, step by step; after them its last one again.

    `predict` gives the step that it has come to as the state, as a recurrent policy does: pass that
    with the next observation. Without a state it begins anew.

    Args:
        observation_space: See `FlatObservations`.
        action_space: See `FlatActions`; a Box must be bounded.

    Attributes:
        actions: (T, ...), as the environment takes them.
        mlp: Linear policies of the spaces.
    """

    def __init__(
        self, observation_space: spaces.Space[Any], action_space: spaces.Space[Any]
    ) -> None:
        super().__init__(observation_space, action_space)
        self.seen, self.acted = FlatObservations(observation_space), FlatActions(action_space)
        self.mlp = build_mlp(observation_space, action_space, [])
        self._idle = self.acted.taken(self.acted.choose(self.mlp.center[None]))
        self.actions: Array = self._idle[:0]

    def arrays(self) -> dict[str, Any]:
        """What makes the policy again, beside its spaces."""
        return {"actions": self.actions}

    def predict(
        self,
        observation: Any,
        state: tuple[Array, ...] | None = None,
        episode_start: Array | None = None,
        deterministic: bool = False,
    ) -> tuple[Array, tuple[Array, ...] | None]:
        """The next action of each episode, and the steps (n,) that they have come to."""
        is_batch = self.seen.is_batch(observation)
        n = len(self.seen.many(observation)) if is_batch else 1
        steps = np.zeros(n, dtype=np.int64) if state is None else np.array(state[0])
        if episode_start is not None:
            steps[np.asarray(episode_start, dtype=np.bool_)] = 0
        known = self.actions if len(self.actions) else self._idle
        actions = known[np.minimum(steps, len(known) - 1)]
        return actions if is_batch else actions[0][()], (steps + 1,)

    def _predict(self, observation: Any, deterministic: bool = False) -> Any:
        raise NotImplementedError  # `predict` asks no network

    def state_dict(self, *args: Any, **kwargs: Any) -> dict[str, Any]:  # type: ignore[override]
        """The actions."""
        return self.arrays()

    def load_state_dict(self, state: Mapping[str, Any], *args: Any, **kwargs: Any) -> None:  # type: ignore[override]
        """Take over what `state_dict` gave; ValueError for actions of another environment."""
        actions = state["actions"]
        if actions.shape[1:] != self._idle.shape[1:] or actions.dtype != self._idle.dtype:
            raise ValueError("`actions` must be of the environment's action space.")
        self.actions = actions.copy()
