"""Many episodes of a control task at once, stepped by MuJoCo's own batch and threads."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode

from curiosity_gym.control.config import configure_control
from curiosity_gym.control.control_env import ControlEnv
from curiosity_gym.control.simulation import Simulation
from curiosity_gym.core import Float32Array, Float64Array, FloatArray, Frame, Mask
from curiosity_gym.episodic_vector_env import EpisodicVectorEnv


class ControlVectorEnv(EpisodicVectorEnv):
    """`num_envs` episodes; step for step what a `SyncVectorEnv` of `ControlEnv` gives.

    `gymnasium.make_vec(id, num_envs=n, vectorization_mode="vector_entry_point")` makes it. There
    is no process an env: MuJoCo's threads step them all.

    The other arguments are those of `ControlEnv`.

    Args:
        num_envs: Number of episodes side by side.
        autoreset_mode: When an env that ended is reset: an `AutoresetMode` or its value. With
            `DISABLED`, `reset(options={"reset_mask": mask})` does it.
        max_episode_steps: Truncates episodes after so many steps, as the `TimeLimit` of
            `gymnasium.make` does; the reward stays that of the horizon. None or -1: no such limit.
        render_mode: "rgb_array" or None.
        copy: Hand out new arrays each step; False: the observations of a step are overwritten by
            the next.
        n_threads: None: as many as there are processors. Results do not depend on it.

    Raises:
        ValueError: If an argument is not what it may be.
        TypeError: If `success_threshold` is given for another task than stacker.
        gymnasium.error.DependencyNotInstalled: If the extra `control` is not installed.
    """

    _single_class = ControlEnv

    def __init__(
        self,
        task: str | None = None,
        *,
        horizon: int = 1000,
        width: int = 320,
        height: int = 240,
        success_threshold: float | None = None,
        random_start: bool = False,
        num_envs: int = 1,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        copy: bool = True,
        n_threads: int | None = None,
    ) -> None:
        keywords: dict[str, Any] = {
            "horizon": horizon,
            "width": width,
            "height": height,
            "success_threshold": success_threshold,
            "random_start": random_start,
        }
        config = configure_control(task, **keywords)
        super().__init__(
            config,
            num_envs=num_envs,
            autoreset_mode=autoreset_mode,
            max_episode_steps=max_episode_steps,
            render_mode=render_mode,
            copy=copy,
            draws=config.task.random_start,
        )
        self._keywords = {"task": task, **keywords}
        self.task = config.task
        self._simulation = Simulation(config.task, num_envs, n_threads)
        self._observations = self._simulation.observations

    def _begin(self, mask: Mask, options: dict[str, Any] | None) -> None:
        ids = np.flatnonzero(mask)
        self._simulation.reset(ids, [self._rngs[i] for i in ids] if self._rngs else ())

    def _advance(self, actions: Float32Array, resets: Mask) -> tuple[Mask, Mask]:
        success = np.zeros(self.num_envs, dtype=np.bool_)
        going = np.flatnonzero(~resets)
        success[going] = self._simulation.step(actions[going], going)
        if resets.any():
            self._begin(resets, None)
        return success, success

    def _info_arrays(self) -> dict[str, Float64Array]:
        return {"behavior": self._simulation.behaviors}

    def _physics(self) -> Float64Array:
        return self._simulation.state

    def _set_physics(self, physics: Float64Array, observations: FloatArray) -> None:
        self._simulation.restore(physics)

    def _frames(self) -> tuple[Frame, ...]:
        viewer = self._viewer.get()
        return tuple(viewer.draw(self._simulation, i) for i in range(self.num_envs))
