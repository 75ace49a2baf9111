"""Chooses the evaluator that fits an environment, or that a user asks for."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from curiosity_algos.common.arrays import Array, Float32Array, Int64Array
from curiosity_algos.evaluation.base import Evaluator
from curiosity_algos.evaluation.environments import (
    EnvObject,
    FactoryVecEnv,
    MakeEnv,
    describe,
    open_env,
)
from curiosity_algos.evaluation.maze import MazeEvaluator
from curiosity_algos.evaluation.mlp import DEFAULT_NET_ARCH, build_mlp
from curiosity_algos.evaluation.rollouts import Rollouts
from curiosity_algos.evaluation.simulation import SimulationEvaluator
from curiosity_algos.evaluation.transparent import (
    as_played,
    check_constant,
    known_task,
    warn_of_empty_files,
)
from curiosity_algos.evaluation.vector import VectorEvaluator
from curiosity_gym.validation import check_at_least_one, check_choice

AnyEnv = EnvObject | MakeEnv | str

BATCH = 64
"""Episodes that are replayed at once: more would take memory, and save no time."""


def make_evaluator(
    env: AnyEnv, policy_kwargs: dict[str, Any] | None = None, n_threads: int | None = None
) -> Evaluator:
    """The fastest evaluator that fits `env` as it is now.

    Args:
        env: An id, a function that makes an environment, a Gymnasium env or VectorEnv, or an SB3
            VecEnv without wrappers. Where no compiled evaluator fits, an id or a function makes as
            many environments as save time, and an environment plays alone.
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


def choose_evaluator(
    choice: Evaluator | str, env: EnvObject, policy_kwargs: dict[str, Any], n_threads: int | None
) -> Evaluator:
    """The evaluator that the argument `evaluator` of an algorithm asks for.

    Raises:
        ValueError: If it is none, or is of other policies; as `make_evaluator`.
    """
    if isinstance(choice, str):
        check_choice(("auto", "ray"), evaluator=choice)
        if choice == "ray":
            # Not above: few have it installed.
            from curiosity_algos.evaluation.ray import RayEvaluator

            return RayEvaluator(env, policy_kwargs)
        return make_evaluator(env, policy_kwargs, n_threads)
    wanted = build_mlp(*describe(env), check_policy_kwargs(policy_kwargs)).n_parameters
    own = choice.n_parameters if isinstance(choice, Evaluator) else None
    if own != wanted:
        raise ValueError(
            f'`evaluator` must be "auto", "ray" or an Evaluator ({Evaluator.__module__}) of the '
            f"policy's {wanted} parameters, got {choice!r} of {own}."
        )
    if isinstance(env, FactoryVecEnv):  # whose environment it has never seen
        env.others_play = True
    return choice


def follow_env(
    evaluator: Evaluator,
    choice: Evaluator | str,
    env: EnvObject,
    policy_kwargs: dict[str, Any],
    n_threads: int | None,
) -> Evaluator:
    """The evaluator, or a new one if the maze, task or robot has changed since it was made.

    A compiled evaluator plays the environment as it was when the evaluator was made. An evaluator
    of the user's own stays.
    """
    if not isinstance(choice, str):
        return evaluator
    known = (evaluator.local or evaluator).known
    now = known_task(as_played(env))
    if now is None if known is None else known.is_same(now):
        return evaluator
    # It plays alone: others of its id or function lack the change.
    played = as_played(env) if now is None else env
    return choose_evaluator(choice, played, policy_kwargs, n_threads)


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
