"""Chooses the evaluator that fits an environment."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import wrappers
from gymnasium.vector import VectorEnv, VectorWrapper
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv, VecEnvWrapper, VecMonitor

from curiosity_algos.common.arrays import Array, Float32Array, Int64Array
from curiosity_algos.evaluation.base import Evaluator, KnownTask
from curiosity_algos.evaluation.environments import (
    EnvObject,
    FactoryVecEnv,
    MakeEnv,
    SingleVecEnv,
    describe,
    env_attributes,
    monitors,
    open_env,
)
from curiosity_algos.evaluation.maze import MazeEvaluator
from curiosity_algos.evaluation.mlp import DEFAULT_NET_ARCH, build_mlp
from curiosity_algos.evaluation.rollouts import Rollouts
from curiosity_algos.evaluation.simulation import SimulationEvaluator
from curiosity_algos.evaluation.vector import VectorEvaluator
from curiosity_gym.control.control_env import ControlEnv, ControlVectorEnv
from curiosity_gym.control.simulation import Simulation
from curiosity_gym.locomotion.locomotion_env import LocomotionEnv, LocomotionVectorEnv
from curiosity_gym.locomotion.simulation import LocomotionSimulation
from curiosity_gym.locomotion.tasks import task_class
from curiosity_gym.maze.maze_env import MazeEnv, MazeVectorEnv
from curiosity_gym.validation import check_at_least_one
from curiosity_gym.wrappers.sparse import time_limit

AnyEnv = EnvObject | MakeEnv | str

BATCH = 64
"""Episodes that are replayed at once: more would take memory, and save no time."""
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


def make_evaluator(
    env: AnyEnv, policy_kwargs: dict[str, Any] | None = None, n_threads: int | None = None
) -> Evaluator:
    """The fastest evaluator that fits `env` as it is now.

    Args:
        env: An id, a function that makes an environment, a Gymnasium env or VectorEnv, or an SB3
            VecEnv without wrappers.
        policy_kwargs: `net_arch`, widths of the hidden layers (default 32, 16).
        n_threads: Threads of the compiled evaluators; None: as many as there are processors.

    Raises:
        ValueError: If the env's spaces or its VecEnv wrappers are not supported, it has running
            statistics, or another argument is out of its range.
    """
    if n_threads is not None:
        check_at_least_one(n_threads=n_threads)
    opened = open_env(env)
    mlp = build_mlp(*describe(opened), check_policy_kwargs(policy_kwargs))
    inner = as_played(opened)
    check_constant(inner)
    known = known_task(inner)
    warn_of_empty_files(opened, is_compiled=known is not None)
    if known is None:
        played = opened if isinstance(opened, FactoryVecEnv) else inner
        return VectorEvaluator(played, mlp)
    compiled = MazeEvaluator if known.simulate is None else SimulationEvaluator
    return compiled(known, mlp, n_threads)


def replay(
    evaluator: Evaluator, parameters: Float32Array, seeds: Array | None
) -> Iterator[tuple[Int64Array, Rollouts]]:
    """Play policies (n, n_parameters) again, with the seeds (n,) of their episodes, if any.

    Yields indices, and the episodes of these policies: a few at a time that begin alike.
    """
    begins = [None] if seeds is None or not evaluator.draws else np.unique(seeds)
    for seed in begins:
        alike = np.arange(len(parameters)) if seed is None else np.flatnonzero(seeds == seed)
        for i in range(0, len(alike), BATCH):
            indices = alike[i : i + BATCH]
            rollouts = evaluator.evaluate(parameters[indices], None if seed is None else int(seed))
            yield indices, rollouts


def check_policy_kwargs(policy_kwargs: dict[str, Any] | None) -> list[int]:
    """The hidden layers' widths; raises ValueError where there are other keys, or no list."""
    if not isinstance(policy_kwargs, dict | None):
        raise ValueError(f"`policy_kwargs` must be a dictionary or None, got {policy_kwargs!r}.")
    others = dict(policy_kwargs or {})
    net_arch = others.pop("net_arch", DEFAULT_NET_ARCH)
    if others:
        raise ValueError(f"`policy_kwargs` may hold `net_arch` alone, got {sorted(others)} too.")
    if not isinstance(net_arch, list | tuple):
        raise ValueError(f"`net_arch` must be a list of layer widths, got {net_arch!r}.")
    return list(net_arch)


def as_played(env: Any) -> Any:
    """The environment that evaluators play: one for equal mazes, without what SB3 puts around it.

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
