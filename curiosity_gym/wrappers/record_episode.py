"""An episode as its start and its actions."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.envs.registration import EnvSpec

LONGEST = 100_000
"""Steps of an episode that are recorded; of a longer one no more memory is taken."""


class RecordEpisode(gym.Wrapper[Any, Any, Any, Any]):
    """Records the open episode, so that another environment of its kind can go on with it.

    An episode is the state of the environment's generator before the reset, and the actions since.
    An environment that draws from `np_random` alone comes to the same step by them, bit for bit.
    Runs of `curiosity train` record their episodes.

    Args:
        env: The environment in all of its other wrappers, a Monitor among them.

    Example:
        ::

            env = RecordEpisode(gym.make("Ant-v5"))
            env.reset(seed=0)
            env.step(env.action_space.sample())
            other = RecordEpisode(gym.make("Ant-v5"))
            other.load_episode_state(env.episode_state())  # stands where `env` does
    """

    def __init__(self, env: gym.Env[Any, Any]) -> None:
        super().__init__(env)
        self._start: Any = None
        self._options: dict[str, Any] | None = None
        self._actions: list[Any] = []
        self._observation: Any = None

    @property
    def spec(self) -> EnvSpec | None:  # type: ignore[override]  # Gymnasium's own is one, too
        """That of the environment, which recording does not change."""
        return self.env.spec

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode; see the wrapped environment."""
        self._start = _generator(self).state if seed is None else int(seed)
        self._options, self._actions = options, []
        self._observation, info = self.env.reset(seed=seed, options=options)
        return self._observation, info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Take one step; see the wrapped environment."""
        if len(self._actions) <= LONGEST:
            self._actions.append(np.array(action))
        self._observation, *outcome = self.env.step(action)
        return self._observation, *outcome

    def episode_state(self) -> dict[str, Any] | None:
        """The start and the actions of the open episode, as plain values and an array.

        None before the first reset, after more than 100,000 steps, and where actions are no
        numbers.
        """
        actions = np.array(self._actions)
        if self._start is None or len(actions) > LONGEST or actions.dtype.kind not in "iufb":
            return None
        start = {"start": self._start, "options": self._options, "actions": actions}
        return {**start, "observation": self._digest()}

    def load_episode_state(self, state: Mapping[str, Any]) -> bool:
        """Go on with the episode that `episode_state` gave, in this environment.

        Args:
            state: Of an environment that was made as this one.

        Returns:
            Whether the last observation is the same. If it is not, the environment draws from
            elsewhere than `np_random`, or was made otherwise.

        Raises:
            ValueError: If `episode_state` gives no such state.
        """
        _check(state)
        seed, actions = state["start"], state["actions"]
        if len(actions) and actions.shape[1:] != self.action_space.shape:
            return False
        if isinstance(seed, dict):
            if seed.get("bit_generator") != _generator(self).state["bit_generator"]:
                return False
            _load_generator(_generator(self), seed)
            seed = None
        self.reset(seed=seed, options=state["options"])
        for action in actions:
            _, _, terminated, truncated, _ = self.step(action[()])
            if terminated or truncated:
                return False
        return bool(self._digest() == state["observation"])

    def _digest(self) -> str:
        """A digest of the last observation, whatever the space."""
        text = json.dumps(self.observation_space.to_jsonable([self._observation]))
        return hashlib.sha256(text.encode()).hexdigest()


def _check(state: Mapping[str, Any]) -> None:
    kinds = {"start": int | dict, "options": dict | None, "actions": np.ndarray, "observation": str}
    if state.keys() != kinds.keys() or not all(isinstance(state[k], kinds[k]) for k in kinds):
        raise ValueError(f"`state` must have {', '.join(kinds)}, as episode_state() gives them.")


def _load_generator(generator: Any, state: dict[str, Any]) -> None:
    try:
        generator.state = state
    except (KeyError, OverflowError, TypeError, ValueError) as error:
        raise ValueError("`state` must start with the state of a generator of numpy.") from error


def _generator(env: gym.Env[Any, Any]) -> Any:
    """What holds the state of the generator that an environment draws from."""
    random: Any = env.unwrapped.np_random
    # shimmy gives dm_control's, which is of numpy's older kind.
    is_old = isinstance(random, np.random.RandomState)
    return random._bit_generator if is_old else random.bit_generator
