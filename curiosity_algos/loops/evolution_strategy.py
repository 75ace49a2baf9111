"""Evolution strategies: a search that asks and is told, ranked by reward and by a motivation.

CanonicalES is the search alone; CuriosityES and NSES are `MotivatedStrategy` with another
`Motivation`: the paper compares nothing else.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, TypeGuard, Unpack

import numpy as np
from stable_baselines3.common.utils import ConstantSchedule

from curiosity_algos.common.arrays import Float32Array, Float64Array
from curiosity_algos.common.randomness import generator_state, load_generator_state
from curiosity_algos.evaluation.evaluator import AnyEnv
from curiosity_algos.evaluation.policies import MlpPolicy
from curiosity_algos.evaluation.rollouts import Rollouts, Summarizer
from curiosity_algos.loops.evolutionary_algorithm import AlgorithmKeywords, EvolutionaryAlgorithm
from curiosity_algos.motivations.base import Motivation
from curiosity_algos.motivations.phi import Phi, check_phi
from curiosity_algos.search.base import MakeSearch, Search
from curiosity_algos.search.canonical import CanonicalSearch
from curiosity_algos.search.normalized import MOMENTS, NormalizedSearch, moments
from curiosity_algos.state.check import check_like
from curiosity_algos.state.tree import encode
from curiosity_gym.validation import (
    check_at_least_one,
    check_bool,
    check_choice,
    check_positive,
    check_whole,
)


def standardize(values: Float64Array) -> Float64Array:
    """Values with mean 0 and deviation 1; all 0 where they do not differ."""
    deviation = values.std()
    # Equal values may leave a rounding in their deviation; dividing by it would invent a ranking.
    if deviation <= 1e-12 * max(1.0, float(np.abs(values).max())):
        return np.zeros_like(values)
    standardized: Float64Array = (values - values.mean()) / deviation
    return standardized


class Fitness:
    """`phi z(f_e) + (1 - phi) z(f_i)`, z standardizing within the generation (section 3).

    Args:
        phi: Weight of the extrinsic fitness.
        no_reward: Stand-in for the extrinsic fitness while no individual of a generation has a
            reward: "ignore": none, the intrinsic fitness ranks alone; "random": noise, as in the
            paper.
        seed: Seed of the noise.
    """

    def __init__(self, phi: Phi, no_reward: str, seed: np.random.SeedSequence) -> None:
        self.phi = phi
        self.no_reward = no_reward
        self._rng = np.random.default_rng(seed)

    def combine(self, extrinsic: Float64Array, intrinsic: Float64Array) -> Float64Array:
        """The fitness of each individual, shape (P,)."""
        if self.no_reward == "random" and not extrinsic.any():
            extrinsic = self._rng.standard_normal(len(extrinsic))
        phi = self.phi.value
        return phi * standardize(extrinsic) + (1.0 - phi) * standardize(intrinsic)

    def state_dict(self) -> dict[str, Any]:
        """The states of the weight and of the noise."""
        return {**self.phi.state_dict(), "rng": generator_state(self._rng)}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave."""
        check_like(state, self.state_dict() | Phi(0.0).state_dict(), "fitness")
        self.phi.load_state_dict(state)
        load_generator_state(self._rng, state["rng"])


def _is_search(thing: object) -> TypeGuard[Search]:
    return isinstance(thing, Search) and not isinstance(thing, type)  # a class has the methods too


_OF_SEARCH = {
    *("population_size", "n_parents", "sigma", "learning_rate", "step", "mirrored_sampling")
}
"""Settings of the canonical search, without effect on another."""


class StrategyKeywords(AlgorithmKeywords, total=False):
    """Keywords of every evolution strategy but the learning rate, see `EvolutionStrategy`."""

    population_size: int
    n_parents: int | None
    sigma: float
    step: str
    mirrored_sampling: bool
    normalize_observations: bool
    search: Search | MakeSearch | None


class EvolutionStrategy(EvolutionaryAlgorithm):
    """Asks a search for policies around its center, and tells it their fitness.

    Further keywords are those of every algorithm, see `EvolutionaryAlgorithm`.

    Args:
        population_size: lambda, individuals a generation.
        n_parents: mu, the best of them that recombine, at most lambda; None: half of the
            population.
        sigma: Standard deviation of the samples around the center, above 0.
        learning_rate: alpha, above 0: scales the center's step.
        step: "canonical" or "paper" (divided by `sigma n_parents`).
        mirrored_sampling: Draw half of the population opposite to the other half.
        normalize_observations: Search among policies of observations that are standardized by the
            mean and deviation of each entry so far. These are worked into the first layer: files
            and `predict` are as without. For entries of different scales, as velocities of robots.
        search: None: the canonical search (Chrabaszcz et al. 2018), made of the settings above. A
            `Search` for as many parameters as the policy has, or a function of that number and of a
            `numpy.random.SeedSequence` that makes one: the settings above, `population_size` among
            them, are then its own affair. `load` takes it again.
    """

    learning_rate: float
    _search: Search

    def __init__(
        self,
        env: AnyEnv | None,
        policy: str | type[MlpPolicy] = "MlpPolicy",
        *,
        population_size: int = 56,
        n_parents: int | None = None,
        sigma: float = 0.3,
        learning_rate: float = 0.5,
        step: str = "canonical",
        mirrored_sampling: bool = False,
        normalize_observations: bool = False,
        search: Search | MakeSearch | None = None,
        **kwargs: Unpack[AlgorithmKeywords],
    ) -> None:
        self.population_size = population_size
        self.n_parents = n_parents
        self.sigma = sigma
        self.step = step
        self.mirrored_sampling = mirrored_sampling
        self.normalize_observations = normalize_observations
        self.search = search
        if isinstance(learning_rate, ConstantSchedule):  # as rl-zoo3 gives numbers
            learning_rate = learning_rate.val
        super().__init__(env, policy, _learning_rate=learning_rate, **kwargs)

    def _check_settings(self) -> None:
        super()._check_settings()
        check_at_least_one(population_size=self.population_size)
        check_whole(1, self.population_size, n_parents=self._n_parents)
        check_positive(sigma=self.sigma, learning_rate=self.learning_rate)
        check_choice(("canonical", "paper"), step=self.step)
        check_bool(mirrored_sampling=self.mirrored_sampling)
        check_bool(normalize_observations=self.normalize_observations)
        if not (self.search is None or _is_search(self.search) or callable(self.search)):
            raise ValueError(
                "`search` must be None, a Search, or a function that makes one, got "
                f"{self.search!r}."
            )

    def _make_search(self, seed: np.random.SeedSequence) -> None:
        search_seed, *own_seeds = seed.spawn(3)
        make: Any = self._canonical_search if self.search is None else self.search
        made = make if _is_search(make) else make(self.policy.mlp.n_parameters, search_seed)
        self._check_search(made)
        is_normalized = self.normalize_observations
        self._search = NormalizedSearch(made, self.policy.mlp) if is_normalized else made
        self._make_parts(*own_seeds)

    def _check_search(self, search: object) -> None:
        n_parameters = self.policy.mlp.n_parameters
        if not _is_search(search):
            raise ValueError(f"`search` must make a Search, got {search!r}.")
        if np.shape(search.center) != (n_parameters,):
            raise ValueError(
                f"`search` must have a center of the policy's {n_parameters} parameters, got one "
                f"of shape {np.shape(search.center)}."
            )
        encode(search.state_dict(), {}, "search")  # raises where no file could hold it

    def _parts(self) -> dict[str, Any]:
        return {**super()._parts(), "search": self._search}

    def _kinds(self) -> dict[str, str]:
        return {"search": "none" if self.search is None else type(self._inner_search).__name__}

    @property
    def _inner_search(self) -> Search:
        """The search without the standardization around it."""
        search = self._search
        return search.search if isinstance(search, NormalizedSearch) else search

    @classmethod
    def _fixed_settings(cls) -> set[str]:
        return super()._fixed_settings() | {"normalize_observations"}

    def _settings_of_parts(self) -> set[str]:
        of_search = {"search"} | (set() if self.search is None else _OF_SEARCH)
        return super()._settings_of_parts() | of_search

    @property
    def _n_parents(self) -> int:
        """The number of them, mu."""
        half = max(1, self.population_size // 2)
        return half if self.n_parents is None else self.n_parents

    @property
    def _search_settings(self) -> dict[str, Any]:
        """Settings of the canonical search, by its names."""
        return {
            "population_size": self.population_size,
            "n_parents": self._n_parents,
            "sigma": self.sigma,
            "learning_rate": self.learning_rate,
            "step": self.step,
            "mirrored": self.mirrored_sampling,
        }

    def _canonical_search(self, n_parameters: int, seed: np.random.SeedSequence) -> Search:
        return CanonicalSearch(n_parameters, **self._search_settings, seed=seed)

    def _put_in_force(self) -> None:
        super()._put_in_force()
        if self.search is None:
            vars(self._inner_search).update(self._search_settings)

    def _make_parts(
        self, fitness_seed: np.random.SeedSequence, motivation_seed: np.random.SeedSequence
    ) -> None:
        """Create what is held beside the search; a strategy that has nothing draws nothing."""

    def _assess(self, rollouts: Rollouts) -> tuple[Float64Array, Mapping[str, float]]:
        """Fitness of each individual, shape (P,), and metrics to log."""
        return standardize(rollouts.returns), {}

    def _summarizers(self, n_individuals: int) -> Mapping[str, Summarizer] | None:
        own = self._own_summarizers(n_individuals)
        if own is None or not isinstance(self._search, NormalizedSearch):
            return own
        return {**own, MOMENTS: moments}

    def _own_summarizers(self, n_individuals: int) -> Mapping[str, Summarizer] | None:
        """What `_assess` reads of trajectories, see `_summarizers`."""
        return {}

    def _ask(self) -> Float32Array:
        return self._search.ask()

    def _tell(self, rollouts: Rollouts) -> Mapping[str, float]:
        fitness, metrics = self._assess(rollouts)
        self._search.tell(fitness)
        if isinstance(self._search, NormalizedSearch):
            self._search.observe(rollouts)
        own = {"search/sigma": self.sigma} if self.search is None else {}
        return {**metrics, **own, "search/norm": float(np.linalg.norm(self._search.center))}

    def _center(self) -> Float32Array:
        return np.asarray(self._search.center, dtype=np.float32)

    def _begin_at(self, parameters: Float32Array) -> None:
        if self.search is not None:
            raise ValueError(
                "`policy` cannot be set alone where `search` was given: let it begin there."
            )
        self._search.center = parameters.astype(np.float64)  # type: ignore[misc]


class MotivatedKeywords(StrategyKeywords, total=False):
    """Keywords of strategies with a motivation, see `MotivatedStrategy`."""

    learning_rate: float
    phi: float | str
    no_reward: str


class MotivatedStrategy(EvolutionStrategy):
    """Ranks individuals by `phi z(return) + (1 - phi) z(intrinsic fitness)`.

    A subclass says what the intrinsic fitness is: `_make_motivation`. Further keywords are those of
    `EvolutionStrategy` and `EvolutionaryAlgorithm`.

    Args:
        learning_rate: alpha, above 0: scales the center's step. 1 leads to the weighted mean of the
            best mu, the default as far beyond: what is novel moves on.
        phi: Weight of the extrinsic fitness, in [0, 1]; "adaptive": it begins at .8, falls to 0
            while the best return stays, and rises with each better one (Conti et al. 2018). The
            paper's is .8.
        no_reward: "ignore" or "random": stand-in for the extrinsic fitness while a generation has
            no reward (the paper draws it at random).
    """

    def __init__(
        self,
        env: AnyEnv | None,
        policy: str | type[MlpPolicy] = "MlpPolicy",
        *,
        learning_rate: float = 2.0,
        phi: float | str = "adaptive",
        no_reward: str = "ignore",
        **kwargs: Unpack[StrategyKeywords],
    ) -> None:
        self.phi = phi
        self.no_reward = no_reward
        super().__init__(env, policy, learning_rate=learning_rate, **kwargs)

    @abstractmethod
    def _make_motivation(self, seed: np.random.SeedSequence) -> Motivation:
        """The strategy's motivation beside reward; everything random in it grows from `seed`."""

    def _check_settings(self) -> None:
        super()._check_settings()
        check_phi(self.phi)
        check_choice(("ignore", "random"), no_reward=self.no_reward)

    def _make_parts(
        self, fitness_seed: np.random.SeedSequence, motivation_seed: np.random.SeedSequence
    ) -> None:
        self._fitness = Fitness(Phi(self.phi), self.no_reward, fitness_seed)
        self._motivation = self._make_motivation(motivation_seed)

    def _put_in_force(self) -> None:
        super()._put_in_force()
        self._fitness.no_reward, self._fitness.phi.setting = self.no_reward, self.phi

    def _parts(self) -> dict[str, Any]:
        own = {"fitness": self._fitness, "motivation": self._motivation}
        return {**super()._parts(), **own}

    def _own_summarizers(self, n_individuals: int) -> Mapping[str, Summarizer] | None:
        return self._motivation.summarizers(n_individuals)

    def _forget_behaviors(self) -> None:
        self._fitness.phi.forget()

    def _assess(self, rollouts: Rollouts) -> tuple[Float64Array, Mapping[str, float]]:
        self._intrinsic = intrinsic = self._motivation.score(rollouts)
        self._fitness.phi.adapt(rollouts.returns.max())
        metrics = {
            "search/phi": self._fitness.phi.value,
            "intrinsic/mean": intrinsic.mean(),
            "intrinsic/max": intrinsic.max(),
        }
        learned = self._motivation.update(rollouts)
        return self._fitness.combine(rollouts.returns, intrinsic), {**metrics, **learned}
