"""The archive, and pyribs' emitters that fill it, of all quality-diversity algorithms."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from ribs.emitters import EmitterBase, GaussianEmitter
from ribs.schedulers import Scheduler

from curiosity_algos.archives.base import EliteArchive
from curiosity_algos.archives.unstructured import UnstructuredArchive
from curiosity_algos.common.arrays import Array, Float32Array, Float64Array
from curiosity_algos.common.randomness import integer_seed
from curiosity_algos.evaluation.rollouts import Rollouts, Summarizer
from curiosity_algos.loops.declared import setting
from curiosity_algos.loops.evolutionary_algorithm import EvolutionaryAlgorithm
from curiosity_algos.search.canonical import INITIAL_DEVIATION
from curiosity_algos.search.emitters import Emitters, set_mutations
from curiosity_gym.validation import check_at_least_one, check_positive

Fields = dict[str, Array]
FieldTypes = dict[str, tuple[Any, Any]]

POPULATION_SIZE = 56


MakeEmitters = Callable[[EliteArchive, Float32Array, int], list[EmitterBase]]
"""From the archive, the parameters to begin at (n_parameters,) and a seed to pyribs' emitters."""


class QualityDiversity(EvolutionaryAlgorithm):
    """Emits policies, and keeps those that are new or better than their like.

    A subclass says which archive (`_make_archive`) and which emitter (`_make_emitter`). It may say
    what places a policy in the archive (`_measures`, `_measure_dim`) and what is kept of each elite
    (`_fields`, `_field_types`). Further keywords are those of `EvolutionaryAlgorithm`.

    Args:
        population_size: Policies a generation. With `emitters` it is the sum of their batch sizes,
            and may be left out; the default counts as left out there.
        sigma: Standard deviation of mutations, above 0; `emitters` have their own.
        archive: Keeps the elites, instead of the algorithm's own archive: one of
            `curiosity_algos.archives`, whose `solution_dim` and `measure_dim` are the algorithm's;
            for NSLC and AURORA one without cells. The search begins with its elites. An empty one
            is made to keep what the algorithm keeps of each elite. Its draws follow the `seed` of
            the last model that took it. `set_env` empties it where behaviors are others, as in
            another maze: `save` it before. `load` takes it again.
        emitters: A function of the archive, the parameters to begin at (n_parameters,) and a seed,
            a whole number, that returns a list of pyribs' emitters on that archive, instead of the
            algorithm's own emitter with its settings. `load` takes it again.

    Attributes:
        archive: The elites; of each is kept the parameters, the return, what places it, and the
            seed of its episode.

    Raises:
        ValueError: If an argument is out of its range, or `archive` or `emitters` do not fit.
    """

    archive: Any = setting(None, settled=True)
    archive_class: ClassVar[Any] = EliteArchive
    """Archives that the algorithm can work on."""
    population_size: int = setting(POPULATION_SIZE, check_at_least_one, idle_with="emitters")
    sigma: float = setting(0.3, check_positive, idle_with="emitters")
    emitters: MakeEmitters | None = setting(None, settled=True)
    _own_archive: EliteArchive | None

    @abstractmethod
    def _make_archive(self, seed: np.random.SeedSequence) -> EliteArchive:
        """The algorithm's own archive, empty."""

    def _make_emitter(self, x0: Float32Array, seed: int) -> EmitterBase:
        """The emitter for `self.archive`, from `x0` (n_parameters,); else of uniform parents."""
        return GaussianEmitter(
            self.archive, sigma=self.sigma, x0=x0, batch_size=self.population_size, seed=seed
        )

    def _steer(self, emitter: Any) -> None:
        """Give the algorithm's own emitter the settings as they are now."""
        set_mutations(emitter, sigma=self.sigma, batch_size=self.population_size)

    def _measures(self, rollouts: Rollouts) -> Float64Array:
        """The place of each individual in the archive, (P, measure_dim)."""
        return rollouts.behaviors

    def _measure_dim(self, space: spaces.Box[Any] | None) -> int:
        """Length of `_measures`, where behaviors lie in `space`."""
        return 0 if space is None else int(space.shape[0])

    def _field_types(self) -> FieldTypes:
        """Name: (shape, dtype) of what `_fields` gives of each elite."""
        return {"seed": ((), np.int64)}

    def _fields(self, rollouts: Rollouts) -> Fields:
        """The extra fields of each individual, an array (P, ...) for each of them."""
        fields: Fields = {"seed": np.full(len(rollouts), self._episode_seed)}
        if "behavior" in self.archive.field_list:
            fields["behavior"] = rollouts.behaviors[:, : self._n_behaviors]
        return fields

    @property
    def _n_behaviors(self) -> int:
        """B, the length of the environment's behavior; 0 where it has none."""
        return 0 if self._behavior_space is None else int(self._behavior_space.shape[0])

    def _archive_kwargs(self, seed: np.random.SeedSequence) -> dict[str, Any]:
        """Keywords of every archive of policies."""
        return {
            "solution_dim": self.policy.mlp.n_parameters,
            "seed": seed,
            "solution_dtype": np.float32,
            "extra_fields": self._field_types(),
            "net_arch": self.policy.net_arch,
        }

    def _summarizers(self, n_individuals: int) -> Mapping[str, Summarizer] | None:
        return {}

    def _check_settings(self) -> None:
        super()._check_settings()
        if not isinstance(self._own_archive, self.archive_class | None):
            raise ValueError(
                f"`archive` must be of the class {self.archive_class.__name__} of "
                f"curiosity_algos.archives, got {type(self._own_archive).__name__}."
            )
        if not (self.emitters is None or callable(self.emitters)):
            raise ValueError(
                "`emitters` must be None or a function that makes pyribs' emitters, got "
                f"{self.emitters!r:.60}."
            )
        self._check_behaviors(self._behavior_space)

    def _check_behaviors(self, space: spaces.Box[Any] | None) -> None:
        if self._own_archive is not None:
            n_measures = self._measure_dim(space)
            if self._own_archive.measure_dim != n_measures:
                raise ValueError(
                    f"`archive` must have a `measure_dim` of {n_measures}, as what places a policy "
                    f"in it, got {self._own_archive.measure_dim}."
                )

    def _check_begins_empty(self) -> None:
        """Raise ValueError where an archive has elites, whose places are another encoder's."""
        if not (self._own_archive is None or self._own_archive.empty):
            raise ValueError(
                "`archive` must be empty, as its places come from an encoder that is trained anew, "
                f"got {len(self._own_archive)} elites."
            )

    def _make_search(self, seed: np.random.SeedSequence) -> None:
        self._begin_archive(seed)
        self._later_seeds = np.random.default_rng(seed.spawn(1)[0])

    def _later_seed(self) -> np.random.SeedSequence:
        """The seed of what begins anew in the course of the search."""
        return np.random.SeedSequence(int(self._later_seeds.integers(2**63)))

    def _begin_archive(self, seed: np.random.SeedSequence) -> None:
        """Hold the archive, and emitters that begin anew."""
        start_seed, archive_seed, emitter_seed = seed.spawn(3)
        start = np.random.default_rng(start_seed)
        x0 = INITIAL_DEVIATION * start.standard_normal(self.policy.mlp.n_parameters)
        if self._own_archive is None:
            vars(self)["archive"] = self._make_archive(archive_seed)
        else:
            vars(self)["archive"] = self._own_archive
            self._prepare_own(self._own_archive, archive_seed)
        self._emitters = self._make_emitters(x0.astype(np.float32), integer_seed(emitter_seed))

    def _prepare_own(self, archive: EliteArchive, seed: np.random.SeedSequence) -> None:
        """Make the user's archive keep policies of this search."""
        n_parameters, net_arch = self.policy.mlp.n_parameters, self.policy.net_arch
        if archive.solution_dim != n_parameters or archive.net_arch not in (None, net_arch):
            raise ValueError(
                f"`archive` must hold policies of {n_parameters} parameters with the hidden layers "
                f"{net_arch}, got {archive.solution_dim} and {archive.net_arch}."
            )
        archive.prepare(self._field_types(), net_arch, seed)

    def _make_emitters(self, x0: Float32Array, seed: int) -> Emitters:
        """The algorithm's own emitter, or those of the user's function."""
        if self.emitters is None:
            return Emitters([self._make_emitter(x0, seed)], self.archive, x0)
        emitters = Emitters(self.emitters(self.archive, x0, seed), self.archive, x0)
        emitters.state_dict()  # raises where no checkpoint could hold them
        if self.population_size not in (POPULATION_SIZE, emitters.batch_size):
            raise ValueError(
                f"`population_size` must be the {emitters.batch_size} policies that `emitters` "
                f"emit, or be left out, got {self.population_size}."
            )
        vars(self)["population_size"] = emitters.batch_size
        return emitters

    def _put_in_force(self) -> None:
        super()._put_in_force()
        if self.emitters is None:
            self._steer(self._emitters.emitters[0])

    def _ask(self) -> Float32Array:
        # Made anew each time: after an env's error the old one would wait for what never comes.
        self._scheduler = Scheduler(self.archive, self._emitters.emitters)
        return self._scheduler.ask().astype(np.float32)

    def _tell(self, rollouts: Rollouts) -> Mapping[str, float]:
        measures, fields = self._measures(rollouts), self._fields(rollouts)
        self._scheduler.tell(rollouts.returns, measures, **fields)
        stats = self.archive.stats
        if isinstance(self.archive, UnstructuredArchive):
            own = {"archive/threshold": self.archive.threshold}
        else:
            own = {"archive/coverage": float(stats.coverage)}
        if self.emitters is None:
            own["search/sigma"] = self._step_size()
        return {
            "archive/size": len(self.archive),
            "archive/qd_score": float(stats.qd_score),
            "archive/best": float(np.float64(stats.obj_max)),  # NaN where no policy was kept
            **own,
        }

    def _step_size(self) -> float:
        """Standard deviation of the mutations of the algorithm's own emitter."""
        return self.sigma

    def _center(self) -> Float32Array:
        best = self.archive.best_elite
        center: Float32Array = self._emitters.x0 if best is None else best["solution"]
        return center.astype(np.float32)

    def _forget_behaviors(self) -> None:
        if self._own_archive is not None:
            self._own_archive.clear()
        self._begin_archive(self._later_seed())

    def _parts(self) -> dict[str, Any]:
        return {
            "archive": self.archive,
            **super()._parts(),
            "emitters": self._emitters,
            "later_seeds": self._later_seeds,
        }

    def predict(
        self,
        observation: Array | dict[str, Array],
        state: tuple[Array, ...] | None = None,
        episode_start: Array | None = None,
        deterministic: bool = False,
        niche: npt.ArrayLike | None = None,
    ) -> tuple[Array, tuple[Array, ...] | None]:
        """Actions of the best policy, or of the elite nearest to a behavior.

        Args:
            observation: As in SB3.
            state: Unused, like the next two.
            episode_start: See `state`.
            deterministic: See `state`.
            niche: (B,) behavior that the elite should come to; there must be elites.
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
