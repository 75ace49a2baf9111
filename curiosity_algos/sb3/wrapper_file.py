"""The file of a `BonusVecEnvWrapper`: what it holds, and whether that is sound."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from math import isfinite
from typing import Any

import numpy as np
import numpy.typing as npt
import torch as th
from gymnasium import spaces
from stable_baselines3.common.vec_env import VecEnv

from curiosity_algos.bonuses.base import Bonus
from curiosity_algos.bonuses.spans import horizon_of
from curiosity_algos.checkpoints.environment_state import (
    environment_states,
    load_environment_states,
)
from curiosity_algos.checkpoints.plain_files import (
    as_arrays,
    as_tensors,
    check_plain,
    is_plain,
    read_plain,
    write_plain,
)

FORMAT = "curiosity bonus wrapper 2"
WHAT = "BonusVecEnvWrapper"
FIELDS = {"spaces", "settings", "state", "environments", "format"}
SETTINGS: dict[str, tuple[type, ...]] = {
    "bonus": (str, type(None)),
    "bonus_kwargs": (dict,),
    "weight": (float,),
    "extrinsic": (bool,),
    "gamma": (float,),
    "train_interval": (int,),
    "n_updates": (int,),
    "batch_size": (int,),
    "buffer_size": (int,),
}
"""Keywords of the constructor, under the same names; a bonus that is an object has none."""


@contextmanager
def sound(path: str | os.PathLike[str]) -> Iterator[None]:
    """Say of whatever fails in the block that the file is damaged or foreign.

    Raises:
        ValueError: If anything fails: what a file holds can fail in any way.
    """
    try:
        yield
    except Exception as error:
        detail = error if isinstance(error, ValueError) else repr(error)
        raise ValueError(f"`path` must be a saved {WHAT}, {path} is damaged: {detail}") from error


def write_wrapper(
    path: str | os.PathLike[str],
    *,
    venv: VecEnv,
    settings: dict[str, Any],
    state: dict[str, Any],
) -> None:
    """Write the file; environments whose state it cannot hold begin anew when it is loaded.

    Args:
        path: Of the file.
        venv: What is wrapped.
        settings: See `SETTINGS`.
        state: What the wrapper's `state_dict` gives.

    Raises:
        OSError: If it cannot be written; an older file is then as it was.
        ValueError: If the state of a bonus of one's own holds what no file of torch may.
    """
    check_plain(state, "bonus")
    known = as_tensors(environment_states(venv))
    content = {
        "spaces": _described(venv),
        "settings": settings,
        "state": state,
        "environments": known if is_plain(known) else None,
    }
    write_plain(path, content, FORMAT)


def read_wrapper(path: str | os.PathLike[str]) -> dict[str, Any]:
    """What `write_wrapper` has written; all but the state is checked.

    Raises:
        FileNotFoundError: If there is no such file.
        ValueError: If it is damaged or foreign.
    """
    saved = read_plain(path, FORMAT, what=WHAT)
    with sound(path):
        _check_names(saved, FIELDS, "fields")
        _check_names(saved["settings"], set(SETTINGS), "settings")
        for name, types in SETTINGS.items():
            # A bool is an int to isinstance.
            if type(saved["settings"][name]) not in types:
                raise ValueError(f"`{name}` must be of {types[0].__name__}.")
        if saved["environments"] is not None:
            _check_environments(saved["environments"])
    return saved


def _check_environments(states: list[Any]) -> None:
    if not isinstance(states, list):
        raise ValueError("`environments` must be None or a list.")
    for each in states:
        _check_names(each, {"env", "rewards"}, "environments")
        is_list = isinstance(each["rewards"], list)
        if not is_list or not all(map(_are_finite, each["rewards"])):  # of each Monitor
            raise ValueError("`rewards` must be lists of finite numbers.")


def _are_finite(rewards: Any) -> bool:
    is_list = isinstance(rewards, list)
    return is_list and all(type(each) in (int, float) and isfinite(each) for each in rewards)


def _check_names(value: Any, names: set[str], what: str) -> None:
    if not isinstance(value, dict) or set(value) != names:
        raise ValueError(f"`{what}` must be {', '.join(sorted(names))}.")


def check_counters(state: Mapping[str, Any]) -> None:
    """Check what a wrapper's state has beside its parts.

    Raises:
        ValueError: If it is none of a wrapper.
    """
    if type(state["n_untrained"]) is not int or state["n_untrained"] < 0:
        raise ValueError("`n_untrained` must be a whole number of at least 0.")
    if type(state["has_trained"]) is not bool:
        raise ValueError("`has_trained` must be True or False.")
    for name, loss in state["metrics"].items():
        if not isinstance(name, str) or not isinstance(loss, float):
            raise ValueError("`metrics` must be numbers by their names.")


def check_actions(actions: th.Tensor, action_space: spaces.Space[Any]) -> None:
    """Check that a bonus can encode actions of a buffer.

    Raises:
        ValueError: If a Discrete has no such ones.
    """
    if isinstance(action_space, spaces.Discrete):
        is_known = (actions >= 0) & (actions < int(action_space.n)) & (actions == actions.floor())
        if not is_known.all():
            raise ValueError(f"`actions` must be whole numbers below {action_space.n}.")


def last_observations(
    saved: th.Tensor, shape: tuple[int, ...], dtype: npt.DTypeLike
) -> npt.NDArray[Any]:
    """A copy of the observations that the next step begins with; none where no episode has begun.

    Raises:
        ValueError: If they are others.
    """
    observations: npt.NDArray[Any] = saved.cpu().numpy().copy()
    is_alike = observations.shape == shape and observations.dtype == dtype
    if observations.size and not (is_alike and np.isfinite(observations).all()):
        raise ValueError(f"`observations` must be finite, of shape {shape}.")
    return observations


def check_fits(
    saved: dict[str, Any], path: str | os.PathLike[str], venv: VecEnv, bonus: Bonus | None
) -> None:
    """Check what a file is to be loaded with.

    Args:
        saved: What `read_wrapper` gave.
        path: Of the file.
        venv: What is to be wrapped.
        bonus: The object given for the one that was saved, or None.

    Raises:
        ValueError: If `venv` or `bonus` is of another kind.
    """
    name = saved["settings"]["bonus"]
    if name is None and bonus is None:
        raise ValueError("`bonus` must be given, the wrapper was saved with an object.")
    if name is not None and bonus is not None:
        raise ValueError(f"`bonus` must be None, it was saved as {name!r}.")
    with sound(path):
        n_envs = len(saved["state"]["scale"]["sums"])
        horizon = saved["state"]["recent"]["observations"].shape[1]
        is_same = n_envs == venv.num_envs and bool(saved["spaces"] == _described(venv))
        if saved["environments"] is not None and len(saved["environments"]) != n_envs:
            raise ValueError(f"`environments` must be None or {n_envs} states.")
    if bonus is not None and horizon_of(bonus) != horizon:
        raise ValueError(f"`bonus` must have a `horizon` of {horizon}, as the one that was saved.")
    if not is_same:
        raise ValueError(
            f"`venv` must have {n_envs} environments with the spaces that were saved, got "
            f"{venv.num_envs} with {venv.observation_space} and {venv.action_space}."
        )


def resume_episodes(venv: VecEnv, saved: list[Any] | None) -> None:
    """Bring environments to where they were, if they can go there; else they begin episodes."""
    if saved is None:
        return
    venv.reset()
    try:
        load_environment_states(venv, as_arrays(saved))
    except ValueError:  # others of the same spaces
        venv.reset()
    except Exception:
        venv.reset()
        raise


def _described(venv: VecEnv) -> list[dict[str, Any]]:
    """All of both spaces in plain values, to be compared."""
    return [_entries(space) for space in (venv.observation_space, venv.action_space)]


def _entries(space: spaces.Space[Any]) -> dict[str, Any]:
    if isinstance(space, spaces.Discrete):
        return {"n": int(space.n)}
    if not isinstance(space, spaces.Box):  # none that is wrapped
        return {"space": repr(space)}
    return {"dtype": str(space.dtype), "low": space.low.tolist(), "high": space.high.tolist()}
