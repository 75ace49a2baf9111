"""An episode as its start and its actions."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any
from zlib import crc32

import gymnasium as gym
import numpy as np
from gymnasium.envs.registration import EnvSpec

LONGEST = 100_000  # steps of an episode that are recorded; of a longer one no more memory is taken


class RecordEpisode(gym.Wrapper[Any, Any, Any, Any]):
    """Records the open episode, so that another environment of its kind can go on with it.

    An episode is the state of the environment's generator before the reset, and the actions since.
    An environment that draws from `np_random` alone comes to the same step by them, bit for bit.

    Args:
        env: The environment in all of its other wrappers, a Monitor among them.
    """

    def __init__(self, env: gym.Env[Any, Any]) -> None:
        super().__init__(env)
        self._start: Any = None
        self._options: dict[str, Any] | None = None
        self._actions: list[Any] = []
        self._digest = 0
        self._last: dict[str, Any] | None = None

    @property
    def spec(self) -> EnvSpec | None:  # type: ignore[override]  # Gymnasium's own is one, too
        """That of the environment, which recording does not change."""
        return self.env.spec

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        own = getattr(_generator(self), "state", None)
        self._last = {"start": self._start, "options": self._options, "actions": self._actions}
        self._start = own if seed is None else int(seed)
        self._options, self._actions = options, []
        observation, info = self.env.reset(seed=seed, options=options)
        self._digest = crc32(_bytes(observation))
        return observation, info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        if len(self._actions) <= LONGEST:
            self._actions.append(copy.deepcopy(action))
        observation, reward, *ends, info = self.env.step(action)
        self._digest = crc32(_bytes((observation, reward)), self._digest)
        return observation, reward, *ends, info

    def episode_state(self) -> dict[str, Any] | None:
        """The start and the actions of the open episode, as plain values and an array.

        None before the first reset, after more than 100,000 steps, and where actions are no arrays
        or the environment has no generator of numpy's.
        """
        if self._start is None or len(self._actions) > LONGEST or self.action_space.shape is None:
            return None
        shape = (len(self._actions), *self.action_space.shape)
        actions = np.array(self._actions).reshape(shape)
        episode = {"start": self._start, "options": self._options, "actions": actions}
        return {**episode, "digest": self._digest}

    def last_episode(self) -> dict[str, Any] | None:
        """The start, the options and the actions of the episode before the open one, if any.

        None where `episode_state` of it was None.
        """
        last = self._last
        if last is None or last["start"] is None or len(last["actions"]) > LONGEST:
            return None
        return {**last, "actions": np.array(last["actions"])}

    def load_episode_state(self, state: Mapping[str, Any]) -> bool:
        """Go on with the episode of which `episode_state` of an environment like this gave `state`.

        Returns:
            Whether observations and rewards are the same. If they are not, the environment draws
            from elsewhere than `np_random`, remembers other episodes, or was made otherwise.
        """
        seed = state["start"]
        if state["actions"].shape[1:] != self.action_space.shape:
            return False
        if isinstance(seed, dict):
            try:
                _generator(self).state = seed
            except (AttributeError, KeyError, OverflowError, TypeError, ValueError):
                return False  # the generator is of another kind
            seed = None
        self.reset(seed=seed, options=state["options"])
        for action in state["actions"]:
            _, _, terminated, truncated, _ = self.step(action[()])
            if terminated or truncated:
                return False
        return bool(self._digest == state["digest"])

    def begin(self, start: int | Mapping[str, Any]) -> tuple[Any, dict[str, Any]]:
        """Reset with a seed, or with the generator in the state of an episode's `start`."""
        if not isinstance(start, Mapping):
            return self.reset(seed=start)
        _generator(self).state = start
        return self.reset()

    def replay(self, start: int | Mapping[str, Any], actions: Any) -> tuple[Any, float]:
        """Begin an episode and take actions (n, ...): the last observation, and the return.

        The episode may end with the last of them, and not before.
        """
        observation, _ = self.begin(start)
        total = 0.0
        for action in actions:
            observation, reward, *_ = self.step(action)
            total += float(reward)
        return observation, total


def _bytes(value: Any) -> bytes:
    """The bytes of an observation, whatever its space."""
    if isinstance(value, Mapping):
        return b"".join(_bytes(value[key]) for key in sorted(value, key=str))
    if isinstance(value, tuple | list):
        return b"".join(_bytes(entry) for entry in value)
    array = np.asarray(value)
    return repr(value).encode() if array.dtype.hasobject else array.tobytes()


def _generator(env: gym.Env[Any, Any]) -> Any:
    """What holds the state of the generator that an environment draws from; None: not numpy's."""
    random: Any = env.unwrapped.np_random
    # shimmy gives dm_control's, which is of numpy's older kind.
    is_old = isinstance(random, np.random.RandomState)
    return random._bit_generator if is_old else getattr(random, "bit_generator", None)
