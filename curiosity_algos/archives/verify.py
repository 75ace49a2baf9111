"""Do elites reproduce? Plays each again and compares with what the archive keeps of it."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing, nullcontext
from dataclasses import dataclass
from typing import Any

import numpy as np

from curiosity_algos.common.arrays import Float64Array, Int64Array
from curiosity_algos.evaluation.base import Evaluator
from curiosity_algos.evaluation.environments import open_env
from curiosity_algos.evaluation.evaluator import AnyEnv, make_evaluator, replay


@dataclass(frozen=True)
class Verification:
    """The result of playing the elites again.

    Attributes:
        share: Share of the elites whose return and behavior came out the same in every bit; 1 for
            an empty archive.
        failed: (m,) positions, in the order of `archive.data()`, of those that did not.
        objective: (n,) returns of this time.
        behaviors: (n, B) behaviors of this time.
    """

    share: float
    failed: Int64Array
    objective: Float64Array
    behaviors: Float64Array


def verify(
    archive: Any,
    env: AnyEnv,
    n_threads: int | None = None,
    *,
    net_arch: Sequence[int] | None = None,
) -> Verification:
    """Play every elite of `archive` again, with the seed of its episode where one is kept.

    Args:
        archive: An `EliteArchive` of policies, or one of pyribs'.
        env: As in the algorithms' constructor.
        n_threads: None: as many as there are processors.
        net_arch: Hidden layers of the policies; None: those that the archive knows of, else the
            default ones.

    Raises:
        ValueError: If the elites are no policies for `env`, or its behaviors are of another length.
    """
    net_arch = getattr(archive, "net_arch", None) if net_arch is None else net_arch
    kwargs = None if net_arch is None else {"net_arch": net_arch}
    opened = open_env(env)
    with nullcontext() if opened is env else closing(opened):
        return _verify(archive, make_evaluator(opened, kwargs, n_threads))


def _verify(archive: Any, evaluator: Evaluator) -> Verification:
    if evaluator.n_parameters != archive.solution_dim:
        raise ValueError(
            f"`env` asks for policies of {evaluator.n_parameters} parameters, the archive's have "
            f"{archive.solution_dim}."
        )
    elites, kept = archive.data(), behaviors_of(archive)
    objective, behaviors = np.empty_like(elites["objective"]), np.empty_like(kept)
    for indices, rollouts in replay(evaluator, elites["solution"], elites.get("seed")):
        if rollouts.behaviors.shape[1:] != kept.shape[1:]:
            raise ValueError(
                f"`env` gives behaviors of shape {rollouts.behaviors.shape[1:]}, "
                f"the archive's are of shape {kept.shape[1:]}."
            )
        objective[indices], behaviors[indices] = rollouts.returns, rollouts.behaviors
    is_same = (objective == elites["objective"]) & (behaviors == kept).all(axis=1)
    share = float(is_same.mean()) if len(is_same) else 1.0
    return Verification(share, np.flatnonzero(~is_same), objective, behaviors)


def behaviors_of(archive: Any) -> Float64Array:
    """(n, B): the behaviors of an archive's elites, the measures unless "behavior" is kept."""
    name = "behavior" if "behavior" in archive.field_list else "measures"
    behaviors: Float64Array = archive.data(name)
    return behaviors
