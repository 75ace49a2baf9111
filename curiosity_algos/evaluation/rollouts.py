"""The record of a population's episodes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from gymnasium import spaces

from curiosity_algos.common.arrays import Array, Float32Array, Float64Array, Int64Array, Mask

Summary = tuple[Array, ...]
"""Summaries of the trajectories of P individuals: arrays (P, ...)."""
Summarizer = Callable[["Rollouts", slice], Summary]
"""`summarize(rollouts, individuals)`: the summary of rollouts of these individuals."""
MakeSummarizers = Callable[[int], Mapping[str, Summarizer]]
"""`make_summarizers(P)`: summarizers, by name, for the trajectories of P individuals."""


def check_parameters(parameters: Array, n_parameters: int) -> Float32Array:
    """The population as contiguous float32; ValueError unless it is finite and of the shape."""
    array = np.ascontiguousarray(parameters, dtype=np.float32)
    if array.ndim != 2 or array.shape[1] != n_parameters or len(array) == 0:
        raise ValueError(
            f"`parameters` must be of shape (P, {n_parameters}), P at least 1, got {array.shape}."
        )
    if not np.isfinite(array).all():
        raise ValueError("`parameters` must be finite, as float32, got NaN or infinity.")
    return array


def check_observations(observations: Array) -> None:
    """Raise ValueError unless observations are finite."""
    if not np.isfinite(observations).all():
        raise ValueError("`env` must give finite observations, it gave NaN or infinity.")


def as_behaviors(behaviors: Sequence[Any]) -> Float64Array:
    """Behaviors, at least one, as an array (P, B); ValueError unless they are like numbers."""
    try:
        array = np.array(behaviors, dtype=np.float64)
    except (TypeError, ValueError):  # text, or shapes that differ
        array = np.empty(0)
    if array.ndim != 2:
        raise ValueError(
            '`env` must end every episode with an info["behavior"] of numbers, of the same shape '
            f"(B,), or none, got {list(behaviors)!r:.60}."
        )
    return array


def final_behaviors(infos: Sequence[Mapping[str, Any]]) -> Float64Array:
    """The behaviors (P, B) of infos at the ends of P episodes, at least one; B is 0 without any.

    Raises:
        ValueError: If they are not all finite numbers, of the same shape.
    """
    behaviors = as_behaviors([info.get("behavior", ()) for info in infos])
    check_finite(behaviors)
    return behaviors


def check_finite(behaviors: Float64Array) -> None:
    """Raise ValueError unless the behaviors at the ends of episodes are finite."""
    if not np.isfinite(behaviors).all():
        raise ValueError("`env` must give finite behaviors, an episode's was not.")


@dataclass(frozen=True, repr=False)
class Rollouts:
    """One episode of each of P individuals; trajectories are padded to one length T.

    Observations and actions are those that policies and bonuses see: vectors, see `flat_spaces`.

    Attributes:
        returns: (P,) float64, sum of rewards.
        lengths: (P,) int64, environment steps.
        success: (P,) bool, `info["is_success"]` at the end; False where the env has none.
        terminated: (P,) bool, whether the task ended the episode, and not a time limit.
        behaviors: (P, B) float64, `info["behavior"]` at the end; B = 0 where the env has none.
        final_observations: (P, O) float32, the true last observation, never that of a reset.
        observations: (P, T + 1, O) float32; entries after an episode's end are undefined.
        actions: (P, T, A) float32, or (P, T) int64 from 0 on for Discrete actions; entries after an
            episode's end are undefined.
        visited: (V,) int64, ascending, the cells of the environment's coverage grid in which a step
            of any individual ended; None: not counted.
        summaries: Summaries of the trajectories by name; trajectories may be None then.
    """

    returns: Float64Array
    lengths: Int64Array
    success: Mask
    terminated: Mask
    behaviors: Float64Array
    final_observations: Float32Array
    observations: Float32Array | None = None
    actions: Float32Array | Int64Array | None = None
    visited: Int64Array | None = None
    summaries: Mapping[str, Summary] = field(default_factory=dict)

    def __repr__(self) -> str:
        steps, successes = f"{self.timesteps:,} steps", f"{np.sum(self.success):,} successes"
        return f"<{type(self).__name__}: {len(self):,} episodes, {steps}, {successes}>"

    def __len__(self) -> int:
        """Number of individuals."""
        return len(self.returns)

    def check(self, behavior_space: spaces.Box[Any] | None) -> None:
        """Raise ValueError if returns or behaviors are not finite, or of another shape."""
        if not np.isfinite(self.returns).all():
            raise ValueError("`env` must give finite rewards, an episode's return was not finite.")
        check_finite(self.behaviors)
        if behavior_space is not None and self.behaviors.shape[1:] != behavior_space.shape:
            raise ValueError('`env` must give an info["behavior"] of its `behavior_space`.')

    @property
    def trajectories(self) -> tuple[Float32Array, Float32Array | Int64Array]:
        """Observations and actions; raises ValueError if the evaluator recorded none."""
        if self.observations is None or self.actions is None:
            raise ValueError(
                "These rollouts hold no trajectories: `evaluator` must give them here."
            )
        return self.observations, self.actions

    def summary(self, name: str, make_summarizers: MakeSummarizers) -> Summary:
        """The summary of a name, made now if it was not made where the trajectories were played."""
        if name in self.summaries:
            return self.summaries[name]
        return make_summarizers(len(self))[name](self, slice(0, len(self)))

    def without_trajectories(self) -> Rollouts:
        """The same rollouts without observations, actions and summaries."""
        return replace(self, observations=None, actions=None, summaries={})

    def infos(self, seconds: float) -> list[dict[str, Any]]:
        """The info of the last step of each episode, as a Monitor gives it at that time."""
        rows = zip(
            *(self.returns, self.lengths, self.success, self.final_observations, self.behaviors),
            strict=True,
        )
        return [
            {
                "episode": {"r": round(float(gained), 6), "l": int(n), "t": round(seconds, 6)},
                "is_success": bool(success),
                "terminal_observation": final,
                **({"behavior": behavior} if len(behavior) else {}),
            }
            for gained, n, success, final, behavior in rows
        ]

    @property
    def timesteps(self) -> int:
        """Environment steps taken by all individuals together."""
        return int(self.lengths.sum())


def sparse_returns(horizon: int, lengths: Int64Array, success: Mask) -> Float64Array:
    """Returns (P,) of an env whose only reward is `1 - t / horizon`, for a success in step t."""
    return np.where(success, 1.0 - lengths / horizon, 0.0)


def concatenate(parts: Sequence[Rollouts]) -> Rollouts:
    """Join parts of a population into one record, as long as the longest episode."""
    if len(parts) == 1:
        return parts[0]
    longest = max(part.lengths.max() for part in parts)
    visited = [part.visited for part in parts if part.visited is not None]
    names = ("returns", "lengths", "success", "terminated", "final_observations")
    return Rollouts(
        **{name: np.concatenate([getattr(part, name) for part in parts]) for name in names},
        behaviors=as_behaviors([behavior for part in parts for behavior in part.behaviors]),
        observations=_join_trajectories([part.observations for part in parts], longest + 1),
        actions=_join_trajectories([part.actions for part in parts], longest),
        visited=np.unique(np.concatenate(visited)) if visited else None,
        summaries={
            name: tuple(map(np.concatenate, zip(*(p.summaries[name] for p in parts), strict=True)))
            for name in parts[0].summaries
        },
    )


def _join_trajectories(arrays: list[Any], length: int) -> Any:
    """Parts of trajectories in one array, or None if a part has none."""
    if any(array is None for array in arrays):
        return None
    # Evaluators need not cut them at their longest.
    cut = [array[:, :length] for array in arrays]
    missing = [[(0, 0), (0, length - part.shape[1])] + [(0, 0)] * (part.ndim - 2) for part in cut]
    return np.concatenate(list(map(np.pad, cut, missing)))
