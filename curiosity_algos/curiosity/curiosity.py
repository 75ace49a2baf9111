"""A bonus with its training and its scale, for evolution, a VecEnv and a replay buffer alike."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any, ClassVar, TypedDict

import numpy as np
import torch as th
from gymnasium import spaces
from stable_baselines3.common.running_mean_std import RunningMeanStd

from curiosity_algos.bonuses.base import Bonus, check_scores
from curiosity_algos.bonuses.make import FOR_ONE_POLICY, check_bonus_choice, make_bonus
from curiosity_algos.common.arrays import Array, Float64Array, Mask
from curiosity_algos.common.kept import Kept
from curiosity_algos.common.networks import check_gradients, single_torch_thread
from curiosity_algos.evaluation.arguments import check_keywords_known
from curiosity_algos.state.check import check_keys, check_like
from curiosity_algos.state.settings import HasSettings
from curiosity_gym.validation import check_at_least_one, check_bool, check_not_negative, check_share

EPSILON, LARGEST = 1e-8, 10.0
"""Added to the variance of the sums, and bound of scaled rewards, as in SB3's VecNormalize."""
MEMORY = 100_000
"""Transitions that a scale remembers: what rewards were at first is forgotten."""


class RewardScale:
    """Divides by the running standard deviation of the discounted sum (Burda et al. 2018).

    Args:
        n_envs: Environments side by side, each with a sum of its own.
        bounds_sums: Whether what enters the sums is bounded as what comes out. One reward like no
            other would else set the scale for as long as that remembers.
    """

    def __init__(self, n_envs: int, *, bounds_sums: bool) -> None:
        self._sums = np.zeros(n_envs)
        self._bounds_sums = bounds_sums
        self._statistics = RunningMeanStd(shape=())

    def reset(self) -> None:
        """Begin the sums anew; the scale stays."""
        self._sums[:] = 0.0

    def end(self, ended: Mask) -> None:
        """Begin the sums of these environments (n_envs,) anew."""
        self._sums[ended] = 0.0

    def learn(self, rewards: Float64Array, *, gamma: float) -> None:
        """Take the rewards (n_envs,) of a step into the discounted sums."""
        if self._bounds_sums:
            largest = LARGEST * self._deviation
            rewards = np.clip(rewards, -largest, largest)
        self._sums = gamma * self._sums + rewards
        self._statistics.update(self._sums)
        self._statistics.count = min(self._statistics.count, MEMORY)

    def scaled(self, rewards: Float64Array) -> Float64Array:
        """The rewards (n,) over the scale; bounded."""
        return np.clip(rewards / self._deviation, -LARGEST, LARGEST)

    @property
    def has_learned(self) -> bool:
        """Whether there is a scale."""
        return bool(self._statistics.count >= 1.0)

    @property
    def _deviation(self) -> Float64Array:
        deviation: Float64Array = np.sqrt(self._statistics.var + EPSILON)
        return deviation

    def state_dict(self) -> dict[str, Any]:
        """Sums and statistics; the discount is a setting."""
        seen = self._statistics
        statistics = np.array([seen.mean, seen.var, seen.count], dtype=np.float64)
        return {"sums": self._sums.copy(), "statistics": statistics}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave, of as many environments."""
        mean, var, count = state["statistics"]
        self._sums = state["sums"].copy()
        self._statistics.mean, self._statistics.var = np.array(mean), np.array(var)
        self._statistics.count = float(count)


def check_interval(train_interval: int | None) -> None:
    """Raise ValueError unless it is a number of transitions, or None."""
    if train_interval is not None:
        check_at_least_one(train_interval=train_interval)


def check_discount(gamma: float | None) -> None:
    """Raise ValueError unless sums of any length have a scale, or none is asked for."""
    if gamma == 1.0:
        raise ValueError("`gamma` must be below 1: the sum would grow for ever.")
    if gamma is not None:
        check_share(gamma=gamma)


class CuriosityKeywords(TypedDict, total=False):
    """Keywords of all that adds a bonus to the reward of one policy, see `Curiosity`."""

    bonus: str | Bonus
    bonus_kwargs: dict[str, Any] | None
    weight: float
    extrinsic: bool
    norm_reward: bool
    gamma: float | None
    train_interval: int | None
    n_updates: int
    batch_size: int


def check_keywords_of(holder: type, given: Mapping[str, Any]) -> None:
    """Raise TypeError, as Python does, if what adds a bonus to rewards is given another keyword."""
    known = CuriosityKeywords.__annotations__
    check_keywords_known(holder, [name for name in given if name not in known], known)


class Curiosity(HasSettings):
    """A bonus that is trained on what its host collects, and scaled by what it has paid.

    A host brings transitions as the bonus sees them: observations (n, ...), actions (n, A) of a Box
    or (n,) of a Discrete, and next observations. It counts them (`is_due`), lets the bonus observe
    them, and says where batches are drawn from. Settings from `weight` to `batch_size` may be set
    at any time.

    Args:
        observation_space: Box of vectors or images.
        action_space: One-dimensional Box, or Discrete.
        bonus: "apt", "disagreement", "e3b", "etd", "icm", "ngu", "noveld", "ramp", "rnd", or a
            `Bonus` made for the spaces, which this then trains.
        bonus_kwargs: Keywords of a bonus that is named, see that. Some have other defaults here: of
            "apt" a `power` of 3 and a `horizon` of 10, of "e3b" `log`, of "icm" a `learning_rate`
            of 1e-4.
        weight: Factor of the bonus, at least 0, in units of the task's reward: small enough that a
            rewarded episode is worth more than curiosity.
        extrinsic: Whether the reward of the task counts; False: curiosity alone.
        norm_reward: Whether the sum of both is divided by the running standard deviation of its
            discounted sum over an episode, and bounded by 10, as in SB3's VecNormalize: what is
            learned from has the same size while the bonus is alone, and when the task is solved.
            Where `extrinsic` is off, `weight` cancels then.
        gamma: Discount of the sums that the bonus, and the sum of both, are scaled by, from 0 to
            below 1; None: they count as they are, whatever `norm_reward` is.
        train_interval: Transitions of all environments between two trainings; None: the host says
            when.
        n_updates: Gradient steps a training.
        batch_size: Transitions a gradient step.
        n_envs: Environments side by side, each with a discounted sum.
        for_one_policy: Whether a single policy learns from it: bonuses have other defaults then,
            see `bonus_kwargs`.
        seed: Of the networks.
        device: As in Stable-Baselines3.

    Attributes:
        scale: Of the bonus.
        total_scale: Of the sum of both.
        metrics: Mean losses of the last training, by the names they are logged under.
        n_untrained: Transitions since the last training.
        n_trainings: Trainings so far.

    Raises:
        ValueError: If an argument is out of its range, or the bonus does not fit the spaces.
    """

    _checks: ClassVar = {
        "weight": check_not_negative,
        "extrinsic": check_bool,
        "norm_reward": check_bool,
        "gamma": check_discount,
        "train_interval": check_interval,
        "n_updates": check_at_least_one,
        "batch_size": check_at_least_one,
    }
    gamma: float | None
    train_interval: int | None

    def __init__(
        self,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        *,
        bonus: str | Bonus = "apt",
        bonus_kwargs: Mapping[str, Any] | None = None,
        weight: float = 0.02,
        extrinsic: bool = True,
        norm_reward: bool = True,
        gamma: float | None = 0.99,
        train_interval: int | None = 2048,
        n_updates: int = 64,
        batch_size: int = 256,
        n_envs: int = 1,
        for_one_policy: bool = True,
        seed: np.random.SeedSequence,
        device: th.device | str = "auto",
    ) -> None:
        bonus_kwargs = {} if bonus_kwargs is None else bonus_kwargs
        check_bonus_choice(bonus, bonus_kwargs)
        self.weight = weight
        self.extrinsic = extrinsic
        self.norm_reward = norm_reward
        self.gamma = gamma
        self.train_interval = train_interval
        self.n_updates = n_updates
        self.batch_size = batch_size
        self.name = bonus if isinstance(bonus, str) else None
        self.bonus_kwargs = dict(bonus_kwargs)
        if for_one_policy and isinstance(bonus, str):
            bonus_kwargs = FOR_ONE_POLICY.get(bonus, {}) | self.bonus_kwargs
        both_spaces = observation_space, action_space
        self.bonus = make_bonus(bonus, bonus_kwargs, *both_spaces, seed=seed, device=device)
        self.scale = RewardScale(n_envs, bounds_sums=True)
        self.total_scale = RewardScale(n_envs, bounds_sums=False)
        self.metrics: dict[str, float] = {}
        self.n_untrained = self.n_trainings = 0
        self._settled = {"bonus", "bonus_kwargs"}

    def _way_on(self, name: str) -> str:
        return "make a new one"

    @property
    def made_with(self) -> dict[str, Any]:
        """The name of the bonus, or None, and its keywords."""
        return {"bonus": self.name, "bonus_kwargs": self.bonus_kwargs}

    @property
    def settings(self) -> dict[str, Any]:
        """What may be set at any time, as it is now."""
        return {name: getattr(self, name) for name in self._checks}

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
        if self.gamma is None:
            return scores
        if is_learning:
            self.scale.learn(scores, gamma=self.gamma)
        return self.scale.scaled(scores)

    def total(
        self, rewards: Array, bonus: Array, *, ended: Mask | None = None, is_learning: bool = False
    ) -> Array:
        """What is to be learned from: the task's rewards and the weighted bonus, over their scale.

        Args:
            rewards: (n,), of the task.
            bonus: (n,), scaled.
            ended: (n_envs,), of a step of all environments: where episodes ended with it.
            is_learning: Whether the scale learns of this step first.
        """
        total = self.weight * bonus
        if self.extrinsic:
            total = total + rewards
        if self.gamma is None:
            return total
        if is_learning:
            self.total_scale.learn(total, gamma=self.gamma)
        if ended is not None:
            self.total_scale.end(ended)
        if not self.norm_reward or not self.total_scale.has_learned:
            return total
        return self.total_scale.scaled(total)

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
            "scale": self.scale.state_dict(),
            "total_scale": self.total_scale.state_dict(),
            "n_untrained": self.n_untrained,
            "n_trainings": self.n_trainings,
            "metrics": dict(self.metrics),
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave.

        Raises:
            ValueError: If it is of a bonus that was made otherwise.
        """
        own = self.state_dict()
        # A bonus checks its own state, and who has not trained has no metrics.
        apart: dict[str, Any] = {"bonus": None, "metrics": {}}
        check_like({**state, **apart}, {**own, **apart}, "curiosity")
        try:
            self.bonus.load_state_dict(state["bonus"])
        except Exception as error:  # a bonus of the user's own may raise any
            raise ValueError("`bonus` must be made as the one that was saved.") from error
        self.scale.load_state_dict(state["scale"])
        self.total_scale.load_state_dict(state["total_scale"])
        self.n_untrained, self.n_trainings = state["n_untrained"], state["n_trainings"]
        self.metrics = dict(state["metrics"])


OfCuriosity = partial(Kept, "curiosity")
"""An attribute of a host that its `curiosity` keeps."""
