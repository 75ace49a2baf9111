"""The base of this package's vector environments: episodes, rewards, autoreset, infos."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from gymnasium.wrappers import TimeLimit

from curiosity_gym.core import CoverageGrid, Float32Array, Float64Array, FloatArray, Frame, Mask
from curiosity_gym.episodic_env import EpisodicEnv
from curiosity_gym.fixed import COMMON, FixedSettings
from curiosity_gym.validation import as_float32, check_at_least_one, check_render_mode, check_seed


class EpisodicVectorEnv(FixedSettings, VectorEnv[FloatArray, Float32Array, Mask]):
    """`num_envs` episodes; step for step what a `SyncVectorEnv` of the single envs gives.

    `gymnasium.make_vec(id, num_envs=n, vectorization_mode="vector_entry_point")` makes it. The
    other arguments are those of the single environment, whose settings are attributes here, too.

    Args:
        num_envs: Number of episodes side by side.
        autoreset_mode: When an env that ended is reset: an `AutoresetMode` or its value. With
            `DISABLED`, `reset(options={"reset_mask": mask})` does it.
        max_episode_steps: Truncates episodes after so many steps, as the `TimeLimit` of
            `gymnasium.make` does; a sparse reward stays that of the horizon. None: no such limit.
        render_mode: "rgb_array" or None.
        copy: Hand out new arrays each step; False: the observations of a step are overwritten by
            the next.
        n_threads: None: as many as there are processors. Results do not depend on it.

    Raises:
        ValueError: If an argument is not what it may be; as the single environment.
    """

    behavior_space: spaces.Box[np.float64]
    behavior_names: tuple[str, ...]
    coverage_grid: CoverageGrid
    horizon: int
    sparse: bool
    single_class: ClassVar[Callable[..., EpisodicEnv]]

    def __init__(
        self,
        *args: Any,
        num_envs: int = 1,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        copy: bool = True,
        n_threads: int | None = None,
        **keywords: Any,
    ) -> None:
        check_at_least_one(num_envs=num_envs)
        num_envs = int(num_envs)  # one of numpy may have no room for what is counted with it
        if max_episode_steps is not None:
            check_at_least_one(max_episode_steps=max_episode_steps)
            max_episode_steps = int(max_episode_steps)
        check_render_mode(render_mode=render_mode)
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self._single = single = type(self).single_class(*args, **keywords)
        self.simulation = single.simulation.replicate(num_envs, n_threads)
        self.num_envs = num_envs
        for name in {"behavior_names", "horizon", *COMMON, *self.settings} & vars(single).keys():
            setattr(self, name, vars(single)[name])
        self.single_observation_space = single.observation_space
        self.single_action_space = single.action_space
        self.observation_space = batch_space(single.observation_space, num_envs)
        self.action_space = batch_space(single.action_space, num_envs)
        self.max_episode_steps = max_episode_steps
        self.metadata = {**single.metadata, "autoreset_mode": self.autoreset_mode}
        self.render_mode = render_mode
        self.copy = copy
        self._steps = np.full(num_envs, -1)  # no episodes yet
        self._ended = np.zeros(num_envs, dtype=np.bool_)
        draws = self.simulation.draws
        self._rngs = [seeding.np_random()[0] for _ in range(num_envs)] if draws else []

    def _check_ready(self, method: str) -> None:
        """Raise unless every env has an episode, under way or just ended."""
        if not (self._steps >= 0).all():
            raise ResetNeeded(f"Call reset() before {method}(): an env has no episode.")

    def make_single_env(self) -> gym.Env[FloatArray, Float32Array]:
        """A single env that gives, step for step, what each of these gives."""
        env = deepcopy(self._single)
        return env if self.max_episode_steps is None else TimeLimit(env, self.max_episode_steps)

    # -- episodes ---------------------------------------------------------------------------------

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[FloatArray, dict[str, Any]]:
        """Begin episodes.

        Args:
            seed: As in Gymnasium: one for each env, None to leave its generator as it is, or an int
                for the first, from which the others' count up.
            options: `reset_mask`: (num_envs,) bool, the envs to reset, None: all; and the options
                of a single env.

        Raises:
            ValueError: If a seed or an option is not what it may be.
        """
        seeds = self._seeds(seed)
        mask = self._reset_mask(options)
        super().reset(seed=int(seed) if isinstance(seed, int | np.integer) else None)
        for i in np.flatnonzero(mask).tolist() if self._rngs else ():
            if (own := seeds[i]) is not None:
                self._rngs[i] = seeding.np_random(own)[0]
        self._begin(mask, options)
        return self._handed_out(), self._infos(mask)

    def _seeds(self, seed: int | Sequence[int | None] | None) -> list[int | None]:
        """The seed of each env."""
        if isinstance(seed, int | np.integer):
            check_seed(seed)
            return [int(seed) + i for i in range(self.num_envs)]
        seeds = [None] * self.num_envs if seed is None else list(seed)
        for own in seeds:
            check_seed(own)
        if len(seeds) != self.num_envs:
            raise ValueError(f"`seed` must hold {self.num_envs} seeds, one an env, got {seed!r}.")
        return [None if own is None else int(own) for own in seeds]

    def _reset_mask(self, options: dict[str, Any] | None) -> Mask:
        mask = None if options is None else options.get("reset_mask")
        if mask is None:
            return np.ones(self.num_envs, dtype=np.bool_)
        mask = np.asarray(mask)
        if mask.dtype != np.bool_ or mask.shape != (self.num_envs,) or not mask.any():
            raise ValueError(
                f'`options["reset_mask"]` must be a bool array of shape ({self.num_envs},) with at '
                "least one True."
            )
        return mask

    def _begin(self, mask: Mask, options: dict[str, Any] | None = None) -> None:
        ids = np.flatnonzero(mask)
        self.simulation.reset(ids, [self._rngs[i] for i in ids] if self._rngs else (), options)
        self._steps[mask] = 0
        self._ended = self._ended & ~mask

    def step(  # type: ignore[override]
        self, actions: Float32Array
    ) -> tuple[FloatArray, Float64Array, Mask, Mask, dict[str, Any]]:
        """Step every env once, by actions (num_envs, A), rounded to float32; see `EpisodicEnv`.

        Raises:
            ValueError: If the actions are not (num_envs, A) finite numbers.
            gymnasium.error.ResetNeeded: Before the first reset, and with autoreset disabled while
                an env has ended.
            SimulationError: If the physics became unstable; every env needs a reset then.
        """
        actions = np.ascontiguousarray(as_float32(actions))
        if actions.shape != self.action_space.shape or not np.isfinite(actions).all():
            raise ValueError(f"`actions` must be finite, of shape {self.action_space.shape}.")
        self._check_ready("step")
        if self.autoreset_mode == AutoresetMode.DISABLED and self._ended.any():
            raise ResetNeeded("Call reset() before step(): an env's episode has ended.")
        resets, steps = self._ended, self._steps
        self._steps = np.full(self.num_envs, -1)  # all need a reset, should the physics fail midway
        terminated = self.simulation.advance(actions, resets, self._rngs)
        self._steps = np.where(resets, 0, steps + 1)
        truncated: Mask = ~terminated & (self._steps >= self.horizon)
        # A `TimeLimit` truncates a step that terminates, too.
        if self.max_episode_steps is not None:
            truncated |= self._steps >= self.max_episode_steps
        rewards = self._rewards()
        self._ended = terminated | truncated
        is_reset_now = self.autoreset_mode == AutoresetMode.SAME_STEP and self._ended.any()
        finals = self._reset_ended() if is_reset_now else {}
        infos = {**finals, **self._infos(np.ones(self.num_envs, dtype=np.bool_))}
        return self._handed_out(), rewards, terminated, truncated, infos

    def _rewards(self) -> Float64Array:
        if not self.sparse:
            return self.simulation.rewards.copy()
        return np.where(self.simulation.success, 1.0 - self._steps / self.horizon, 0.0)

    def _handed_out(self) -> FloatArray:
        observations = self.simulation.observations
        return observations.copy() if self.copy else observations

    def _reset_ended(self) -> dict[str, Any]:
        """Reset what ended; the final observations and infos, for the infos."""
        ended = self._ended
        final_obs = np.full(self.num_envs, None, dtype=object)
        for i in np.flatnonzero(ended):
            final_obs[i] = self.simulation.observations[i].copy()
        final_info = self._infos(ended)
        self._begin(ended)
        finals = {"final_obs": final_obs, "final_info": final_info}
        return finals | {f"_{name}": ended.copy() for name in finals}

    def _infos(self, mask: Mask) -> dict[str, Any]:
        """Infos of the envs of `mask`, as Gymnasium gives them; of a last step if there was one."""
        parts = [({**self.simulation.info, "is_success": self.simulation.success.copy()}, mask)]
        stepped = mask & (self._steps > 0)
        if stepped.any():
            parts.append((self.simulation.outcome, stepped))
        infos: dict[str, Any] = {}
        for values, has in parts:
            for key, value in values.items():
                if not has.all():
                    value[~has] = np.zeros((), value.dtype)  # the arrays are new
                infos[key], infos[f"_{key}"] = value, has.copy()
        return infos

    # -- exact resume -----------------------------------------------------------------------------

    def state_dict(self) -> dict[str, Any]:
        """The episodes as they stand, under way or just ended, for `load_state_dict`.

        Returns:
            New arrays. `steps`, (num_envs,) int64, taken; `ended`, (num_envs,) bool, which envs
            have ended and not begun anew; `observations`, the last, (num_envs, O); `physics`,
            (num_envs, S) float64. And `generators`, the state of each env's, if starts are random.

        Raises:
            gymnasium.error.ResetNeeded: Before the first reset, and after the physics failed.
        """
        self._check_ready("state_dict")
        return {
            **self._snapshot(),
            "generators": [rng.bit_generator.state for rng in self._rngs],
        }

    def _snapshot(self) -> dict[str, Any]:
        return {
            "steps": self._steps.copy(),
            "ended": self._ended.copy(),
            "observations": self.simulation.observations.copy(),
            "physics": self.simulation.state,
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Go on, bit for bit, from what an environment of the same keywords but threads gave.

        Raises:
            ValueError: If it is not a state of such an environment; nothing has changed then.
        """
        own = {key: _like(key, state[key], like) for key, like in self._snapshot().items()}
        longest = min(self.horizon, self.max_episode_steps or self.horizon)
        if ((own["steps"] < 0) | (own["steps"] - own["ended"] >= longest)).any():
            raise ValueError(f"`state` must be of episodes of at most {longest} steps.")
        if len(state["generators"]) != len(self._rngs):
            raise ValueError(f"`state` must have {len(self._rngs)} generators.")
        rngs = [np.random.Generator(np.random.PCG64()) for _ in self._rngs]
        for rng, generator in zip(rngs, state["generators"], strict=True):
            rng.bit_generator.state = generator
        self.simulation.restore(own["physics"], own["observations"])
        self._steps, self._ended, self._rngs = own["steps"], own["ended"], rngs

    # -- pictures ---------------------------------------------------------------------------------

    def render(self) -> tuple[Frame, ...] | None:
        """A frame (height, width, 3) of each env for "rgb_array"."""
        if self.render_mode is None:
            gym.logger.warn("render() needs a render_mode: make the env with one.")
            return None
        self._check_ready("render")
        viewer = self._single.viewer
        return tuple(self.simulation.draw(viewer, i) for i in range(self.num_envs))

    def close_extras(self, **kwargs: Any) -> None:
        """Close the viewer, if there is one."""
        self._single.close()


def _like(key: str, value: Any, like: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """An entry of a state as a new array, which must be as the env's own is."""
    array = np.array(value, order="C")
    is_alike = array.shape == like.shape and array.dtype == like.dtype
    if not is_alike or not np.isfinite(array).all():
        raise ValueError(
            f"`state` must be of the same environment: its {key} must be finite, {like.dtype}, of "
            f"shape {like.shape}."
        )
    return array
