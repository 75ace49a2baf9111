"""Looks through wrappers that change nothing for a policy."""

from __future__ import annotations

import warnings
from typing import Any

import gymnasium as gym
from gymnasium import wrappers
from gymnasium.vector import VectorEnv, VectorWrapper
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv, VecEnvWrapper, VecMonitor

from curiosity_algos.evaluation.base import KnownTask
from curiosity_algos.evaluation.environments import SingleVecEnv, env_attributes, monitors
from curiosity_gym.control.control_env import ControlEnv, ControlVectorEnv
from curiosity_gym.control.simulation import Simulation
from curiosity_gym.locomotion.locomotion_env import LocomotionEnv, LocomotionVectorEnv
from curiosity_gym.locomotion.simulation import LocomotionSimulation
from curiosity_gym.locomotion.tasks import task_class
from curiosity_gym.maze.maze_env import MazeEnv, MazeVectorEnv
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
    """Warn if a VecMonitor, or a Monitor of an environment that is not stepped, has a file."""
    recorders: list[VecMonitor | Monitor] = []
    while isinstance(env, VecMonitor):
        recorders.append(env)
        env = env.venv
    for one in [env] if isinstance(env, gym.Env) else getattr(env, "envs", []):
        recorders += monitors(one) if is_compiled else []
    if any(recorder.results_writer is not None for recorder in recorders):
        warnings.warn(
            "`env` is in a Monitor or VecMonitor with a file that gets no rows: policies are "
            "played below it. Record the run with SaveRun instead, or read the `infos` of a "
            "callback.",
            stacklevel=2,
        )


def layers(env: Any) -> list[Any]:
    """The outer wrappers that change nothing, and then the first env or wrapper that does."""
    found = [env]
    while isinstance(env, gym.Wrapper) and type(env) in _TRANSPARENT:
        env = env.env
        found.append(env)
    return found


def known_task(env: Any) -> KnownTask | None:
    """The task of an environment; None if it is unknown, or has methods of its own.

    Subclasses, and an assignment such as `env.reset_model = mine`, may change steps and rewards.

    Raises:
        ValueError: If an attribute was set of a wrapper, or the horizon is no whole number.
    """
    inner = layers(env)[-1]
    make_task = task_class(inner)
    names = {name for layer in layers(env) for name in vars(layer)}
    is_changed = any(callable(getattr(type(inner), name, None)) for name in names)
    is_changed |= env.observation_space is not inner.observation_space
    is_changed |= env.action_space is not inner.action_space
    if is_changed or (make_task is None and type(inner) not in SIMULATIONS):
        return None
    shadowed = [name for layer in layers(env)[:-1] for name in vars(layer) if hasattr(inner, name)]
    if shadowed:
        raise ValueError(
            f"`{shadowed[0]}` was set of a wrapper, which {type(inner).__name__} does not read: "
            f"set `env.unwrapped.{shadowed[0]}`."
        )
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


def max_steps(env: Any) -> int:
    """Steps after which an episode of a maze or task ends: its horizon, or a lower limit."""
    inner = layers(env)[-1]
    own = getattr(inner, "max_episode_steps", None)  # of a vector env, which no TimeLimit fits
    limits: list[int | None] = [inner.horizon, time_limit(env), own]
    return min(limit for limit in limits if limit is not None)


def _are_alike(envs: list[gym.Env[Any, Any]]) -> bool:
    """Whether there is one env, or all are the same maze, task or robot."""
    first, *others = map(known_task, envs)
    return not others or (first is not None and all(map(first.is_same, others)))
