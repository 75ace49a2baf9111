"""Many robots of Gymnasium's at once, stepped on threads."""

from __future__ import annotations

import os
from collections.abc import Mapping
from copy import deepcopy
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode

from curiosity_gym.core import Float32Array, Float64Array, FloatArray, Frame, Mask
from curiosity_gym.episodic_vector_env import EpisodicVectorEnv
from curiosity_gym.layouts import MazeLayout
from curiosity_gym.locomotion.config import configure_locomotion
from curiosity_gym.locomotion.locomotion_env import LocomotionEnv
from curiosity_gym.locomotion.simulation import LocomotionSimulation


class LocomotionVectorEnv(EpisodicVectorEnv):
    """`num_envs` episodes; step for step what a `SyncVectorEnv` of `LocomotionEnv` gives.

    `gymnasium.make_vec(id, num_envs=n, vectorization_mode="vector_entry_point")` makes it. There
    is no process an env: threads step them all.

    The other arguments are those of `LocomotionEnv`.

    Args:
        num_envs: Number of episodes side by side.
        autoreset_mode: When an env that ended is reset: an `AutoresetMode` or its value. With
            `DISABLED`, `reset(options={"reset_mask": mask})` does it.
        max_episode_steps: Truncates episodes after so many steps, as the `TimeLimit` of
            `gymnasium.make` does. None or -1: no such limit.
        render_mode: "rgb_array" or None.
        copy: Hand out new arrays each step; False: the observations of a step are overwritten by
            the next.
        n_threads: None: as many as there are processors. Results do not depend on it.

    Raises:
        ValueError: If an argument is not what it may be.
        gymnasium.error.DependencyNotInstalled: If the extra `locomotion` is not installed.
    """

    _single_class = LocomotionEnv

    def __init__(
        self,
        env_id: str | None = None,
        *,
        behavior: str = "position",
        world: MazeLayout | str | os.PathLike[str] | None = None,
        sparse: bool = False,
        horizon: int = 1000,
        width: int = 320,
        height: int = 240,
        env_kwargs: Mapping[str, Any] | None = None,
        num_envs: int = 1,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        copy: bool = True,
        n_threads: int | None = None,
    ) -> None:
        keywords: dict[str, Any] = {
            "behavior": behavior,
            "world": world,
            "sparse": sparse,
            "horizon": horizon,
            "width": width,
            "height": height,
            "env_kwargs": env_kwargs,
        }
        config = configure_locomotion(env_id, **keywords)
        super().__init__(
            config,
            num_envs=num_envs,
            autoreset_mode=autoreset_mode,
            max_episode_steps=max_episode_steps,
            render_mode=render_mode,
            copy=copy,
            draws=True,
        )
        self._keywords = deepcopy({"env_id": env_id, **keywords})
        self.task = config.task
        self.sparse = config.sparse
        self._simulation = LocomotionSimulation(config.task, num_envs, n_threads)
        self._observations = self._simulation.observations

    def _begin(self, mask: Mask, options: dict[str, Any] | None) -> None:
        ids = np.flatnonzero(mask)
        self._simulation.reset(ids, [self._rngs[i] for i in ids])

    def _advance(self, actions: Float32Array, resets: Mask) -> tuple[Mask, Mask]:
        ended = np.zeros(self.num_envs, dtype=np.bool_)
        going = np.flatnonzero(~resets)
        ended[going] = self._simulation.step(actions[going], going)
        if resets.any():
            self._begin(resets, None)
        return ended, self._simulation.success.copy()

    def _rewards(self, success: Mask) -> Float64Array:
        return super()._rewards(success) if self.sparse else self._simulation.rewards.copy()

    def _info_arrays(self) -> dict[str, Any]:
        return self._simulation.info

    def _outcome_arrays(self) -> dict[str, Any]:
        return self._simulation.outcome

    def _physics(self) -> Float64Array:
        return self._simulation.state

    def _set_physics(self, physics: Float64Array, observations: FloatArray) -> None:
        self._simulation.restore(physics)

    def _frames(self) -> tuple[Frame, ...]:
        viewer = self._viewer.get()
        return tuple(viewer.draw(self._simulation, i) for i in range(self.num_envs))
