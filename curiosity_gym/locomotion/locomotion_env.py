"""One robot of Gymnasium's, with a behavior."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from curiosity_gym.core import Float32Array, Float64Array, FloatArray, Frame
from curiosity_gym.episodic_env import EpisodicEnv
from curiosity_gym.layouts import MazeLayout
from curiosity_gym.locomotion.config import configure_locomotion
from curiosity_gym.locomotion.simulation import LocomotionSimulation


class LocomotionEnv(EpisodicEnv):
    """A MuJoCo environment of Gymnasium, version 5, with a behavior, and with walls if asked for.

    Description:
        Observations, rewards, ends of episodes, infos and every option are Gymnasium's own, bit for
        bit, and said in its documentation:

        ===================================== ================== ============ =======
        Id                                    `env_id`           observations actions
        ===================================== ================== ============ =======
        `CuriosityLocomotion-Ant-v0`          `Ant-v5`           105          8
        `CuriosityLocomotion-HalfCheetah-v0`  `HalfCheetah-v5`   17           6
        `CuriosityLocomotion-Hopper-v0`       `Hopper-v5`        11           3
        `CuriosityLocomotion-Humanoid-v0`     `Humanoid-v5`      348          17
        `CuriosityLocomotion-Swimmer-v0`      `Swimmer-v5`       8            2
        `CuriosityLocomotion-Walker2d-v0`     `Walker2d-v5`      17           6
        `CuriosityLocomotion-AntTrap-v0`      `Ant-v5`           107          8
        `CuriosityLocomotion-AntMaze-v0`      `Ant-v5`           107          8
        `CuriosityLocomotion-HumanoidTrap-v0` `Humanoid-v5`      350          17
        ===================================== ================== ============ =======

        The last three have a world around the robot and a sparse reward, see the arguments. In
        HumanoidTrap falls do not end episodes, which last 2,000 steps.

        `pip install "curiosity-search[locomotion]"` installs what they need.

    Action Space:
        Gymnasium's own. What is beyond it acts as far as it goes, and costs what it costs.

    Observation Space:
        Gymnasium's own, float64.

    Behavior:
        `info["behavior"]`, of `behavior_space`, see the argument. Coverage counts it in 50 cells a
        dimension (`coverage_grid`).

    Rewards:
        Gymnasium's own, unless there is a world, see `sparse`.

    Starting State:
        Gymnasium's own, drawn from `np_random`.

    Episode End:
        Terminated where Gymnasium's own is, and at the goal of a world; truncated after `horizon`
        steps.

    Information:
        Gymnasium's own, `behavior` (B,), float64, and `is_success`, at the goal of a world.

    Args:
        env_id: Gymnasium's environment. The ids give it.
        behavior: "position", where the torso is at last: x (m), and y where the robot can leave its
            plane, within +-30. "feet": the share of the episode's steps at whose end each foot was
            under a force from outside, as in QDax's "uni" tasks; Swimmer has none.
        world: Walls and a goal around Ant or Humanoid: "trap", "small_trap", "maze", a `MazeLayout`
            in meters, or what `CuriosityMaze-v0` takes for one. Observations then begin with x and
            y, with the world's bounds at -1 and 1, and episodes end within 2 m of the goal. None:
            open ground.
        sparse: Reward `1 - t / horizon` in the step t that reaches the goal, and nothing else.
            False: as Gymnasium does, but in a world the speed along x is that towards the goal, as
            the crow flies: deceptive where walls are between.
        horizon: Steps after which an episode is truncated.
        width: Of a frame (pixels).
        height: Of a frame (pixels).
        env_kwargs: Keywords of Gymnasium's environment, but for those of its pictures; None: none.
        render_mode: "rgb_array" or None. `gym.make` also takes "human", and shows these frames in
            Gymnasium's own window.

    Raises:
        ValueError: If an argument is not what it may be.
        gymnasium.error.DependencyNotInstalled: If the extra `locomotion` is not installed.

    Version History:
        * v0: Initial version.
    """

    metadata = {"render_modes": ["rgb_array"]}  # noqa: RUF012

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
        render_mode: str | None = None,
    ) -> None:
        config = configure_locomotion(
            env_id,
            behavior=behavior,
            world=world,
            sparse=sparse,
            horizon=horizon,
            width=width,
            height=height,
            env_kwargs=env_kwargs,
        )
        super().__init__(config, render_mode)
        self.task = config.task
        self.sparse = config.sparse
        self._simulation = LocomotionSimulation(config.task, 1, n_threads=1)

    def _begin(self, options: dict[str, Any] | None) -> None:
        self._simulation.reset(np.arange(1), self._generators())
        self._observation[:] = self._simulation.observations[0]

    def _advance(self, action: Float32Array) -> tuple[bool, bool]:
        ended = bool(self._simulation.step(action[None])[0])
        self._observation[:] = self._simulation.observations[0]
        return ended, bool(self._simulation.success[0])

    def _reward(self, success: bool, t: int) -> float:
        return super()._reward(success, t) if self.sparse else float(self._simulation.rewards[0])

    def _generators(self) -> list[np.random.Generator]:
        return [self.np_random]

    def _info_arrays(self) -> dict[str, Any]:
        return {name: values[0] for name, values in self._simulation.info.items()}

    def _outcome_arrays(self) -> dict[str, Any]:
        return {name: values[0] for name, values in self._simulation.outcome.items()}

    def _physics(self) -> Float64Array:
        physics: Float64Array = self._simulation.state[0]
        return physics

    def _set_physics(self, physics: Float64Array, observation: FloatArray) -> None:
        self._simulation.restore(physics[None])

    def _frame(self) -> Frame:
        frame: Frame = self._viewer.get().draw(self._simulation)
        return frame
