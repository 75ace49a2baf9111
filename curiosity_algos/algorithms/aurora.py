"""AURORA: quality diversity in a behavior space that an autoencoder learns from trajectories.

Cully 2019 (https://arxiv.org/abs/1905.11874); Grillotti & Cully 2022
(https://arxiv.org/abs/2106.05648) for the archive that keeps its size; the paper's section 4.3.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium import spaces

from curiosity_algos.archives.trajectory_encoder import TrajectoryEncoder
from curiosity_algos.archives.unstructured import UnstructuredArchive
from curiosity_algos.common.arrays import Float32Array, Float64Array
from curiosity_algos.evaluation.rollouts import Rollouts, Summarizer
from curiosity_algos.loops.declared import setting
from curiosity_algos.loops.quality_diversity import Fields, FieldTypes, QualityDiversity
from curiosity_gym.validation import check_at_least_one, check_positive, check_share


class AURORA(QualityDiversity):
    """Mutates elites that lie apart in what an autoencoder makes of their trajectories.

    The archive keeps its size by a rule of ours, see `UnstructuredArchive`. Grillotti & Cully steer
    the distance by the number of elites instead.

    The autoencoder is trained on the archive and the generation: in the first generation, after
    `training_interval` generations, and whenever their number has doubled since. After each
    training all elites are encoded anew. So an `archive` must be empty at the beginning.

    Further keywords are those of `QualityDiversity`.

    Args:
        latent_size: Dimensions of the learned behavior space.
        trajectory_share: Share of a trajectory's states, evenly spaced, that the autoencoder sees;
            the number is that of the first generation's longest episode.
        archive_size: Elites held, within 10 %; an `archive` holds its `target_size` instead.
        training_interval: Generations between two trainings at first, see above.
        n_epochs: Passes over the data in a training.
        ae_learning_rate: Adam's learning rate in the autoencoder.
        batch_size: Trajectories a gradient step.
    """

    archive: UnstructuredArchive
    archive_class = UnstructuredArchive
    latent_size: int = setting(10, check_at_least_one, fixed=True)
    trajectory_share: float = setting(0.4, check_share, fixed=True)
    archive_size: int = setting(1000, check_at_least_one, idle_with="archive")
    training_interval: int = setting(10, check_at_least_one)
    n_epochs: int = setting(10, check_at_least_one, part="_encoder")
    ae_learning_rate: float = setting(1e-3, check_positive)
    batch_size: int = setting(64, check_at_least_one, part="_encoder")
    _progress = (*QualityDiversity._progress, "_began")
    _began: int
    """Generations before the archive was begun."""

    def _check_settings(self) -> None:
        super()._check_settings()
        check_positive(trajectory_share=self.trajectory_share)

    def _make_search(self, seed: np.random.SeedSequence) -> None:
        self._check_begins_empty()
        encoder_seed, search_seed = seed.spawn(2)
        self._encoder = TrajectoryEncoder(
            self.latent_size,
            share=self.trajectory_share,
            learning_rate=self.ae_learning_rate,
            n_epochs=self.n_epochs,
            batch_size=self.batch_size,
            seed=encoder_seed,
            device=self.device,
        )
        super()._make_search(search_seed)

    def _begin_archive(self, seed: np.random.SeedSequence) -> None:
        super()._begin_archive(seed)
        self._began = self.generation

    def _make_archive(self, seed: np.random.SeedSequence) -> UnstructuredArchive:
        return UnstructuredArchive(
            measure_dim=self.latent_size,
            target_size=self.archive_size,
            k_neighbors=None,  # nothing reads novelty
            **self._archive_kwargs(seed),
        )

    def _put_in_force(self) -> None:
        super()._put_in_force()
        self._encoder.learning_rate = self.ae_learning_rate
        if self._own_archive is None:
            self.archive.target_size = self.archive_size

    def _parts(self) -> dict[str, Any]:
        return {**super()._parts(), "encoder": self._encoder}

    def _measure_dim(self, space: spaces.Box[Any] | None) -> int:
        return self.latent_size

    def _field_types(self) -> FieldTypes:
        return {
            **super()._field_types(),
            "behavior": ((self._n_behaviors,), np.float64),
            # The first generation tells how many states there are.
            "states": (self._encoder.shape or (0, 0), np.float32),
        }

    def _measures(self, rollouts: Rollouts) -> Float64Array:
        if self._encoder.shape is None:
            self.archive.reshape_field("states", self._encoder.begin(rollouts))
        states = self._encoder.states(rollouts)
        if self._is_training_due():
            self._train(states)
        return self._encoder.encode(states)

    def _summarizers(self, n_individuals: int) -> Mapping[str, Summarizer] | None:
        is_begun = self._encoder.shape is not None
        return self._encoder.summarizers(n_individuals) if is_begun else None

    def _is_training_due(self) -> bool:
        n_intervals, rest = divmod(self.generation - self._began, self.training_interval)
        is_power_of_two = n_intervals & (n_intervals - 1) == 0
        return rest == 0 and is_power_of_two  # 0 counts as one

    def _train(self, states: Float32Array) -> None:
        """Train on elites and generation, then encode the elites anew."""
        elites = self.archive.data("states")
        self._encoder.train(np.concatenate([elites, states]))
        if len(elites):
            self.archive.set_measures(self._encoder.encode(elites))

    def _fields(self, rollouts: Rollouts) -> Fields:
        return {**super()._fields(rollouts), "states": self._encoder.states(rollouts)}

    def _tell(self, rollouts: Rollouts) -> Mapping[str, float]:
        metrics = super()._tell(rollouts)
        return {**metrics, "autoencoder/loss": self._encoder.loss}
