"""The keywords that constructors pass on to their parents, for type checkers.

Each class' own are in its signature, and documented there; what it passes on is one of these. They
leave out what a subclass has another default for.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypedDict

import torch as th
from ribs.emitters import EmitterBase

from curiosity_algos.archives.base import EliteArchive
from curiosity_algos.evaluation.evaluator import Evaluator
from curiosity_algos.evaluation.policies import Float32Array
from curiosity_algos.search.base import MakeSearch, Search

MakeEmitters = Callable[[EliteArchive, Float32Array, int], list[EmitterBase]]
"""From the archive, the parameters to begin at (n_parameters,) and a seed to pyribs' emitters."""


class AlgorithmKeywords(TypedDict, total=False):
    """Keywords of every population algorithm, see `EvolutionaryAlgorithm`."""

    evaluator: Evaluator | str
    policy_kwargs: dict[str, Any] | None
    n_threads: int | None
    seed: int | None
    device: th.device | str
    verbose: int
    tensorboard_log: str | None
    _init_setup_model: bool


class StrategyKeywords(AlgorithmKeywords, total=False):
    """Keywords of every evolution strategy but the learning rate, see `EvolutionStrategy`."""

    population_size: int
    n_parents: int
    sigma: float
    step: str
    mirrored_sampling: bool
    search: Search | MakeSearch | None


class MotivatedKeywords(StrategyKeywords, total=False):
    """Keywords of strategies with a motivation, see `MotivatedStrategy`."""

    learning_rate: float
    phi: float | str
    no_reward: str


class ArchiveKeywords(AlgorithmKeywords, total=False):
    """Keywords of algorithms with an archive but the mutations' size, see `QualityDiversity`."""

    population_size: int
    archive: EliteArchive | None
    emitters: MakeEmitters | None


class MutationKeywords(ArchiveKeywords, total=False):
    """Keywords of every algorithm with an archive, see `QualityDiversity`."""

    sigma: float


class BonusKeywords(TypedDict, total=False):
    """Keywords of a bonus and its training that have one default, see `CuriousAlgorithm`."""

    bonus_kwargs: dict[str, Any] | None
    n_transitions: int
    buffer_size: int
