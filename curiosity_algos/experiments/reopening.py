"""Runs whose folder says how they were made: their last checkpoint, and their environment anew."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import gymnasium as gym

from curiosity_algos.experiments.env_spec import decode_spec
from curiosity_algos.experiments.run_folder import RunFolder


def last_checkpoint(folder: Path) -> tuple[dict[str, Any], Path]:
    """The description of a run, and its last checkpoint.

    Raises:
        FileNotFoundError: If there is no run.
        ValueError: If it has no checkpoint yet, or is damaged.
    """
    run = RunFolder(folder)
    described, checkpoint = run.describe(), run.checkpoint
    if checkpoint is None:
        raise ValueError(f"`run` must have a checkpoint: {folder} has none yet.")
    return described, checkpoint


def make_env(described: Mapping[str, Any], *, trust: bool, **rendering: Any) -> gym.Env[Any, Any]:
    """An environment as a run was trained in.

    Args:
        described: The description of the run.
        trust: Also run code that it names, see `decode_spec`.
        **rendering: Keywords about pictures.

    Raises:
        ValueError: If it cannot be made, or needs trust.
        gymnasium.error.DependencyNotInstalled: If the extra that it needs is not installed.
    """
    spec = decode_spec(described.get("env_spec"), trust=trust)
    try:
        return gym.make(spec, **rendering)
    except gym.error.DependencyNotInstalled:
        raise
    except Exception as error:  # whatever a constructor makes of a file's arguments
        raise ValueError(f"`run` must be of an environment that can be made: {error}.") from error
