"""Settings by environment in a YAML file, in the form of rl-zoo3's.

A file has an entry of keywords for the id of each environment, and `default` for all others:
`CuriosityMaze-Hard-v0: {n_timesteps: 10000000, env_kwargs: {horizon: 1000}, sigma: 0.1}`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import yaml

from curiosity_algos.experiments.training import RunSpec

Table = Mapping[str, dict[str, Any]]


def read_conf_file(path: Path) -> Table:
    """The keywords of each environment.

    Raises:
        OSError: If the file cannot be read.
        ValueError: If it is no YAML, or holds anything else.
    """
    try:
        table = yaml.safe_load(path.read_text())
    except (UnicodeDecodeError, yaml.YAMLError) as error:
        raise ValueError(f"`conf_file` must be YAML, {path} is not: {error}.") from error
    entries = table.values() if isinstance(table, dict) else [None]
    if not all(isinstance(entry, dict) and all(map(_is_text, entry)) for entry in entries):
        raise ValueError(f"`conf_file` must have keywords by the id of an environment: {path}.")
    found: Table = table
    return found


def _is_text(value: object) -> bool:
    return isinstance(value, str)


def _number(n_timesteps: Any) -> float:
    """A number; YAML takes `1e7`, without a point, for text."""
    try:
        return float(n_timesteps)
    except (TypeError, ValueError) as error:
        raise ValueError(f"`n_timesteps` must be a number, got {n_timesteps!r}.") from error


def complete(run: RunSpec, table: Table, timesteps: float | None) -> RunSpec:
    """A run with what a file says of its environment; what the run has counts more.

    Args:
        run: Run, whose own keywords stay.
        table: Keywords by environment; `default` is for those that it does not name.
        timesteps: Budget that counts more than the file's; None: none was given.

    Raises:
        ValueError: If the file says nothing of the environment.
    """
    env = run.env.rpartition(":")[2]
    if not table.keys() & {env, "default"}:
        raise ValueError(f"`conf_file` must have {env} or default, it has {', '.join(table)}.")
    found = dict(table.get(env, table.get("default", {})))
    budget = _number(found.pop("n_timesteps", run.timesteps))
    env_kwargs = found.pop("env_kwargs", {})
    if not isinstance(env_kwargs, dict):
        raise ValueError(f"`env_kwargs` must be keywords of {env}, got {env_kwargs!r}.")
    return replace(
        run,
        timesteps=budget if timesteps is None else timesteps,
        env_kwargs={**env_kwargs, **run.env_kwargs},
        settings={**found, **run.settings},
    )
