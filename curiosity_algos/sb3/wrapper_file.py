"""The file of a `BonusVecEnvWrapper`: what it holds, and whether that is sound."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import torch as th
from gymnasium import spaces
from stable_baselines3.common.vec_env import VecEnv

from curiosity_algos.bonuses.base import Bonus
from curiosity_algos.bonuses.spans import horizon_of
from curiosity_algos.checkpoints.plain_files import check_plain, read_plain, write_plain
from curiosity_algos.checkpoints.plain_json import decode, encode
from curiosity_algos.state.episodes import episode_states

FORMAT = "curiosity bonus wrapper 6"
WHAT = "BonusVecEnvWrapper"
SETTINGS = ["observation_key", "bonus_kwargs", "weight", "extrinsic", "gamma"]
SETTINGS += ["train_interval", "n_updates", "batch_size", "buffer_size"]
"""Keywords of the constructor that a file holds, beside the name of the bonus."""


@contextmanager
def sound(path: str | os.PathLike[str]) -> Iterator[None]:
    """Say of whatever fails in the block that the file is damaged or foreign."""
    try:
        yield
    except Exception as error:  # what a file holds can fail in any way
        detail = error if isinstance(error, ValueError) else repr(error)
        raise ValueError(f"`path` must be a saved {WHAT}, {path} is damaged: {detail}") from error


def write_wrapper(
    path: str | os.PathLike[str], *, venv: VecEnv, settings: dict[str, Any], state: dict[str, Any]
) -> None:
    """Write the file; environments whose state it cannot hold begin anew when it is loaded."""
    check_plain(state, "bonus")
    content = {
        "spaces": encode([venv.observation_space, venv.action_space]),
        "settings": settings,
        "state": state,
        "environments": encode(episode_states(venv)),
    }
    write_plain(path, content, FORMAT)


def read_wrapper(path: str | os.PathLike[str]) -> dict[str, Any]:
    """What `write_wrapper` was given, and the spaces; settings and state are not yet checked."""
    saved = read_plain(path, FORMAT, what=WHAT)
    with sound(path):
        if saved["settings"].keys() != {*SETTINGS, "bonus"}:
            raise ValueError("`settings` are others.")
        saved |= {name: decode(saved[name]) for name in ("spaces", "environments")}
    return saved


def check_fits(
    saved: dict[str, Any], path: str | os.PathLike[str], venv: VecEnv, bonus: Bonus | None
) -> None:
    """Raise ValueError unless a wrapper that was saved can have this `venv` and `bonus`."""
    name = saved["settings"]["bonus"]
    if name is None and bonus is None:
        raise ValueError("`bonus` must be given, the wrapper was saved with an object.")
    if name is not None and bonus is not None:
        raise ValueError(f"`bonus` must be None, it was saved as {name!r}.")
    with sound(path):
        n_envs = len(saved["state"]["scale"]["sums"])
        horizon = saved["state"]["recent"]["observations"].shape[1]
        has_spaces = bool(saved["spaces"] == [venv.observation_space, venv.action_space])
    if bonus is not None and horizon_of(bonus) != horizon:
        raise ValueError(f"`bonus` must have a `horizon` of {horizon}, as the one that was saved.")
    if n_envs != venv.num_envs or not has_spaces:
        raise ValueError(
            f"`venv` must have {n_envs} environments with the spaces that were saved, got "
            f"{venv.num_envs} with {venv.observation_space} and {venv.action_space}. For others "
            "make a new BonusVecEnvWrapper, which has seen nothing yet."
        )


def check_counters(state: Mapping[str, Any]) -> None:
    """Raise ValueError unless a wrapper can have this, beside its parts."""
    if type(state["n_untrained"]) is not int or state["n_untrained"] < 0:
        raise ValueError("`n_untrained` must be a whole number of at least 0.")
    if type(state["has_trained"]) is not bool:
        raise ValueError("`has_trained` must be True or False.")
    for name, loss in state["metrics"].items():
        if not isinstance(name, str) or not isinstance(loss, float):
            raise ValueError("`metrics` must be numbers by their names.")


def check_actions(actions: th.Tensor, action_space: spaces.Space[Any]) -> None:
    """Raise ValueError unless a bonus can encode the actions of a buffer."""
    if isinstance(action_space, spaces.Discrete):
        is_known = (actions >= 0) & (actions < int(action_space.n)) & (actions == actions.floor())
        if not is_known.all():
            raise ValueError(f"`actions` must be whole numbers below {action_space.n}.")
