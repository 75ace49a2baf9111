"""The interface of every exploration bonus, whichever algorithm holds it."""

from __future__ import annotations

import copy
import inspect
import math
from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, Protocol, TypedDict, runtime_checkable

import numpy as np
import torch as th
from gymnasium import spaces

from curiosity_algos.bonuses.encoders import ImageInputs
from curiosity_algos.common.arrays import Array, Float32Array, Mask
from curiosity_algos.common.networks import RunningNormalizer, torch_device
from curiosity_algos.evaluation.rollouts import check_observations
from curiosity_algos.state.check import check_keys, check_like
from curiosity_algos.state.settings import HasSettings
from curiosity_gym.compiled import ThreadPool
from curiosity_gym.validation import check_at_least_one, check_bool, check_positive, check_seed

Losses = dict[str, th.Tensor]
"""Mean losses of a batch by name; "loss" is what is minimized."""


class Episodes(Protocol):
    """What a bonus remembers of episodes side by side, each from its beginning."""

    def score(self, before: Array, actions: Array, after: Any) -> Float32Array:
        """Bonus (n,) of a step of each episode, which is then remembered."""

    def end(self, dones: Mask) -> None:
        """Forget the episodes (n,) that have ended: with the next step others begin."""

    def state_dict(self) -> dict[str, Any]:
        """What is remembered, as tensors and plain values."""

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave; ValueError if it is of other episodes."""


@runtime_checkable
class Bonus(Protocol):
    """Scores transitions, high where few like them were seen, and learns from them.

    Several threads may score at once: scoring changes nothing.

    Attributes:
        horizon: Steps that the transitions span at most which it learns from.
        observes_ends: Whether it observes the last states of episodes, too.
    """

    horizon: int = 1
    observes_ends: bool = True

    @property
    def name(self) -> str:
        """The name that its metrics are logged under."""

    def score(self, before: Array, actions: Array, after: Any) -> Float32Array:
        """Bonus of each transition, shape (n,).

        Observations before and after are (n, ...), actions (n, A) of a Box or (n,) of a Discrete,
        all as the environment gives and takes them.
        """

    def score_trajectory(self, observations: Array, actions: Array) -> Float32Array:
        """Bonus of each of the T transitions among T + 1 consecutive observations, shape (T,)."""
        return self.score(observations[:-1], actions, observations[1:])

    def episodes(self, n: int) -> Episodes | None:
        """A memory for n episodes side by side, none of which has begun; None: it asks for none.

        Of a bonus with a memory `score` raises ValueError, and `score_trajectory` takes an episode
        from its beginning.
        """
        return None

    def observe(self, observations: th.Tensor) -> None:
        """Take observations (n, ...) into statistics, if any."""
        return

    def update(
        self, before: th.Tensor, actions: th.Tensor, after: th.Tensor
    ) -> Mapping[str, float]:
        """One gradient step on a batch; the losses before it.

        Actions come as float32, (n, A) of a Box or (n, 1) of a Discrete.
        """

    def state_dict(self) -> dict[str, Any]:
        """All that a resumed run needs: a tree of arrays, tensors and plain values."""

    def load_state_dict(self, state: Mapping[str, Any], strict: bool = True) -> Any:
        """Take over what `state_dict` gave."""


def refuse_transitions(bonus: Bonus, before: Array, actions: Array, after: Any) -> Float32Array:
    """Raise ValueError: a transition alone has no bonus, see `episodes`."""
    raise ValueError(
        f"`bonus` must be asked for whole episodes: {bonus.name} remembers each of them."
    )


def check_needs_no_episodes(bonus: Bonus, holder: str) -> None:
    """Raise ValueError unless transitions that come in no order can be scored."""
    if bonus.episodes(1) is not None:
        raise ValueError(
            f"`bonus` must be one of single transitions in {holder}, {bonus.name} asks what an "
            "episode has seen before: take apt, disagreement, icm, ramp or rnd."
        )


class NetworkKeywords(TypedDict, total=False):
    """Keywords of every bonus of torch networks, see `NetworkBonus`."""

    learning_rate: float
    n_features: int
    hidden: int
    normalize: bool
    seed: int | None
    device: th.device | str


class NetworkBonus(HasSettings, th.nn.Module, Bonus):
    """A bonus of torch networks that one optimizer trains.

    A subclass makes its networks, calls `_begin`, and writes `losses` and `score`; where a
    trajectory can be scored at less cost than its transitions, `score_trajectory` too. Keywords are
    attributes, which stay as they were set.

    Args:
        observation_space: Box of 1-D observations, or of images as Stable-Baselines3 takes them
            (uint8, channels first or last, 4 by 4 at least).
        action_space: One-dimensional Box, whose entries are scaled to [-1, 1] where they have
            bounds, or Discrete. Some bonuses take it only to be made like others.
        learning_rate: Adam's, above 0.
        n_features: Length of the feature vector.
        hidden: Widths of hidden layers. The encoder of images is SB3's NatureCNN, or `SmallCNN`.
        normalize: Standardize observations, entry by entry, with running statistics of what was
            observed.
        seed: Of the initial weights and of all draws.
        device: As in Stable-Baselines3.

    Attributes:
        pool: Threads that may take part in a gradient step; who trains the bonus may give it more.

    Raises:
        ValueError: If an argument is out of range, or observations are neither of the two.
    """

    name: ClassVar[str]

    def __init__(
        self,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        *,
        learning_rate: float = 1e-3,
        n_features: int = 32,
        hidden: int = 64,
        normalize: bool = True,
        seed: int | None = None,
        device: th.device | str = "auto",
    ) -> None:
        super().__init__()
        check_positive(learning_rate=learning_rate)
        check_at_least_one(n_features=n_features, hidden=hidden)
        check_bool(normalize=normalize)
        check_seed(seed)
        self.learning_rate = learning_rate
        self.n_features = n_features
        self.hidden = hidden
        self.seed = seed
        self.device = torch_device(device)
        self.images = ImageInputs.of(observation_space)
        self.shape = tuple(observation_space.shape or ())
        n_entries = math.prod(self.shape)
        self.normalizer = RunningNormalizer(n_entries) if normalize else th.nn.Identity()
        self.pool = ThreadPool(1)

    def _begin(self) -> None:
        """Move the networks to their device, and train those with gradients from here on."""
        self.to(self.device)
        # Of this package's keywords: what a user's subclass has, it may change.
        own = [cls for cls in type(self).__mro__ if cls.__module__.startswith("curiosity_algos.")]
        self._settled = {name for cls in own for name in keyword_only(cls)} & vars(self).keys()
        trained = [each for each in self.parameters() if each.requires_grad]
        if not trained:
            raise ValueError(
                f"{type(self).__name__} must have a parameter that is trained, as a NetworkBonus "
                "has: a bonus without any is an object with the methods of `Bonus`."
            )
        self.optimizer = th.optim.Adam(trained, lr=self.learning_rate, fused=True)

    @abstractmethod
    def losses(self, before: th.Tensor, actions: th.Tensor, after: th.Tensor) -> Losses:
        """Mean losses of a batch, among them "loss", which is minimized."""

    def inputs(self, observations: th.Tensor) -> th.Tensor:
        """Observations (n, ...) as the networks take them: flat, or images with channels first."""
        standardized: th.Tensor = self.normalizer(self._flat(observations))
        return standardized if self.images is None else self.images.unflatten(standardized)

    def _flat(self, observations: th.Tensor) -> th.Tensor:
        if observations.shape[1:] != self.shape:  # images could be told apart by nothing else
            raise ValueError(
                f"`observations` must have shape {('n', *self.shape)}, got {observations.shape}."
            )
        flat = observations.flatten(1).float()
        return flat if self.images is None else flat / 255.0

    def tensor(self, array: Array) -> th.Tensor:
        """An array on the device of the networks."""
        return th.from_numpy(array).to(self.device)

    def observe(self, observations: th.Tensor) -> None:
        """Take observations (n, ...) into the statistics that standardize the inputs."""
        self._count(observations, self.normalizer)

    def _count(self, observations: th.Tensor, statistics: th.nn.Module) -> None:
        """Take observations (n, ...) into statistics, if inputs are to be standardized."""
        if isinstance(statistics, RunningNormalizer):
            statistics.observe(self._flat(observations.to(self.device)))

    def update(self, before: th.Tensor, actions: th.Tensor, after: th.Tensor) -> dict[str, float]:
        """One step of Adam on a batch; the losses before it."""
        batch = (x.to(self.device) for x in (before, actions, after))
        losses = self.differentiate(*batch)
        self.optimizer.step()
        return losses

    def differentiate(
        self, before: th.Tensor, actions: th.Tensor, after: th.Tensor
    ) -> dict[str, float]:
        """The losses of a batch; the gradient of "loss" goes where the optimizer finds it."""
        losses = self.losses(before, actions, after)
        self.optimizer.zero_grad(set_to_none=True)
        losses["loss"].backward()
        return {name: loss.item() for name, loss in losses.items()}

    # Torch's hints are of its overloads and of a plain module's tensors: the optimizer is in here.
    def state_dict(self, *args: Any, **kwargs: Any) -> dict[str, Any]:  # type: ignore[override]
        """Weights, statistics and the optimizer's moments."""
        state: dict[str, Any] = super().state_dict(*args, **kwargs)
        return copy.deepcopy({"modules": state, "optimizer": self.optimizer.state_dict()["state"]})

    # The hints of torch are of its overloads here too.
    def load_state_dict(self, state: Mapping[str, Any], *args: Any, **kwargs: Any) -> None:  # type: ignore[override]
        """Take over what `state_dict` gave; the learning rate stays the constructor's.

        Raises:
            ValueError: If it is that of another bonus, or of other networks.
        """
        check_keys(state, ("modules", "optimizer"))
        check_like(state["modules"], super().state_dict(), "modules")
        check_like(state["optimizer"], self._moments() if state["optimizer"] else {}, "optimizer")
        super().load_state_dict(state["modules"], *args, **kwargs)
        groups = self.optimizer.state_dict()["param_groups"]
        moments = copy.deepcopy(dict(state["optimizer"]))  # torch trains on in them
        self.optimizer.load_state_dict({"state": moments, "param_groups": groups})

    def _moments(self) -> dict[int, dict[str, th.Tensor]]:
        """Adam's state as it is built once it has made a step."""
        trained = [each.detach() for each in self.optimizer.param_groups[0]["params"]]
        names = ("exp_avg", "exp_avg_sq")
        return {i: {"step": th.zeros(()), **dict.fromkeys(names, x)} for i, x in enumerate(trained)}


def keyword_only(made: Any) -> list[str]:
    """What a class or a function takes by keyword alone, and names."""
    parameters = inspect.signature(made).parameters.values()
    return [each.name for each in parameters if each.kind is each.KEYWORD_ONLY]


LARGEST_OBSERVED = 1e18
"""Squares of larger numbers leave float32."""


def check_scores(scores: Array, *observations: Array) -> None:
    """Raise ValueError, which names who is at fault, unless scores of observations are finite."""
    if np.isfinite(scores).all():
        return
    for observed in observations:
        check_observations(observed)
    largest = max(float(np.abs(observed).max()) for observed in observations)
    if largest > LARGEST_OBSERVED:
        raise ValueError(
            f"`env` must give observations of at most {LARGEST_OBSERVED:g}, it gave {largest:g}."
        )
    raise ValueError("`bonus` must give finite scores, it gave others.")


def check_rewards(rewards: Array) -> None:
    """Raise ValueError unless the rewards of the task can be learned from."""
    if not np.isfinite(rewards).all():
        raise ValueError("`env` must give finite rewards, it gave NaN or infinity.")
