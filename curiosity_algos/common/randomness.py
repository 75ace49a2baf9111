"""The state of a NumPy generator as plain text, as checkpoints hold it."""

from __future__ import annotations

import json

import numpy as np


def generator_state(generator: np.random.Generator) -> str:
    """The generator's state as JSON."""
    return json.dumps(generator.bit_generator.state)


def load_generator_state(generator: np.random.Generator, state: str) -> None:
    """Bring a generator of the same kind to a state that `generator_state` gave."""
    generator.bit_generator.state = json.loads(state)
