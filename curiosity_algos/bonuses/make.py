"""The bonuses by name, and how an algorithm that is told one makes it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import torch as th
from gymnasium import spaces

from curiosity_algos.bonuses.apt import APT
from curiosity_algos.bonuses.base import Bonus, NetworkKeywords, keyword_only
from curiosity_algos.bonuses.disagreement import Disagreement
from curiosity_algos.bonuses.e3b import E3B
from curiosity_algos.bonuses.encoders import ImageInputs, action_size
from curiosity_algos.bonuses.etd import ETD
from curiosity_algos.bonuses.icm import ICM
from curiosity_algos.bonuses.ngu import NGU
from curiosity_algos.bonuses.noveld import NovelD
from curiosity_algos.bonuses.ramp import RAMP
from curiosity_algos.bonuses.rnd import RND
from curiosity_algos.common.arrays import Array
from curiosity_algos.common.randomness import integer_seed
from curiosity_algos.state.tree import encode
from curiosity_gym.validation import check_at_least_one, check_choice

BONUSES: dict[str, Callable[..., Bonus]] = {
    each.name: each for each in (APT, Disagreement, E3B, ETD, ICM, NGU, NovelD, RAMP, RND)
}
FOR_ONE_POLICY: dict[str, dict[str, Any]] = {
    "apt": {"horizon": 10, "power": 3.0},
    "e3b": {"log": True},
    "icm": {"learning_rate": 1e-4},
}
"""Keywords where a single policy learns from a bonus: a faster ICM would outrun it, what is rare
must stand out for a gradient to lead there, and beside the first step of an episode no other would
count in E3B's."""


def check_bonus_choice(bonus: str | Bonus, bonus_kwargs: Mapping[str, Any]) -> None:
    """Check what a user said about the bonus.

    Raises:
        ValueError: If it is neither a name nor a `Bonus`, or takes no such keyword.
    """
    if not isinstance(bonus_kwargs, Mapping):
        raise ValueError(f"`bonus_kwargs` must be a dictionary, got {bonus_kwargs!r}.")
    if not isinstance(bonus, str):
        if isinstance(bonus, type) or not isinstance(bonus, Bonus):
            known = ", ".join(BONUSES)
            raise ValueError(f"`bonus` must be one of {known}, or a Bonus, got {bonus!r}.")
        if bonus_kwargs:
            raise ValueError("`bonus_kwargs` must be empty where `bonus` is an object.")
        return
    check_choice(tuple(BONUSES), bonus=bonus)
    known_keywords = bonus_keywords(bonus)
    for name in bonus_kwargs:
        check_choice(known_keywords, bonus_kwargs=name)


def bonus_keywords(bonus: str) -> tuple[str, ...]:
    """Keywords of the bonus of a name; its seed and its device are those of the algorithm."""
    of_networks = sorted(NetworkKeywords.__optional_keys__ - {"seed", "device"})
    return (*keyword_only(BONUSES[bonus]), *of_networks)


def make_bonus(
    bonus: str | Bonus,
    bonus_kwargs: Mapping[str, Any],
    observation_space: spaces.Space[Any],
    action_space: spaces.Space[Any],
    *,
    seed: np.random.SeedSequence,
    device: th.device | str,
) -> Bonus:
    """The bonus of a name for these spaces; an object is taken as it is, whatever the keywords.

    Raises:
        ValueError: If an object does not score transitions of these spaces, or could not be saved.
    """
    action_size(action_space)  # raises where no bonus takes such actions
    if not isinstance(bonus, str):
        _check_fits(bonus, observation_space, action_space)
        return bonus
    given = {"seed": integer_seed(seed), "device": device, **bonus_kwargs}
    return BONUSES[bonus](observation_space, action_space, **given)


def _check_fits(
    bonus: Bonus, observation_space: spaces.Space[Any], action_space: spaces.Space[Any]
) -> None:
    is_image = ImageInputs.of(observation_space) is not None
    shape = (2, *(observation_space.shape or ()))
    observations = np.zeros(shape, dtype=np.uint8 if is_image else np.float32)
    actions: Array
    if isinstance(action_space, spaces.Box):
        actions = np.clip([[-1.0], [1.0]], action_space.low, action_space.high).astype(np.float32)
    else:
        actions = np.array([0, spaces.flatdim(action_space) - 1])  # of a Discrete
    scorer = bonus.episodes(2) or bonus
    try:
        shape = np.shape(scorer.score(observations, actions, observations))
    except Exception as error:
        raise ValueError(
            "`bonus` must score transitions of the environment's spaces as it is shown them, "
            f"{observation_space} and {action_space}."
        ) from error
    if shape != (2,):
        raise ValueError(f"`bonus` must give one score for each transition, got {shape} of 2.")
    check_at_least_one(horizon=bonus.horizon)
    encode(bonus.state_dict(), {}, "bonus")  # raises where no file could hold it
