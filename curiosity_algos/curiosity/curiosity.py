"""A bonus with its training and its scale, for evolution, a VecEnv and a replay buffer alike."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any, ClassVar

import numpy as np
import torch as th
from gymnasium import spaces

from curiosity_algos.bonuses.base import Bonus, check_scores
from curiosity_algos.bonuses.make import check_bonus_choice, make_bonus
from curiosity_algos.common.arrays import Array
from curiosity_algos.common.networks import check_gradients, single_torch_thread
from curiosity_algos.curiosity.scale import BonusScale, check_discount
from curiosity_algos.state.check import check_keys, check_like
from curiosity_algos.state.settings import HasSettings
from curiosity_gym.validation import (
    LARGEST_COUNT,
    check_at_least_one,
    check_bool,
    check_not_negative,
    check_whole,
)


def check_interval(train_interval: int | None) -> None:
    """Raise ValueError unless it is a number of transitions, or None."""
    if train_interval is not None:
        check_at_least_one(train_interval=train_interval)


class Curiosity(HasSettings):
    """A bonus that is trained on what its host collects, and scaled by what it has paid.

    A host brings transitions as the bonus sees them: observations (n, ...), actions (n, A) of a Box
    or (n,) of a Discrete, and next observations. It counts them (`is_due`), lets the bonus observe
    them, and says where batches are drawn from. Settings may be set at any time.

    Args:
        observation_space: Box of vectors or images.
        action_space: One-dimensional Box, or Discrete.
        bonus: Name of a bonus, or a `Bonus` made for the spaces, which this then trains.
        bonus_kwargs: Keywords of a bonus that is named.
        weight: Factor of the bonus, at least 0.
        extrinsic: Whether the reward of the task counts beside it.
        gamma: Discount of the sum that the bonus is scaled by, from 0 to below 1; None: the bonus
            counts as it is.
        train_interval: Transitions between two trainings; None: the host says when.
        n_updates: Gradient steps a training.
        batch_size: Transitions a gradient step.
        n_envs: Environments side by side, each with a discounted sum.
        seed: Of the networks.
        device: As in Stable-Baselines3.

    Attributes:
        scale: Of the bonus, or None.
        metrics: Mean losses of the last training, by the names they are logged under.
        n_untrained: Transitions since the last training.
        n_trainings: Trainings so far.

    Raises:
        ValueError: If an argument is out of its range, or the bonus does not fit the spaces.
    """

    _checks: ClassVar = {
        "weight": check_not_negative,
        "extrinsic": check_bool,
        "train_interval": check_interval,
        **dict.fromkeys(("n_updates", "batch_size"), check_at_least_one),
    }
    SETTINGS: ClassVar = (*_checks, "gamma")
    """What may be set at any time."""
    train_interval: int | None

    def __init__(
        self,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        *,
        bonus: str | Bonus,
        bonus_kwargs: Mapping[str, Any],
        n_updates: int,
        batch_size: int,
        weight: float = 1.0,
        extrinsic: bool = True,
        gamma: float | None = None,
        train_interval: int | None = None,
        n_envs: int = 1,
        seed: np.random.SeedSequence,
        device: th.device | str = "auto",
    ) -> None:
        check_bonus_choice(bonus, bonus_kwargs)
        if gamma is not None:
            check_discount(gamma)
        self.weight = weight
        self.extrinsic = extrinsic
        self.train_interval = train_interval
        self.n_updates = n_updates
        self.batch_size = batch_size
        both_spaces = observation_space, action_space
        self.bonus = make_bonus(bonus, bonus_kwargs, *both_spaces, seed=seed, device=device)
        self.scale = None if gamma is None else BonusScale(n_envs, gamma=float(gamma))
        self.metrics: dict[str, float] = {}
        self.n_untrained = self.n_trainings = 0
        self._settled = {"bonus"}

    def _way_on(self, name: str) -> str:
        return "make a new one"

    @property
    def gamma(self) -> float | None:
        """Discount of the sum that the bonus is scaled by; None: it is not."""
        return None if self.scale is None else self.scale.gamma

    @gamma.setter
    def gamma(self, gamma: float | None) -> None:
        if self.scale is not None:
            check_discount(gamma)
            self.scale.gamma = float(gamma)  # type: ignore[arg-type]  # checked to be one
        elif gamma is not None:
            raise ValueError("`gamma` must stay as it was set: make a new one.")

    @property
    def settings(self) -> dict[str, Any]:
        """What may be set at any time, as it is now."""
        return {name: getattr(self, name) for name in self.SETTINGS}

    def load_settings(self, settings: Any) -> None:
        """Set all that `settings` gave; ValueError, maybe after some, if one is out of range."""
        check_keys(settings, self.settings, "settings")
        for name, value in settings.items():
            setattr(self, name, value)

    @property
    def horizon(self) -> int:
        """Steps that the transitions span at most which the bonus learns from."""
        return self.bonus.horizon

    def observe(self, before: Array, ends: Array) -> None:
        """Let the bonus observe where steps began, and where the task ended episodes.

        The last state of an episode may be like no other: unless it is observed, it is new whenever
        it comes again. A bonus whose `observes_ends` is False is spared them.

        Args:
            before: (n, ...).
            ends: (m, ...), the last states of episodes that the task ended, no limit of time.
        """
        observed = np.concatenate([before, ends]) if self.bonus.observes_ends else before
        self.bonus.observe(th.from_numpy(observed))

    def score(self, before: Array, actions: Array, after: Array, scorer: Any = None) -> Array:
        """Bonus (n,) of transitions, as it is, from `scorer` if there is one.

        Raises:
            ValueError: If one is not finite; the message says whose fault that is.
        """
        scores: Array = (scorer or self.bonus).score(before, actions, after)
        check_scores(scores, before, after)
        return scores

    def scaled(self, scores: Array, *, is_learning: bool = False) -> Array:
        """The bonus over its scale; where `is_learning`, that learns of this step first."""
        return scores if self.scale is None else self.scale.scaled(scores, is_learning=is_learning)

    def is_due(self, n: int) -> bool:
        """Count n more transitions; whether a training is due."""
        self.n_untrained += n
        return self.train_interval is not None and self.n_untrained >= self.train_interval

    def train(self, draw: Callable[[int], Iterable[th.Tensor]]) -> dict[str, float]:
        """Train on one torch thread; mean losses, by the names they are logged under.

        Args:
            draw: Gives observations, actions and next observations of so many transitions.

        Raises:
            RuntimeError: If torch computes no gradients.
        """
        check_gradients()
        with single_torch_thread():
            steps = [self.bonus.update(*draw(self.batch_size)) for _ in range(self.n_updates)]
        self.metrics = {
            f"{self.bonus.name}/{name}": float(np.mean([losses[name] for losses in steps]))
            for name in steps[0]
        }
        self.n_untrained = 0
        self.n_trainings += 1
        return self.metrics

    def state_dict(self) -> dict[str, Any]:
        """Everything that a resumed run needs, but the settings."""
        return {
            "bonus": self.bonus.state_dict(),
            "scale": None if self.scale is None else self.scale.state_dict(),
            "n_untrained": self.n_untrained,
            "n_trainings": self.n_trainings,
            "metrics": dict(self.metrics),
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave.

        Raises:
            ValueError: If it is of a bonus that was made otherwise; nothing has changed then.
        """
        own = self.state_dict()
        check_keys(state, own, "curiosity")
        # A bonus checks its own state, and who has not trained has no metrics.
        check_like(
            {**state, "bonus": None},
            {**own, "bonus": None, "metrics": _any_numbers(state["metrics"])},
            "curiosity",
        )
        for name in ("n_untrained", "n_trainings"):
            check_whole(0, LARGEST_COUNT, **{name: state[name]})
        try:
            self.bonus.load_state_dict(state["bonus"])
        except Exception as error:  # a bonus of the user's own may raise any
            self.bonus.load_state_dict(own["bonus"])
            raise ValueError("`bonus` must be made as the one that was saved.") from error
        if self.scale is not None:
            self.scale.load_state_dict(state["scale"])
        self.n_untrained, self.n_trainings = state["n_untrained"], state["n_trainings"]
        self.metrics = dict(state["metrics"])


def _any_numbers(metrics: Any) -> dict[str, float]:
    return dict.fromkeys(metrics if isinstance(metrics, Mapping) else (), math.nan)


class OfCuriosity:
    """An attribute of a host that its `curiosity` keeps."""

    def __set_name__(self, host: type, name: str) -> None:
        self._name = name

    def __get__(self, host: Any, cls: type) -> Any:
        return self if host is None else getattr(host.curiosity, self._name)

    def __set__(self, host: Any, value: Any) -> None:
        setattr(host.curiosity, self._name, value)
