"""The evaluator that a user names, gives or leaves open."""

from __future__ import annotations

from typing import Any

from curiosity_algos.evaluation.environments import MadeEnv, describe
from curiosity_algos.evaluation.evaluator import Evaluator, check_policy_kwargs, make_evaluator
from curiosity_algos.evaluation.policies import build_mlp
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
    return choice
