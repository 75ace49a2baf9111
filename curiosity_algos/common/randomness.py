"""Random generators whose state checkpoints hold, as plain text."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import torch as th


def generator_state(generator: np.random.Generator) -> str:
    """The generator's state as JSON."""
    return json.dumps(generator.bit_generator.state)


def load_generator_state(generator: np.random.Generator, state: str) -> None:
    """Bring a generator of the same kind to a state that `generator_state` gave."""
    generator.bit_generator.state = json.loads(state)


def integer_seed(seed: np.random.SeedSequence) -> int:
    """`seed` for libraries that take nothing but whole numbers."""
    return int(seed.generate_state(1)[0])


def torch_generator(seed: int | None) -> th.Generator:
    """A generator of its own for torch's draws; None: fresh entropy."""
    return th.Generator().manual_seed(integer_seed(np.random.SeedSequence(seed)))


class EpisodeSeeds:
    """Draws the seed of each generation's episodes.

    Args:
        seed: Where the draws begin.

    Attributes:
        current: The seed drawn last.
    """

    def __init__(self, seed: np.random.SeedSequence) -> None:
        self._rng = np.random.default_rng(seed)
        self.current = 0

    def draw(self) -> int:
        """The next seed, which all individuals of a generation share."""
        self.current = int(self._rng.integers(2**31))
        return self.current

    def state_dict(self) -> dict[str, Any]:
        """The state of the draws."""
        return {"rng": generator_state(self._rng)}

    def load_state_dict(self, state: Mapping[str, Any], strict: bool = True) -> None:
        """Take over what `state_dict` gave."""
        load_generator_state(self._rng, state["rng"])
