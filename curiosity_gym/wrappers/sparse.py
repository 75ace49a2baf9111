"""The reward of this package's environments for any environment."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, SupportsFloat

import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from gymnasium.utils import RecordConstructorArgs
from gymnasium.wrappers import TimeLimit

from curiosity_gym.validation import check_at_least_one
from curiosity_gym.wrappers.behavior import Behavior, BehaviorWrapper

Observation = npt.NDArray[np.float32]
Success = Callable[[gym.Env[Any, Any], Any, SupportsFloat, dict[str, Any]], bool]
"""`success(env, observation, reward, info)`: whether the last step reached the goal."""


class SparseRewardWrapper(gym.Wrapper[Observation, Any, Any, Any], RecordConstructorArgs):
    """Rewards an environment's success alone, once, and the more the sooner it comes.

    Action Space:
        That of `env`; a `Box` of floats is shown as float32, with its bounds. Its actions are
        clipped to the bounds; NaN and infinity are a `ValueError`.

    Observation Space:
        A `Box` of one dimension, float32. One that `env` has already passes as it is; every other
        space is flattened in Gymnasium's own order (`gymnasium.spaces.flatten`) and its bounds are
        carried over:

        * `Dict`: entry after entry in the order of `env.observation_space.keys()`, which is
          alphabetical where the `Dict` was made of a plain dictionary (`gymnasium.spaces.Dict`);
        * `Tuple`: entry after entry;
        * `Box`: row by row (C order); a scalar is one number;
        * `Discrete`, `MultiDiscrete`: one-hot.

    Behavior:
        With `behavior`: `info["behavior"]`, of `behavior_space`, at each reset and step.

    Rewards:
        `1 - t / horizon` on the first step t that is a success, and 0 on every other; the reward of
        `env` is seen by `success` alone.

    Episode End:
        Terminated at the success, or where `env` terminates (a failure, without reward); truncated
        after `horizon` steps, or where `env` truncates before.

    Information:
        That of `env`, `is_success`, and `behavior`.

    Args:
        env: The environment. A `TimeLimit` below `horizon` warns: it would cut every episode.
        success: `success(env, observation, reward, info)`, whether the step that gave them is the
            success; all are of the wrapped environment. It must be pure, and a function of a
            module, if the environment shall be pickled.
        horizon: Steps after which an episode is truncated.
        behavior: As in `BehaviorWrapper`; None: `env` keeps the behavior that it has, if any.
        behavior_space: As there.
        behavior_names: As there.

    Raises:
        ValueError: If an argument is not what it may be, or observations cannot be flattened.
    """

    def __init__(
        self,
        env: gym.Env[Any, Any],
        success: Success,
        horizon: int = 1000,
        behavior: Behavior | None = None,
        behavior_space: spaces.Box | None = None,
        behavior_names: Sequence[str] | None = None,
    ) -> None:
        described: dict[str, Any] = {"behavior": behavior, "behavior_space": behavior_space}
        described["behavior_names"] = behavior_names
        RecordConstructorArgs.__init__(self, success=success, horizon=horizon, **described)
        gym.Wrapper.__init__(self, env)
        if (behavior is None) != (behavior_space is None) or (behavior is None and behavior_names):
            raise ValueError("`behavior` and `behavior_space` must be given together.")
        if not callable(success):
            raise ValueError(f"`success` must be a function, got {success!r}.")
        check_at_least_one(horizon=horizon)
        if (limit := time_limit(env)) is not None and limit < horizon:
            gym.logger.warn(
                f"The TimeLimit of `env` truncates after {limit} steps, before `horizon` = "
                f"{horizon}: make `env` with `max_episode_steps={horizon}`."
            )
        self.horizon = int(horizon)
        self.observation_space = _flat_space(env.observation_space)
        self._is_flat = self.observation_space is env.observation_space
        space = env.action_space
        self._is_clipped = isinstance(space, spaces.Box) and np.issubdtype(space.dtype, np.floating)
        self.action_space = _as_float32(space) if self._is_clipped else space
        self._success = success
        self._played = env
        if behavior is not None and behavior_space is not None:
            self._played = BehaviorWrapper(env, behavior, behavior_space, behavior_names)
            for name in ("behavior_space", "behavior_names", "coverage_grid"):
                setattr(self, name, getattr(self._played, name))
        self._t = 0
        self._is_running = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode; `seed` and `options` are those of the wrapped environment."""
        self._is_running = False
        observation, info = self._played.reset(seed=seed, options=options)
        self._t, self._is_running = 0, True
        return self._flatten(observation), {**info, "is_success": False}

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Take one step.

        An error of `env`, `success` or `behavior` ends the episode.

        Raises:
            ValueError: If action or behavior is not finite, or of another shape than its space.
            gymnasium.error.ResetNeeded: If no episode is under way.
        """
        action = self._check_action(action)
        if not self._is_running:
            raise ResetNeeded("Call reset() before step(): no episode is under way.")
        # Before the step: after an error the state may be one that no episode leads to.
        self._is_running = False
        observation, reward, terminated, truncated, info = self._played.step(action)
        self._t += 1
        is_success = bool(self._success(self.env, observation, reward, info))
        terminated = bool(is_success or terminated)
        truncated = not terminated and bool(truncated or self._t == self.horizon)
        reward = 1.0 - self._t / self.horizon if is_success else 0.0
        flat = self._flatten(observation)
        self._is_running = not (terminated or truncated)
        return flat, reward, terminated, truncated, {**info, "is_success": is_success}

    def _check_action(self, action: Any) -> Any:
        """The action as the wrapped environment takes it."""
        if not self._is_clipped:
            return action
        space: Any = self.env.action_space
        array = np.asarray(action, dtype=space.dtype)
        if array.shape != space.shape or not np.isfinite(array).all():
            raise ValueError(
                f"`action` must be finite numbers of shape {space.shape}, got {action!r}."
            )
        return np.clip(array, space.low, space.high)

    def _flatten(self, observation: Any) -> Observation:
        if self._is_flat:
            return observation
        flat = spaces.flatten(self.env.observation_space, observation)
        return np.asarray(flat, dtype=np.float32)


def time_limit(env: gym.Env[Any, Any]) -> int | None:
    """Steps after which the lowest `TimeLimit` around an environment ends episodes; None: none."""
    limits: list[int] = []
    while isinstance(env, gym.Wrapper):
        if isinstance(env, TimeLimit):
            limits.append(env._max_episode_steps)
        env = env.env
    return min(limits, default=None)


def _flat_space(space: spaces.Space[Any]) -> spaces.Box[np.float32]:
    """The space of flattened observations; the same object where there is nothing to flatten."""
    if isinstance(space, spaces.Box) and len(space.shape) == 1 and space.dtype == np.float32:
        return space
    if not space.is_np_flattenable:
        raise ValueError(f"`env` has observations of no fixed size, which do not flatten: {space}.")
    return _as_float32(spaces.flatten_space(space))


def _as_float32(space: Any) -> spaces.Box[np.float32]:
    with np.errstate(over="ignore"):  # bounds beyond float32's largest become infinite
        low, high = space.low.astype(np.float32), space.high.astype(np.float32)
    return spaces.Box(low, high, dtype=np.float32)
