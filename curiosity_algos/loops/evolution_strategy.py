"""Evolution strategies: a search that asks and is told, ranked by reward and by a motivation.

CanonicalES is the search alone; CuriosityES and NSES are `MotivatedStrategy` with another
`Motivation`: the paper compares nothing else.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from curiosity_algos.common.arrays import Float32Array, Float64Array
from curiosity_algos.evaluation.rollouts import Rollouts, Summarizer
from curiosity_algos.loops.declared import setting
from curiosity_algos.loops.evolutionary_algorithm import EvolutionaryAlgorithm
from curiosity_algos.motivations.base import Motivation
from curiosity_algos.motivations.fitness import Fitness, check_phi, standardize
from curiosity_algos.search.base import MakeSearch, Search
from curiosity_algos.search.canonical import CanonicalSearch
from curiosity_algos.search.normalized import MOMENTS, NormalizedSearch, moments
from curiosity_algos.state.tree import encode
from curiosity_gym.validation import (
    check_at_least_one,
    check_bool,
    check_choice,
    check_positive,
    check_whole,
)


def _constant(rate: Any) -> Any:
    """A number, which rl-zoo3 gives as a schedule."""
    return getattr(rate, "val", rate)


class EvolutionStrategy(EvolutionaryAlgorithm):
    """Asks a search for policies around its center, and tells it their fitness.

    Further keywords are those of `EvolutionaryAlgorithm`.

    Args:
        population_size: lambda, individuals a generation.
        n_parents: mu, the best that recombine, at most lambda; None: half of the population.
        sigma: Standard deviation of the samples around the center, above 0.
        learning_rate: alpha, above 0: scales the center's step.
        step: "canonical" or "paper" (divided by `sigma n_parents`).
        mirrored_sampling: Draw half of the population opposite to the other half.
        normalize_observations: Search among policies of observations that are standardized by the
            mean and deviation of each entry so far. These are worked into the first layer.
        search: None: the canonical search (Chrabaszcz et al. 2018), made of the settings above. A
            `Search` for as many parameters as the policy has, or a function of that number and of a
            `numpy.random.SeedSequence` that makes one, which the settings above do not touch.
            `load` takes it again.
    """

    population_size: int = setting(56, check_at_least_one, idle_with="search")
    n_parents: int | None = setting(None, idle_with="search")
    sigma: float = setting(0.3, check_positive, idle_with="search")
    learning_rate: float = setting(0.5, check_positive, convert=_constant, idle_with="search")
    step: str = setting(
        "canonical", partial(check_choice, ("canonical", "paper")), idle_with="search"
    )
    mirrored_sampling: bool = setting(False, check_bool, idle_with="search")
    normalize_observations: bool = setting(False, check_bool, fixed=True)
    search: Search | MakeSearch | None = setting(None, settled=True)
    _search: Search
    _inner_search: Search
    """The search without the standardization around it."""

    def _check_settings(self) -> None:
        super()._check_settings()
        check_whole(1, self.population_size, n_parents=self._n_parents)

    def _make_search(self, seed: np.random.SeedSequence) -> None:
        search_seed, *own_seeds = seed.spawn(3)
        self._search = self._inner_search = self._own_or_canonical(search_seed)
        if self.normalize_observations:
            self._search = NormalizedSearch(self._inner_search, self.policy.mlp)
        self._make_parts(*own_seeds)

    def _own_or_canonical(self, seed: np.random.SeedSequence) -> Search:
        n_parameters, search = self.policy.mlp.n_parameters, self.search
        if search is None:
            return CanonicalSearch(n_parameters, **self._search_settings, seed=seed)
        # A class has the methods too.
        is_made = isinstance(search, Search) and not isinstance(search, type)
        made: Any = search if is_made or not callable(search) else search(n_parameters, seed)
        if not isinstance(made, Search) or np.shape(made.center) != (n_parameters,):
            raise ValueError(
                f"`search` must be, or make, a Search with a center of the policy's {n_parameters} "
                f"parameters, got {made!r:.200}."
            )
        encode(made.state_dict(), {}, "search")  # raises where no file could hold it
        return made

    def _parts(self) -> dict[str, Any]:
        return {**super()._parts(), "search": self._search}

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
        return {MOMENTS: moments} if self.normalize_observations else {}

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


class MotivatedStrategy(EvolutionStrategy):
    """Ranks individuals by `phi z(return) + (1 - phi) z(intrinsic fitness)`.

    A subclass says what the intrinsic fitness is: `_make_motivation`. Further keywords are those of
    `EvolutionStrategy`.

    Args:
        learning_rate: alpha, above 0: scales the center's step. 1 leads to the weighted mean of the
            best mu, the default as far beyond: what is novel moves on.
        phi: Weight of the extrinsic fitness, in [0, 1]; "adaptive": it begins at .8, falls to 0
            while the best return stays, and rises with each better one (Conti et al. 2018).
        no_reward: "ignore" or "random": stand-in for the extrinsic fitness while a generation has
            no reward (the paper draws it at random).
    """

    learning_rate: float = setting(2.0, check_positive, convert=_constant, idle_with="search")
    phi: float | str = setting("adaptive", check_phi, part="_fitness")
    no_reward: str = setting("ignore", partial(check_choice, ("ignore", "random")), part="_fitness")

    @abstractmethod
    def _make_motivation(self, seed: np.random.SeedSequence) -> Motivation:
        """The strategy's motivation beside reward; everything random in it grows from `seed`."""

    def _make_parts(
        self, fitness_seed: np.random.SeedSequence, motivation_seed: np.random.SeedSequence
    ) -> None:
        self._fitness = Fitness(self.phi, self.no_reward, fitness_seed)
        self._motivation = self._make_motivation(motivation_seed)

    def _parts(self) -> dict[str, Any]:
        own = {"fitness": self._fitness, "motivation": self._motivation}
        return {**super()._parts(), **own}

    def _summarizers(self, n_individuals: int) -> Mapping[str, Summarizer] | None:
        own = self._motivation.summarizers(n_individuals)
        return None if own is None else {**own, **(super()._summarizers(n_individuals) or {})}

    def _forget_behaviors(self) -> None:
        self._fitness.forget()

    def _assess(self, rollouts: Rollouts) -> tuple[Float64Array, Mapping[str, float]]:
        self._intrinsic = intrinsic = self._motivation.score(rollouts)
        self._fitness.adapt(rollouts.returns.max())
        metrics = {
            "search/phi": self._fitness.weight,
            "intrinsic/mean": intrinsic.mean(),
            "intrinsic/max": intrinsic.max(),
        }
        learned = self._motivation.update(rollouts)
        return self._fitness.combine(rollouts.returns, intrinsic), {**metrics, **learned}
