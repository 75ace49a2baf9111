"""The canonical evolution strategy, with or without a motivation beside the reward.

CanonicalES, CuriosityES and the novelty-search strategies are this class with another `Motivation`:
the paper compares nothing else.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from curiosity_algos.common.randomness import generator_state, load_generator_state
from curiosity_algos.evaluation.environments import env_id
from curiosity_algos.evaluation.evaluator import AnyEnv
from curiosity_algos.evaluation.policies import Float32Array, MlpPolicy
from curiosity_algos.evaluation.rollouts import Rollouts
from curiosity_algos.loops.arguments import check_parents
from curiosity_algos.loops.evolutionary_algorithm import EvolutionaryAlgorithm
from curiosity_algos.loops.presets import load_preset
from curiosity_algos.search.canonical import CanonicalSearch
from curiosity_gym.validation import check_choice, check_positive

Float64Array = npt.NDArray[np.float64]

STEPS = ("canonical", "paper")
NO_REWARD = ("ignore", "random")
LEARNING_RATE = 0.5
"""Where the tuned preset has none for the environment."""


class Motivation(Protocol):
    """What makes an individual interesting, beside reward."""

    def score(self, rollouts: Rollouts) -> Float64Array:
        """Intrinsic fitness of each individual, shape (P,)."""
        ...

    def update(self, rollouts: Rollouts) -> Mapping[str, float]:
        """Learn from the generation; metrics to log."""
        ...

    def state_dict(self) -> dict[str, Any]:
        """Everything that a resumed run needs."""
        ...

    def load_state_dict(self, state: Mapping[str, Any], strict: bool = True) -> None:
        """Take over what `state_dict` gave."""
        ...


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
        phi: Weight of the extrinsic fitness, in [0, 1].
        no_reward: What stands for the extrinsic fitness while no individual of a generation has a
            reward: "ignore": nothing, the intrinsic fitness ranks alone; "random": noise, as in the
            paper.
        seed: Seed of the noise.
    """

    def __init__(self, phi: float, no_reward: str, seed: np.random.SeedSequence) -> None:
        self.phi = phi
        self.no_reward = no_reward
        self._rng = np.random.default_rng(seed)

    def combine(self, extrinsic: Float64Array, intrinsic: Float64Array) -> Float64Array:
        """The fitness of each individual, shape (P,)."""
        if self.no_reward == "random" and not extrinsic.any():
            extrinsic = self._rng.standard_normal(len(extrinsic))
        return self.phi * standardize(extrinsic) + (1.0 - self.phi) * standardize(intrinsic)

    def state_dict(self) -> dict[str, Any]:
        """The state of the noise."""
        return {"rng": generator_state(self._rng)}

    def load_state_dict(self, state: Mapping[str, Any], strict: bool = True) -> None:
        """Take over what `state_dict` gave."""
        load_generator_state(self._rng, state["rng"])


class EvolutionStrategy(EvolutionaryAlgorithm):
    """Samples around one center and recombines the best (Chrabaszcz et al. 2018).

    Args:
        env: See `EvolutionaryAlgorithm`, as for every argument not named here.
        policy: Likewise.
        population_size: lambda, individuals a generation.
        n_parents: mu, the best of them that recombine, at most lambda.
        sigma: Standard deviation of the samples around the center, above 0.
        learning_rate: alpha, above 0: scales the center's step. None: that of the tuned preset for
            this environment, or 0.5.
        step: "canonical" or "paper" (divided by `sigma n_parents`).
        mirrored_sampling: Draw half of the population opposite to the other half.
        **kwargs: Passed on to `EvolutionaryAlgorithm`.
    """

    learning_rate: float
    phi: float = 1.0
    no_reward: str = "ignore"

    def __init__(
        self,
        env: AnyEnv | None,
        policy: str | type[MlpPolicy] = "MlpPolicy",
        *,
        population_size: int = 56,
        n_parents: int = 28,
        sigma: float = 0.3,
        learning_rate: float | None = None,
        step: str = "canonical",
        mirrored_sampling: bool = False,
        **kwargs: Any,
    ) -> None:
        self.population_size = population_size
        self.n_parents = n_parents
        self.sigma = sigma
        self.step = step
        self.mirrored_sampling = mirrored_sampling
        if learning_rate is None:
            tuned = load_preset("tuned", type(self).__name__, env_id(env))
            learning_rate = tuned.get("learning_rate", LEARNING_RATE)
        super().__init__(env, policy, _learning_rate=learning_rate, **kwargs)

    def _check_settings(self) -> None:
        super()._check_settings()
        check_parents(self.n_parents, self.population_size)
        check_positive(sigma=self.sigma, learning_rate=self.learning_rate)
        check_choice(STEPS, step=self.step)

    def _make_motivation(self, seed: np.random.SeedSequence) -> Motivation | None:
        """What the strategy is motivated by beside reward; None: nothing."""
        return None

    def _make_search(self, seed: np.random.SeedSequence) -> None:
        search_seed, fitness_seed, motivation_seed = seed.spawn(3)
        self._search = CanonicalSearch(
            self.policy.mlp.n_parameters,
            population_size=self.population_size,
            n_parents=self.n_parents,
            sigma=self.sigma,
            learning_rate=self.learning_rate,
            step=self.step,
            mirrored=self.mirrored_sampling,
            seed=search_seed,
        )
        self._fitness = Fitness(self.phi, self.no_reward, fitness_seed)
        self._motivation = self._make_motivation(motivation_seed)

    def _ask(self) -> Float32Array:
        return self._search.ask()

    def _tell(self, rollouts: Rollouts) -> Mapping[str, float]:
        metrics: dict[str, float] = {}
        intrinsic = np.zeros(len(rollouts))
        if self._motivation is not None:
            intrinsic = self._motivation.score(rollouts)
            metrics = {"intrinsic/mean": intrinsic.mean(), "intrinsic/max": intrinsic.max()}
            metrics |= self._motivation.update(rollouts)
        self._search.tell(self._fitness.combine(rollouts.returns, intrinsic))
        norm = float(np.linalg.norm(self._search.center))
        return {**metrics, "search/sigma": self.sigma, "search/norm": norm}

    def _center(self) -> Float32Array:
        return self._search.center.astype(np.float32)

    def _state_names(self) -> list[str]:
        motivation = [] if self._motivation is None else ["_motivation"]
        return ["_search", "_fitness", *motivation]
