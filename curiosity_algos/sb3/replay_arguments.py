"""Arguments and files of a replay buffer with a bonus, checked before anything changes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

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


def check_rows(transitions: Mapping[str, Any], buffer_size: int) -> None:
    """Raise ValueError unless columns are as long as `pos` and `full` say, or empty."""
    columns = {name: part for name, part in transitions.items() if name not in ("pos", "full")}
    parts = [part.values() if isinstance(part, dict) else [part] for part in columns.values()]
    lengths, pos = {len(part) for each in parts for part in each}, transitions["pos"]
    # The row after the newest is stored, too, which may be where that leads.
    expected = {buffer_size if transitions["full"] else pos + 1}
    is_empty = lengths == {0} and not (pos or transitions["full"])
    if not (0 <= pos < buffer_size and (is_empty or lengths == expected)):
        raise ValueError(f"`transitions.pos` and `full` must fit the rows, got {pos}.")
