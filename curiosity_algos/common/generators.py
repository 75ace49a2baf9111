"""The state of a generator as plain text; without torch, which workers of mazes do not import."""

from __future__ import annotations

import json

import numpy as np


def generator_state(generator: np.random.Generator) -> str:
    """The generator's state as JSON."""
    return json.dumps(generator.bit_generator.state)


def load_generator_state(generator: np.random.Generator, state: str) -> None:
    """Bring a generator to a state that `generator_state` gave; ValueError if none of its kind."""
    try:
        generator.bit_generator.state = json.loads(state)
    except (ArithmeticError, LookupError, TypeError, ValueError) as error:
        raise ValueError("`rng` must be the state of such a generator.") from error
