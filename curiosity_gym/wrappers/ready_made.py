"""Tasks of Gymnasium-Robotics and of the DeepMind Control Suite, made sparse."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from curiosity_gym.core import Float64Array, SimulationError
from curiosity_gym.extras import import_extra
from curiosity_gym.validation import check_choice, check_keywords
from curiosity_gym.wrappers.behavior import BehaviorFunction
from curiosity_gym.wrappers.sparse import Observation, SparseRewardWrapper, Success

BareEnv = gym.Env[Any, Any]


class SparseTask(NamedTuple):
    """A task of another package and how `SparseRewardWrapper` makes it sparse.

    `make` makes the original of an id, without a limit on steps; `horizon` is that of the original;
    each reset has the `options`, unless the user gives others.
    """

    make: Callable[..., BareEnv]
    success: Success
    behavior: BehaviorFunction
    behavior_space: Callable[[BareEnv], spaces.Box]
    behavior_names: tuple[str, ...]
    horizon: int
    options: dict[str, Any]


class SparseEnv(gym.Env[Observation, Any]):
    """A task of another package with a sparse reward and a behavior.

    Description:
        The environment in `env`, a `SparseRewardWrapper`, which says what the spaces, the reward
        and the end of an episode are.

    Starting State:
        That of the original environment. In the mazes start and goal are in the two cells farthest
        from each other, unless `env_kwargs` have a `maze_map`. The options `reset_cell` and
        `goal_cell` of `reset` set others, (i, j); None draws one.

    Args:
        env_id: The original environment, a key of `TASKS`. The ids give it.
        horizon: Steps after which an episode is truncated, and the T of the reward `1 - t / T`;
            None: as many as in the original.
        render_mode: "human", "rgb_array", "depth_array", or None.
        env_kwargs: Keywords of the original environment, given to its `gymnasium.make`; None: none.

    Raises:
        ValueError: If `env_id`, `horizon` or `env_kwargs` is not what it may be.
        TypeError: If `env_kwargs` say how many steps there are or how to render.
        gymnasium.error.DependencyNotInstalled: If the extra that the task needs is missing.
    """

    # No wrapper, as Stable-Baselines3 refuses what holds a goal environment's `compute_reward`.
    metadata = {"render_modes": ["human", "rgb_array", "depth_array"]}  # noqa: RUF012

    def __init__(
        self,
        env_id: str,
        *,
        horizon: int | None = None,
        render_mode: str | None = None,
        env_kwargs: dict[str, Any] | None = None,
    ) -> None:
        check_choice(tuple(TASKS), env_id=env_id)
        check_keywords(env_kwargs=env_kwargs)
        env_kwargs = env_kwargs or {}
        task = TASKS[env_id]
        # Python refuses the second of a keyword: a limit on steps would be lost.
        original = task.make(env_id, render_mode=render_mode, max_episode_steps=None, **env_kwargs)
        horizon = task.horizon if horizon is None else horizon
        behavior = task.behavior, task.behavior_space(original), task.behavior_names
        self.env = SparseRewardWrapper(original, task.success, horizon, *behavior)
        self.metadata = {**original.metadata, **self.metadata}
        for name in ("observation_space", "action_space", "behavior_space", "behavior_names"):
            setattr(self, name, getattr(self.env, name))
        self.render_mode = render_mode
        self._options = {} if "maze_map" in env_kwargs else task.options

    @property
    def horizon(self) -> int:
        """Steps after which an episode is truncated."""
        return self.env.horizon

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode; `seed` and `options` are those of the original environment."""
        super().reset(seed=seed)
        return self.env.reset(seed=seed, options={**self._options, **(options or {})})

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """See `SparseRewardWrapper`; errors of the physics are those of the original."""
        return self.env.step(action)

    def render(self) -> Any:
        return self.env.render()

    def close(self) -> None:
        self.env.close()


class _StableMaze(gym.Wrapper[Any, Any, Any, Any]):
    """A maze of Gymnasium-Robotics that does not go on once MuJoCo has reset its simulation."""

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        result = self.env.step(action)
        counts = self.get_wrapper_attr("data").warning.number
        if np.count_nonzero(counts):
            (mujoco,) = import_extra("robotics", "mujoco")
            raise SimulationError.of(mujoco.mjtWarning(int(counts.argmax())))
        return result


def _make_robotics(env_id: str, **kwargs: Any) -> BareEnv:
    import_extra("robotics", "mujoco", "gymnasium_robotics")
    return _StableMaze(gym.make(env_id, **kwargs).unwrapped)


def _make_control(env_id: str, task_kwargs: Any = None, **kwargs: Any) -> BareEnv:
    import_extra("control", "dm_control.suite", "shimmy")
    task_kwargs = {"time_limit": math.inf, **(task_kwargs or {})}
    return gym.make(env_id, task_kwargs=task_kwargs, **kwargs).unwrapped


def _is_at_goal(env: BareEnv, observation: Any, reward: Any, info: dict[str, Any]) -> bool:
    """Within 0.45 m of the goal, in Gymnasium-Robotics' own judgement."""
    return bool(info["success"])


def _is_rewarded(env: BareEnv, observation: Any, reward: Any, info: dict[str, Any]) -> bool:
    """Whether a task that is sparse but pays at every step within the goal begins to pay."""
    return float(reward) > 0.0


def _maze_position(env: BareEnv, observation: Any, info: dict[str, Any]) -> Float64Array:
    """The agent's x and y (m)."""
    return observation["achieved_goal"]


def _maze_bounds(env: BareEnv) -> spaces.Box:
    """The maze's extent, with its outer walls."""
    maze = env.get_wrapper_attr("maze")
    high = np.array([maze.x_map_center, maze.y_map_center])
    return spaces.Box(-high, high, dtype=np.float64)


def _cart_and_pole(env: BareEnv, observation: Any, info: dict[str, Any]) -> Float64Array:
    """The cart's position (m) and the pole's angle from upright (rad)."""
    position, cosine, sine = observation["position"]
    return np.array([position, math.atan2(sine, cosine)])


def _arm_angles(env: BareEnv, observation: Any, info: dict[str, Any]) -> Float64Array:
    """The upper and the lower arm's angles from upright (rad)."""
    sines, cosines = observation["orientations"].reshape(2, 2)
    return np.arctan2(sines, cosines)


def _within(high: tuple[float, ...], env: BareEnv) -> spaces.Box:
    return spaces.Box(-np.array(high), np.array(high), dtype=np.float64)


def _maze(horizon: int, start: tuple[int, int], goal: tuple[int, int]) -> SparseTask:
    """A maze with start and goal in cells, row and column."""
    behavior = _maze_position, _maze_bounds, ("x (m)", "y (m)")
    cells = {"reset_cell": start, "goal_cell": goal}
    return SparseTask(_make_robotics, _is_at_goal, *behavior, horizon, cells)


def _swing_up(behavior: BehaviorFunction, high: float, *names: str) -> SparseTask:
    """A task of the suite, with a bound of its first value; the second is an angle."""
    bounds = partial(_within, (high, math.pi))
    return SparseTask(_make_control, _is_rewarded, behavior, bounds, names, 1000, {})


TASKS = {
    "PointMaze_UMaze-v3": _maze(300, start=(1, 1), goal=(3, 1)),
    "PointMaze_Large-v3": _maze(800, start=(7, 1), goal=(7, 10)),
    "AntMaze_UMaze-v5": _maze(700, start=(1, 1), goal=(3, 1)),
    "dm_control/cartpole-swingup_sparse-v0": _swing_up(
        _cart_and_pole, 2.0, "cart position (m)", "pole angle (rad)"
    ),
    "dm_control/acrobot-swingup_sparse-v0": _swing_up(
        _arm_angles, math.pi, "upper arm angle (rad)", "lower arm angle (rad)"
    ),
}
"""Every task that `SparseEnv` makes, by the id of its original."""
