"""Chooses the evaluator that a user asks for, and follows the environment."""

from __future__ import annotations

from typing import Any

from curiosity_algos.evaluation.base import Evaluator
from curiosity_algos.evaluation.environments import EnvObject, FactoryVecEnv, describe
from curiosity_algos.evaluation.evaluator import check_policy_kwargs, make_evaluator
from curiosity_algos.evaluation.mlp import build_mlp
from curiosity_algos.evaluation.transparent import as_played, known_task
from curiosity_gym.validation import check_choice


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
            from curiosity_algos.evaluation.ray import RayEvaluator  # few have it installed

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
