"""What an algorithm says about the curiosity that it uses, and the parts made of it."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
import torch as th
from gymnasium import spaces

from curiosity_algos.common.randomness import integer_seed
from curiosity_algos.curiosity.base import Bonus
from curiosity_algos.curiosity.buffer import TransitionBuffer
from curiosity_algos.curiosity.make import check_bonus_choice, make_bonus, stored_action_size
from curiosity_algos.curiosity.motivation import CuriosityMotivation
from curiosity_gym.validation import check_at_least_one, check_share


@dataclass(frozen=True)
class CuriositySettings:
    """The keywords of `CuriosityES` that make its motivation, under the same names."""

    bonus: str | Bonus
    bonus_kwargs: dict[str, Any]
    n_transitions: int
    n_updates: int
    batch_size: int
    buffer_size: int
    gamma: float

    @classmethod
    def of(cls, algorithm: object) -> Self:
        """Those that an algorithm holds as attributes.

        Raises:
            ValueError: If one is out of its range, or the bonus knows no such keyword.
        """
        settings = cls(**{field.name: getattr(algorithm, field.name) for field in fields(cls)})
        settings._check()
        return settings

    def _check(self) -> None:
        check_share(gamma=self.gamma)
        check_at_least_one(n_transitions=self.n_transitions, n_updates=self.n_updates)
        check_at_least_one(batch_size=self.batch_size, buffer_size=self.buffer_size)
        check_bonus_choice(self.bonus, self.bonus_kwargs)

    def make_motivation(
        self,
        observation_space: spaces.Box[Any],
        action_space: spaces.Space[Any],
        *,
        seed: np.random.SeedSequence,
        device: th.device,
        n_threads: int | None,
    ) -> CuriosityMotivation:
        """The motivation for 1-D observations and Box or Discrete actions."""
        motivation_seed, networks_seed, buffer_seed = seed.spawn(3)
        bonus = make_bonus(
            self.bonus,
            self.bonus_kwargs,
            observation_space,
            action_space,
            seed=integer_seed(networks_seed),
            device=device,
        )
        buffer = TransitionBuffer(
            self.buffer_size,
            observation_space,
            stored_action_size(action_space),
            seed=integer_seed(buffer_seed),
        )
        return CuriosityMotivation(
            bonus,
            buffer,
            gamma=self.gamma,
            n_transitions=self.n_transitions,
            n_updates=self.n_updates,
            batch_size=self.batch_size,
            seed=motivation_seed,
            n_threads=n_threads,
        )
