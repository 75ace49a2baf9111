"""Arguments of a replay buffer with a bonus, checked before anything is made of them."""

from __future__ import annotations

import numpy as np

from curiosity_gym.validation import check_at_least_one, check_seed


def check_size(buffer_size: int, n_envs: int, optimize_memory_usage: bool) -> None:
    """Raise ValueError unless there is room for transitions of each environment."""
    check_at_least_one(buffer_size=buffer_size, n_envs=n_envs)
    if optimize_memory_usage and buffer_size < 2 * n_envs:
        raise ValueError(
            f"`buffer_size` must be at least {2 * n_envs} with `optimize_memory_usage`, two of "
            f"each environment, got {buffer_size}."
        )


def seed_sequence(seed: int | np.random.SeedSequence | None) -> np.random.SeedSequence:
    """The seed's sequence; of None one that NumPy's generator draws."""
    if isinstance(seed, np.random.SeedSequence):
        return seed
    check_seed(seed)
    # The global generator is what SB3's algorithms seed.
    return np.random.SeedSequence(np.random.randint(2**31) if seed is None else seed)  # noqa: NPY002
