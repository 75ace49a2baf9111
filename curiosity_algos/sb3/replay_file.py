"""The file of a `BonusReplayBuffer`: what it holds, and whether that is sound."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import numpy as np
import torch as th

from curiosity_algos.checkpoints.plain_files import check_plain, fitting, read_plain, write_plain
from curiosity_algos.common.arrays import Array
from curiosity_algos.common.randomness import load_generator_state
from curiosity_algos.sb3.held_observations import as_tensors

FORMAT = "curiosity replay buffer 5"


def write_buffer(path: str | os.PathLike[str], content: dict[str, Any]) -> None:
    """Write the file; ValueError where it cannot hold the state of the bonus."""
    check_plain(content["bonus"], "bonus")
    write_plain(path, content, FORMAT)


def read_buffer(path: str | os.PathLike[str], made: dict[str, Any]) -> dict[str, Any]:
    """What `write_buffer` was given, the rest not yet checked.

    Raises:
        FileNotFoundError: If there is no such file.
        ValueError: If it is no whole one, or its bonus was made with others than `made`.
    """
    saved = read_plain(path, FORMAT, what="BonusReplayBuffer")
    if saved.get("made") != made:
        raise ValueError(
            f"`path` must be saved of a buffer with {made}, {path} is of {saved.get('made')}."
        )
    return saved


def check_buffer(
    saved: Mapping[str, Any], columns: Mapping[str, Array], counters: Mapping[str, Any]
) -> None:
    """Raise ValueError unless transitions and counters are like these; other errors, too."""
    n = len(saved["buffer"]["actions"])
    for name, column in columns.items():
        _check_column(name, saved["buffer"][name], as_tensors(column[:0]), n)
    load_generator_state(np.random.default_rng(0), saved["rng"])
    types = {name: type(value) for name, value in counters.items()}
    if {name: type(value) for name, value in saved["counters"].items()} != types:
        raise ValueError(f"`counters` must be {types}.")


def _check_column(name: str, saved: Any, like: th.Tensor | dict[str, th.Tensor], n: int) -> None:
    if isinstance(like, dict):
        if not saved.keys() == like.keys():
            raise ValueError(f"`{name}` must have the entries {list(like)}.")
        for key, entry in like.items():
            _check_column(f"{name}[{key!r}]", saved[key], entry, n)
        return
    fitting(name, saved, (n, *like.shape[1:]), like.numpy().dtype)
