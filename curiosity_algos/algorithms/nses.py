"""NS-ES and NSR-ES: the canonical evolution strategy, motivated by novelty of behaviors.

Conti et al. 2018, "Improving Exploration in Evolution Strategies for Deep Reinforcement Learning
via a Population of Novelty-Seeking Agents" (https://arxiv.org/abs/1712.06560), without their
meta-population, as the paper's section 4.2 has it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces

from curiosity_algos.loops.declared import setting
from curiosity_algos.loops.evolution_strategy import MotivatedStrategy
from curiosity_algos.motivations.novelty import NoveltyMotivation, behavior_size
from curiosity_gym.validation import check_at_least_one


class NSES(MotivatedStrategy):
    """NSRA-ES by default, whose `phi` adapts the weight of the return; NS-ES with `phi=0`.

    Evolves policies whose episodes end where few ended before.
    Each generation samples lambda policies around the center, scores them by
    `phi z(return) + (1 - phi) z(novelty)`, and moves the center towards the best mu. Novelty is the
    mean Euclidean distance to the k nearest behaviors of all individuals so far.

    Further keywords are those of `MotivatedStrategy`.

    Args:
        phi: Weight of the extrinsic fitness, in [0, 1]; 0 is NS-ES, above it NSR-ES; "adaptive" is
            NSRA-ES, see `MotivatedStrategy`.
        k: Neighbors that count.
        behavior: "final": the environment's behavior, in its own units; "state": the whole final
            observation (the paper's BD_s), which any environment has.
    """

    k: int = setting(10, check_at_least_one, part="_motivation")
    behavior: str = setting("final", fixed=True)
    _motivation: NoveltyMotivation

    def _check_settings(self) -> None:
        super()._check_settings()
        self._check_behaviors(self._behavior_space)

    def _check_behaviors(self, space: spaces.Box[Any] | None) -> None:
        behavior_size(self.behavior, self.observation_space, space)

    def _make_motivation(self, seed: np.random.SeedSequence) -> NoveltyMotivation:
        return self._novelty()

    def _novelty(self) -> NoveltyMotivation:
        n = behavior_size(self.behavior, self.observation_space, self._behavior_space)
        return NoveltyMotivation(n, k=self.k, behavior=self.behavior)

    def _forget_behaviors(self) -> None:
        super()._forget_behaviors()
        self._motivation = self._novelty()
