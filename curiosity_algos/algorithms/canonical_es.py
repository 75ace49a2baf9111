"""CanonicalES: the evolution strategy alone, ranked by reward.

Chrabaszcz et al. 2018 (https://arxiv.org/abs/1802.08842), with the learning rate of the paper's
section 4.2. The baseline that the motivations are measured against.
"""

from __future__ import annotations

from curiosity_algos.loops.evolution_strategy import EvolutionStrategy


class CanonicalES(EvolutionStrategy):
    """Rank-weighted recombination with fixed step size, extrinsic fitness only.

    While no individual has a reward all ranks are equal and the first `n_parents` recombine: the
    center walks at random.

    All keywords are those of `EvolutionStrategy`.
    """
