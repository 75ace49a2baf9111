"""Wrappers that evaluators see through, as they change nothing that a policy meets."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
from gymnasium import wrappers
from gymnasium.vector import VectorEnv, VectorWrapper
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv, VecEnvWrapper, VecMonitor

from curiosity_algos.evaluation.environments import MadeVecEnv
from curiosity_gym.control.control_env import ControlEnv
from curiosity_gym.locomotion.locomotion_env import LocomotionEnv
from curiosity_gym.locomotion.tasks import LocomotionTask, task_class
from curiosity_gym.maze.dynamics import same_maze
from curiosity_gym.maze.maze_env import MazeEnv

_TRANSPARENT = (wrappers.OrderEnforcing, wrappers.PassiveEnvChecker, wrappers.TimeLimit)
"""Wrappers that change neither dynamics nor rewards nor observations; `max_steps` knows limits."""


def without_monitors(env: Any) -> Any:
    """The environment without what Stable-Baselines3 put around it to record episodes.

    A DummyVecEnv whose envs are all the same maze, task or robot, or that holds one, becomes its
    first; so does what an id or a function made.

    Raises:
        ValueError: If a wrapper of a whole batch of environments remains.
    """
    vector_env = getattr(env, "vector_env", None)  # of a GymnasiumView, or a GymnasiumVecEnv
    if isinstance(env, VecEnv) and isinstance(vector_env, VectorEnv):
        return without_monitors(vector_env)
    if isinstance(env, VecMonitor):
        return without_monitors(env.venv)
    if isinstance(env, VecEnvWrapper | VectorWrapper):
        raise ValueError(
            f"`env` is wrapped in {type(env).__name__}, which the evaluators cannot see through: "
            "wrap each environment before it is vectorized instead."
        )
    if isinstance(env, MadeVecEnv) or (type(env) is DummyVecEnv and _are_alike(env.envs)):
        return without_monitors(env.envs[0])
    # What it records is SB3's, not ours.
    return without_monitors(env.env) if isinstance(env, Monitor) else env


def bare(env: Any) -> Any:
    """The env within Gymnasium's wrappers that change nothing, or the first one that does."""
    while isinstance(env, gym.Wrapper) and type(env) in _TRANSPARENT:
        env = env.env
    return env


def is_exactly(env: Any, *classes: type) -> bool:
    """Whether an env is of one of the classes, no subclass, and has all its methods of it."""
    return type(env) in classes and not has_methods_of_its_own(env)


def has_methods_of_its_own(env: Any) -> bool:
    """Whether methods of this one env were replaced, as by `env.reset_model = mine`."""
    return any(callable(getattr(type(env), name, None)) for name in vars(env))


def robot_task(env: Any) -> LocomotionTask | None:
    """The task of one of Gymnasium's own robots, without wrappers; None: it is another env."""
    make_task = task_class(env)
    if make_task is None or has_methods_of_its_own(env):
        return None
    return make_task(env, behavior=None)


def max_steps(env: Any) -> int:
    """Steps after which an episode of a maze or task ends: its horizon, or a lower limit.

    A limit does not change the reward, which knows the horizon alone.
    """
    inner = bare(env)
    own = getattr(inner, "max_episode_steps", None)  # of a vector env, which no TimeLimit fits
    limits: list[int | None] = [inner.horizon, time_limit(env), own]
    return min(limit for limit in limits if limit is not None)


def time_limit(env: Any) -> int | None:
    """Steps after which the lowest TimeLimit around an environment ends episodes; None: none."""
    limits: list[int] = []
    while isinstance(env, gym.Wrapper):
        if isinstance(env, wrappers.TimeLimit):
            limits.append(env._max_episode_steps)
        env = env.env
    return min(limits, default=None)


def _are_alike(envs: list[gym.Env[Any, Any]]) -> bool:
    """Whether one env can stand for all: it is alone, or they are the same maze, task or robot."""
    first, *others = [env.env if isinstance(env, Monitor) else env for env in envs]
    return all(_is_same(first, other) for other in others)


def _is_same(env: Any, other: Any) -> bool:
    one, two = bare(env), bare(other)
    known = MazeEnv, ControlEnv, LocomotionEnv
    if task_class(one) is not None:
        task = robot_task(one)
        return time_limit(env) == time_limit(other) and task is not None and task == robot_task(two)
    if type(one) is not type(two) or not (is_exactly(one, *known) and is_exactly(two, *known)):
        return False
    if one.horizon != two.horizon or max_steps(env) != max_steps(other):
        return False
    if type(one) is LocomotionEnv and one.sparse != two.sparse:
        return False
    return same_maze(one.maze, two.maze) if type(one) is MazeEnv else bool(one.task == two.task)
