"""What the quality-diversity algorithms share: an archive, and pyribs' emitters that fill it."""

from __future__ import annotations

import inspect
import io
import os
from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from ribs.emitters import EmitterBase, GaussianEmitter
from ribs.schedulers import Scheduler

from curiosity_algos.archives.base import EliteArchive
from curiosity_algos.archives.history import ArchiveHistory
from curiosity_algos.archives.unstructured import UnstructuredArchive
from curiosity_algos.common.foreign_state import ForeignPart
from curiosity_algos.common.randomness import integer_seed
from curiosity_algos.evaluation.evaluator import AnyEnv
from curiosity_algos.evaluation.policies import Float32Array, MlpPolicy
from curiosity_algos.evaluation.rollouts import Rollouts
from curiosity_algos.loops.evolutionary_algorithm import EvolutionaryAlgorithm
from curiosity_algos.search.canonical import INITIAL_DEVIATION
from curiosity_gym.validation import check_at_least_one, check_positive

Fields = dict[str, npt.NDArray[Any]]


class QualityDiversity(EvolutionaryAlgorithm):
    """Emits policies, and keeps those that are new or better than their like.

    A subclass says which archive and which emitter: `_make_archive` and `_make_emitter`; and, where
    they are others, what places a policy in the archive (`_measures`) and what is kept of it
    (`_fields`).

    Args:
        population_size: Policies a generation.
        sigma: Standard deviation of mutations, above 0.

    Attributes:
        archive: The elites; of each is kept the parameters, the return, what places it, and the
            seed of its episode.
        history: The archive's statistics after each generation.
    """

    archive: EliteArchive

    def __init__(
        self,
        env: AnyEnv | None,
        policy: str | type[MlpPolicy] = "MlpPolicy",
        *,
        population_size: int = 56,
        sigma: float = 0.3,
        **kwargs: Any,
    ) -> None:
        self.population_size = population_size
        self.sigma = sigma
        super().__init__(env, policy, **kwargs)

    # -- what an algorithm writes ---------------------------------------------------------------

    @abstractmethod
    def _make_archive(self, seed: np.random.SeedSequence) -> EliteArchive:
        """An empty archive."""

    def _make_emitter(self, x0: Float32Array, seed: int) -> EmitterBase:
        """What emits policies for `self.archive`, beginning at `x0` (n_parameters,).

        Mutants of elites drawn uniformly, where an algorithm says nothing else.
        """
        return GaussianEmitter(
            self.archive, sigma=self.sigma, x0=x0, batch_size=self.population_size, seed=seed
        )

    def _measures(self, rollouts: Rollouts) -> npt.NDArray[np.float64]:
        """What places each individual in the archive, (P, measure_dim)."""
        return rollouts.behaviors

    def _fields(self, rollouts: Rollouts) -> Fields:
        """What is kept of each individual, an array (P, ...) for each extra field."""
        fields: Fields = {"seed": np.full(len(rollouts), self._episodes.current)}
        if "behavior" in self.archive.field_list:
            fields["behavior"] = rollouts.behaviors[:, : self._n_behaviors]
        return fields

    @property
    def _n_behaviors(self) -> int:
        """B, the length of the environment's behavior; 0 where it has none."""
        return 0 if self._behavior_space is None else int(self._behavior_space.shape[0])

    # -- the search -----------------------------------------------------------------------------

    def _check_settings(self) -> None:
        super()._check_settings()
        check_at_least_one(population_size=self.population_size)
        check_positive(sigma=self.sigma)

    def _make_search(self, seed: np.random.SeedSequence) -> None:
        self._begin_archive(seed)

    def _begin_archive(self, seed: np.random.SeedSequence) -> None:
        """Hold an empty archive, and an emitter that begins anew."""
        start_seed, archive_seed, emitter_seed = seed.spawn(3)
        start = np.random.default_rng(start_seed)
        x0 = INITIAL_DEVIATION * start.standard_normal(self.policy.mlp.n_parameters)
        self.archive = self._make_archive(archive_seed)
        self.history = ArchiveHistory()
        emitter = self._make_emitter(x0.astype(np.float32), integer_seed(emitter_seed))
        self._emitter = ForeignPart(emitter)

    def _ask(self) -> Float32Array:
        # Made anew each time: after an env's error the old one would wait for what never comes.
        self._scheduler = Scheduler(self.archive, [self._emitter.part])
        asked: Float32Array = self._scheduler.ask().astype(np.float32)
        return asked

    def _tell(self, rollouts: Rollouts) -> Mapping[str, float]:
        measures, fields = self._measures(rollouts), self._fields(rollouts)
        self._scheduler.tell(rollouts.returns, measures, **fields)
        stats = self.archive.stats
        self.history.record(rollouts.timesteps, stats)
        assert stats.obj_max is not None
        if isinstance(self.archive, UnstructuredArchive):
            own = {"archive/threshold": self.archive.threshold}
        else:
            own = {"archive/coverage": float(stats.coverage)}
        return {
            "archive/size": len(self.archive),
            "archive/qd_score": float(stats.qd_score),
            "archive/best": float(stats.obj_max),
            "search/sigma": self._step_size(),
            **own,
        }

    def _step_size(self) -> float:
        """Standard deviation of the mutations."""
        return self.sigma

    def _center(self) -> Float32Array:
        best = self.archive.best_elite
        center: Float32Array = self._emitter.part.x0 if best is None else best["solution"]
        return center.astype(np.float32)

    def _forget_behaviors(self) -> None:
        self._begin_archive(np.random.SeedSequence(self._episodes.draw()))

    def _excluded_save_params(self) -> list[str]:
        return [*super()._excluded_save_params(), "_scheduler"]

    @classmethod
    def load(
        cls,
        path: str | os.PathLike[str] | io.BufferedIOBase,
        env: AnyEnv | None = None,
        *args: Any,
        **kwargs: Any,
    ) -> Self:
        """Load a model, see `EvolutionaryAlgorithm.load`.

        Raises:
            ValueError: Also if `kwargs` would replace a setting that archive or emitter were made
                with.
        """
        ours = cls.__mro__[: cls.__mro__.index(EvolutionaryAlgorithm)]
        fixed = {name for each in ours for name in inspect.signature(each).parameters}
        fixed -= inspect.signature(EvolutionaryAlgorithm).parameters.keys()
        for name in sorted(fixed & (kwargs | (kwargs.get("custom_objects") or {})).keys()):
            raise ValueError(f"`{name}` must be left as it was saved: make a new {cls.__name__}.")
        return super().load(path, env, *args, **kwargs)

    # -- acting ---------------------------------------------------------------------------------

    def predict(
        self,
        observation: npt.NDArray[Any] | dict[str, npt.NDArray[Any]],
        state: tuple[npt.NDArray[Any], ...] | None = None,
        episode_start: npt.NDArray[Any] | None = None,
        deterministic: bool = False,
        niche: npt.ArrayLike | None = None,
    ) -> tuple[npt.NDArray[Any], tuple[npt.NDArray[Any], ...] | None]:
        """Actions of the best policy, or of the elite nearest to a behavior.

        Args:
            observation: As in SB3, like the next three.
            state: Unused.
            episode_start: Unused.
            deterministic: Unused, policies draw nothing.
            niche: (B,) behavior that the elite should come to, in the environment's units.

        Raises:
            ValueError: If `niche` is no behavior, or there are no elites yet.
        """
        if niche is None:
            return super().predict(observation, state, episode_start, deterministic)
        elite = self.archive.nearest(niche)
        acting = self.policy.vector.copy()
        self.policy.vector[:] = elite
        try:
            return super().predict(observation, state, episode_start, deterministic)
        finally:
            self.policy.vector[:] = acting
