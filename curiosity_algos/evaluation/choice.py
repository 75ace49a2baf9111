"""The evaluator that a user names, gives or leaves open."""

from __future__ import annotations

from typing import Any

from curiosity_algos.evaluation.environments import (
    GymnasiumView,
    MadeEnv,
    MadeVecEnv,
    describe,
)
from curiosity_algos.evaluation.evaluator import Evaluator, check_policy_kwargs, make_evaluator
from curiosity_algos.evaluation.policies import build_mlp
from curiosity_algos.evaluation.transparent import KnownTask, as_played, known_task
from curiosity_gym.validation import check_choice


def choose_evaluator(
    choice: Evaluator | str, env: MadeEnv, policy_kwargs: dict[str, Any], n_threads: int | None
) -> Evaluator:
    """What an algorithm's `evaluator` says: the user's own, or "auto" or "ray"; see it there.

    Raises:
        ValueError: If it is none of these, or of other policies; as `make_evaluator`.
    """
    if isinstance(choice, str):
        check_choice(("auto", "ray"), evaluator=choice)
        if choice == "ray":
            from curiosity_algos.evaluation.ray import RayEvaluator  # few have it installed

            return RayEvaluator(env, policy_kwargs)
        return make_evaluator(env, policy_kwargs, n_threads)
    wanted = build_mlp(*describe(env), check_policy_kwargs(policy_kwargs)).n_parameters
    own = getattr(choice, "n_parameters", None)
    if own != wanted or not hasattr(choice, "evaluate"):
        raise ValueError(
            '`evaluator` must be "auto", "ray" or an Evaluator of the policy\'s '
            f"{wanted} parameters, got {choice!r} of {own}."
        )
    if isinstance(env, MadeVecEnv | GymnasiumView):
        env.unreached = "they are those of `evaluator`"
    return choice


def follow_env(
    evaluator: Evaluator,
    choice: Evaluator | str,
    env: MadeEnv,
    policy_kwargs: dict[str, Any],
    n_threads: int | None,
) -> Evaluator:
    """The evaluator, or another that was chosen if a maze, a task or a robot has changed since.

    Compiled evaluators know of the environment what it was when they were made. One that the user
    gave plays its own.
    """
    known: KnownTask | None = getattr(getattr(evaluator, "local", evaluator), "known", None)
    is_own = not isinstance(choice, str)
    if is_own or known is None or known.is_same(known_task(as_played(env))):
        return evaluator
    if hasattr(evaluator, "close"):  # that of a cluster
        evaluator.close()
    return choose_evaluator(choice, env, policy_kwargs, n_threads)
