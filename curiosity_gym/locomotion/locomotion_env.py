"""One robot of Gymnasium's, with a behavior."""

from __future__ import annotations

import copy
import os
from collections.abc import Mapping
from contextlib import closing
from functools import partial
from typing import Any

from gymnasium.envs.registration import load_env_creator

from curiosity_gym.episodic_env import EpisodicEnv
from curiosity_gym.episodic_vector_env import EpisodicVectorEnv
from curiosity_gym.extras import import_extra
from curiosity_gym.layouts import MazeLayout
from curiosity_gym.locomotion.simulation import LocomotionSimulation
from curiosity_gym.locomotion.tasks import BEHAVIORS, TASKS, LocomotionTask
from curiosity_gym.locomotion.worlds import World
from curiosity_gym.mujoco_viewer import MujocoViewer
from curiosity_gym.validation import check_at_least_one, check_bool, check_choice, check_keywords


class LocomotionEnv(EpisodicEnv):
    """A MuJoCo environment of Gymnasium, version 5, with a behavior, and with walls if asked for.

    Description:
        Observations (float64), starts, rewards, infos and every option are Gymnasium's own, bit for
        bit, and said in its documentation. Actions beyond their space act as far as it goes, and
        cost what they cost.

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

    Behavior:
        `info["behavior"]`, of `behavior_space`, see the argument. Coverage counts it in 50 cells a
        dimension (`coverage_grid`).

    Episode End:
        Terminated where Gymnasium's own is, and at the goal of a world; truncated after `horizon`
        steps.

    Information:
        Gymnasium's own, `behavior` (B,), float64, and `is_success`, at the goal of a world.

    Args:
        env_id: Gymnasium's environment. The ids give it.
        behavior: "position", where the torso is at last: x (m), and y where the robot can leave its
            plane, within +-30 or the bounds of the world. "feet": the share of the episode's steps
            at whose end each foot was under a force from outside, as in QDax's "uni" tasks; Swimmer
            has none.
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
        env_kwargs: Keywords of Gymnasium's environment, but for `render_mode`; None: none. What is
            wrong with them, Gymnasium says.
        render_mode: "rgb_array" or None; `gym.make` also takes "human", and opens a window.

    Raises:
        ValueError: If an argument is not what it may be.
        gymnasium.error.DependencyNotInstalled: If the extra `locomotion` is not installed.
    """

    settings = ("env_id", "task", "behavior", "world", "layout", "env_kwargs", "width", "height")

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
        check_choice(tuple(TASKS), env_id=env_id)
        check_choice(BEHAVIORS, behavior=behavior)
        check_keywords(env_kwargs=env_kwargs)
        check_bool(sparse=sparse)
        if sparse and world is None:
            raise ValueError("`sparse` must be False where there is no `world`, and so no goal.")
        check_at_least_one(horizon=horizon, width=width, height=height)
        assert env_id is not None
        walls = None if world is None else World(world)
        self.task = _make_task(env_id, env_kwargs, behavior=behavior, world=walls)
        self.layout = None if self.task.world is None else self.task.world.layout
        size = {"width": int(width), "height": int(height)}
        super().__init__(
            LocomotionSimulation(self.task, 1, n_threads=1),
            horizon=horizon,
            render_mode=render_mode,
            make_viewer=partial(MujocoViewer, self.task.model, **size),
            sparse=sparse,
        )


def _make_task(
    env_id: str, env_kwargs: Mapping[str, Any] | None, **keywords: Any
) -> LocomotionTask:
    import_extra("locomotion", "mujoco", "imageio")
    # Of Gymnasium's own class: anybody can register another by its id.
    make: Any = load_env_creator(TASKS[env_id].entry_point)
    # Python refuses the second of a keyword.
    with closing(make(render_mode=None, **copy.deepcopy(env_kwargs or {}))) as original:
        return TASKS[env_id](original, **keywords)


class LocomotionVectorEnv(EpisodicVectorEnv):
    """An `EpisodicVectorEnv` of `LocomotionEnv`; threads step them all."""

    task: LocomotionTask
    single_class = LocomotionEnv
    settings = LocomotionEnv.settings
