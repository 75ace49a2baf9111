"""Looks through wrappers that change nothing for a policy."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from typing import Any

import gymnasium as gym
from gymnasium import wrappers
from gymnasium.vector import VectorEnv, VectorWrapper
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv, VecEnvWrapper, VecMonitor

from curiosity_algos.evaluation.environments import env_attributes, monitors
from curiosity_algos.evaluation.single_vec_env import SingleVecEnv
from curiosity_algos.evaluation.tasks import KnownTask
from curiosity_gym.control.control_env import ControlEnv
from curiosity_gym.control.simulation import Simulation
from curiosity_gym.control.vector_env import ControlVectorEnv
from curiosity_gym.locomotion.locomotion_env import LocomotionEnv
from curiosity_gym.locomotion.simulation import LocomotionSimulation
from curiosity_gym.locomotion.tasks import task_class
from curiosity_gym.locomotion.vector_env import LocomotionVectorEnv
from curiosity_gym.maze.maze_env import MazeEnv
from curiosity_gym.maze.vector_env import MazeVectorEnv
from curiosity_gym.validation import check_at_least_one
from curiosity_gym.wrappers.sparse import time_limit

_TRANSPARENT = (
    Monitor,
    wrappers.HumanRendering,
    wrappers.OrderEnforcing,
    wrappers.PassiveEnvChecker,
    wrappers.TimeLimit,
)
"""Wrappers that change neither dynamics nor rewards nor observations; `max_steps` reads limits."""


SIMULATIONS = {
    MazeEnv: None,
    MazeVectorEnv: None,
    ControlEnv: Simulation,
    ControlVectorEnv: Simulation,
    LocomotionEnv: LocomotionSimulation,
    LocomotionVectorEnv: LocomotionSimulation,
}
"""What simulates the tasks of this package's environments; None: compiled mazes need nothing."""
NORMALIZE = "pass `normalize_observations=True` to an evolution strategy instead"


def as_played(env: Any) -> Any:
    """The environment that evaluators play.

    A DummyVecEnv of one env, or of equal mazes, tasks or robots, becomes its first env. A
    SingleVecEnv becomes its env. A VecMonitor is taken off.

    Raises:
        ValueError: If a wrapper of a whole batch of environments remains.
    """
    vector_env = getattr(env, "vector_env", None)  # of a GymnasiumView, or a GymnasiumVecEnv
    if isinstance(env, VecEnv) and isinstance(vector_env, VectorEnv):
        return as_played(vector_env)
    if isinstance(env, VecMonitor):
        return as_played(env.venv)
    if isinstance(env, VecEnvWrapper | VectorWrapper):
        name = type(env).__name__
        instead = NORMALIZE if "Normalize" in name else "wrap each environment before it is in one"
        raise ValueError(
            f"`env` is wrapped in {name}, which the evaluators cannot see through: {instead}."
        )
    if isinstance(env, SingleVecEnv):
        return env.played
    is_one = type(env) is DummyVecEnv and _are_alike(env.envs)
    return env.envs[0] if is_one else env


def check_constant(env: Any) -> None:
    """Raise ValueError if a wrapper has statistics that change from episode to episode."""
    has_statistics = any(env_attributes(env, name) for name in ("obs_rms", "return_rms"))
    if has_statistics and any(env_attributes(env, "update_running_mean")):
        raise ValueError(
            "`env` must be in no NormalizeObservation or NormalizeReward: the statistics of each "
            "environment change while policies are compared. For observations, "
            f"{NORMALIZE}."
        )


def warn_of_empty_files(env: Any, *, is_compiled: bool) -> None:
    """Warn if a user's Monitor or VecMonitor has a file, and is not stepped."""
    if any(recorder.results_writer is not None for recorder in _bypassed(env, is_compiled)):
        warnings.warn(
            "`env` is in a Monitor or VecMonitor with a file that gets no rows: policies are "
            "played below it. Record the run with SaveRun instead, or read the `infos` of a "
            "callback.",
            stacklevel=2,
        )


def _bypassed(env: Any, is_compiled: bool) -> Iterator[VecMonitor | Monitor]:
    """The Monitors and VecMonitors that an evaluator does not step."""
    while isinstance(env, VecMonitor):
        yield env
        env = env.venv
    envs = [env] if isinstance(env, gym.Env) else getattr(env, "envs", [])
    for one in envs if is_compiled else []:
        yield from monitors(one)


def bare(env: Any) -> Any:
    """The env within wrappers that change nothing, or the first wrapper that changes something."""
    return list(_layers(env))[-1]


def _layers(env: Any) -> Iterator[Any]:
    """The outer wrappers that change nothing, and then what `bare` finds in them."""
    yield env
    while isinstance(env, gym.Wrapper) and type(env) in _TRANSPARENT:
        env = env.env
        yield env


def known_task(env: Any) -> KnownTask | None:
    """The task of an environment; None if it is unknown, or has methods of its own.

    Subclasses, and an assignment such as `env.reset_model = mine`, may change steps and rewards.

    Raises:
        ValueError: If a wrapper has an attribute that the task alone reads, or the horizon is no
            whole number.
    """
    *around, inner = _layers(env)
    make_task = task_class(inner)
    names = {name for layer in (*around, inner) for name in vars(layer)}
    is_changed = any(callable(getattr(type(inner), name, None)) for name in names)
    is_changed |= env.observation_space is not inner.observation_space
    is_changed |= env.action_space is not inner.action_space
    if is_changed or (make_task is None and type(inner) not in SIMULATIONS):
        return None
    _check_reached(around, inner)
    if type(inner) in SIMULATIONS:
        check_at_least_one(horizon=inner.horizon)  # which may be set
        is_maze = SIMULATIONS[type(inner)] is None
        return KnownTask(
            inner.maze if is_maze else inner.task,
            SIMULATIONS[type(inner)],
            inner.coverage_grid if is_maze else None,
            inner.horizon if inner.sparse else None,
            max_steps(env),
        )
    limit = time_limit(env)
    if make_task is None or limit is None or env.render_mode == "human":
        return None
    return KnownTask(make_task(inner, behavior=None), LocomotionSimulation, None, None, limit)


def _check_reached(around: list[Any], inner: Any) -> None:
    """Raise ValueError if a wrapper has an attribute of the env within: nothing reads it there."""
    for wrapper in around:
        for name in vars(wrapper):
            if name in vars(inner) or hasattr(type(inner), name):
                kind, own = type(wrapper).__name__, type(inner).__name__
                raise ValueError(
                    f"`{name}` was set of the {kind} around {own}, which does not read it there: "
                    f"make a new environment, and set `env.unwrapped.{name}`."
                )


def max_steps(env: Any) -> int:
    """Steps after which an episode of a maze or task ends: its horizon, or a lower limit.

    A limit does not change the reward, which knows the horizon alone.
    """
    inner = bare(env)
    own = getattr(inner, "max_episode_steps", None)  # of a vector env, which no TimeLimit fits
    limits: list[int | None] = [inner.horizon, time_limit(env), own]
    return min(limit for limit in limits if limit is not None)


def _are_alike(envs: list[gym.Env[Any, Any]]) -> bool:
    """Whether there is one env, or all are the same maze, task or robot."""
    if len(envs) == 1:
        return True
    first, *others = map(known_task, envs)
    return first is not None and all(map(first.is_same, others))
