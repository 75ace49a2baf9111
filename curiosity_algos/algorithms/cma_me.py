"""CMA-ME: MAP-Elites' archive, filled by CMA-ES that climbs its improvement.

Fontaine et al. 2020, "Covariance Matrix Adaptation for the Rapid Illumination of Behavior Space"
(https://arxiv.org/abs/1912.02400); the paper's section 4.3.
"""

from __future__ import annotations

import contextlib
from functools import cache, partial
from typing import Any

from numba.core.dispatcher import Dispatcher
from ribs.emitters import EmitterBase, EvolutionStrategyEmitter

from curiosity_algos.algorithms.map_elites import MAPElites
from curiosity_algos.common.arrays import Float32Array
from curiosity_algos.loops.declared import setting
from curiosity_algos.loops.quality_diversity import POPULATION_SIZE
from curiosity_gym.validation import check_at_least_one, check_choice, check_positive

STRATEGIES = ("cma_es", "sep_cma_es", "lm_ma_es")


class CMAME(MAPElites):
    """One improvement emitter: CMA-ES, started anew from a random elite every few generations.

    Further keywords are those of `MAPElites`.

    Args:
        sigma: Step size after each restart, above 0; like the next two without effect on
            `emitters`, which have their own.
        restart_interval: Generations between two restarts (the paper's phases of 10).
        es: "cma_es" adapts the full covariance matrix, as the paper does: its cost grows with the
            square of the policy's size. "sep_cma_es" adapts its diagonal, "lm_ma_es" a few
            directions.
    """

    population_size: int = setting(POPULATION_SIZE, check_at_least_one, fixed=True)
    sigma: float = setting(0.1, check_positive, idle_with="emitters")
    restart_interval: int = setting(10, check_at_least_one, idle_with="emitters")
    es: str = setting("cma_es", partial(check_choice, STRATEGIES), fixed=True)

    def _check_settings(self) -> None:
        super()._check_settings()
        if self.emitters is None and self.population_size < 2:
            raise ValueError("`population_size` must be at least 2, got 1: CMA-ES compares.")

    def _steer(self, emitter: Any) -> None:
        emitter._opt.sigma0, emitter._restart_rule = self.sigma, self.restart_interval

    def _step_size(self) -> float:
        (emitter,) = self._emitters.emitters
        return float(emitter._opt.sigma)  # pyribs shows it nowhere else

    def _make_emitter(self, x0: Float32Array, seed: int) -> EmitterBase:
        emitter = EvolutionStrategyEmitter(
            self.archive,
            x0=x0,
            sigma0=self.sigma,
            ranker="2imp",
            es=self.es,
            restart_rule=self.restart_interval,
            batch_size=self.population_size,
            seed=seed,
        )
        _keep_on_disk(type(emitter._opt))
        return emitter


@cache
def _keep_on_disk(strategy: type) -> None:
    """Keep what pyribs compiles for a strategy, which takes seconds in every process."""
    for name in vars(strategy):
        function = getattr(strategy, name)
        if isinstance(function, Dispatcher):
            with contextlib.suppress(RuntimeError):  # no folder to keep it in
                function.enable_caching()
