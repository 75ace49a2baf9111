"""The files of a checkpoint that hold a model, and the models that can be recorded.

Algorithms that Stable-Baselines3 trains have two files of what their `model.zip` lacks:

under_way.npz      the states of the generators, of the episodes, and of a recurrent policy
replay_buffer.npz  the transitions of an off-policy algorithm, and the bonus of a buffer
"""

from __future__ import annotations

import pickle
import warnings
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.buffers import DictReplayBuffer, NStepReplayBuffer, ReplayBuffer
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm
from stable_baselines3.common.on_policy_algorithm import OnPolicyAlgorithm
from stable_baselines3.common.vec_env import (
    VecEnv,
    VecMonitor,
    VecNormalize,
    is_vecenv_wrapped,
    unwrap_vec_wrapper,
)

from curiosity_algos.common.arrays import Array
from curiosity_algos.common.generators import generator_state, load_generator_state
from curiosity_algos.common.randomness import global_state, load_global_state
from curiosity_algos.experiments.run_folder import write_arrays
from curiosity_algos.loops.evolutionary_algorithm import EvolutionaryAlgorithm
from curiosity_algos.sb3.bonus_wrapper import BonusVecEnvWrapper
from curiosity_algos.sb3.callbacks import bonus_wrapper
from curiosity_algos.sb3.replay_buffer import BonusReplayBuffer
from curiosity_algos.state.atomic_file import atomic_file
from curiosity_algos.state.episodes import episode_states, load_episode_states
from curiosity_algos.state.file import read, save

CHANGE_REWARDS = (BonusVecEnvWrapper, VecNormalize)
Recordable: TypeAlias = EvolutionaryAlgorithm | OnPolicyAlgorithm | OffPolicyAlgorithm
UNDER_WAY, TRANSITIONS = "under_way.npz", "replay_buffer.npz"
_KIND, _BUFFER_KIND = "a run under way 1", "transitions of a replay buffer 1"
_COLUMNS = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")
_PLAIN_BUFFERS = (ReplayBuffer, DictReplayBuffer, NStepReplayBuffer)
"""Replay buffers that hold nothing but columns."""


def check_recordable(model: object) -> None:
    """Raise ValueError if the model steps no VecEnv, or no Monitor sees its episodes."""
    if isinstance(model, EvolutionaryAlgorithm):
        return
    if not isinstance(model, OnPolicyAlgorithm | OffPolicyAlgorithm):
        raise ValueError(
            "SaveRun is for algorithms of curiosity_algos, and those of Stable-Baselines3 that "
            f"step a VecEnv, got {type(model).__name__}."
        )
    env = model.get_env()
    assert env is not None
    monitor = unwrap_vec_wrapper(env, VecMonitor)
    changed = monitor and any(is_vecenv_wrapped(monitor.venv, each) for each in CHANGE_REWARDS)
    if changed or not (monitor or all(env.env_is_wrapped(Monitor))):
        raise ValueError(
            "`env` must have a Monitor, below wrappers that change rewards: wrap the environment "
            "itself in Stable-Baselines3's VecMonitor."
        )


def write_model(
    model: Recordable, folder: Path, exclude: list[str], *, save_replay_buffer: bool
) -> None:
    """Save a model, the wrappers of its VecEnv that learn, and its best policy in a checkpoint."""
    with atomic_file(folder / "model.zip") as file:
        model.save(file, exclude)  # to a path Stable-Baselines3 writes what a power cut may lose
    bonus, normalize = bonus_wrapper(model), model.get_vec_normalize_env()
    if bonus is not None:
        bonus.save(folder / "bonus.npz")
    if normalize is not None:
        with atomic_file(folder / "vecnormalize.pkl") as file:
            pickle.dump(normalize, file)  # as its `save` does, which leaves it in the cache
    if isinstance(model, EvolutionaryAlgorithm):
        best = {
            **model.policy.arrays(),
            "return": np.array(model.best_return),
        }
        if model.best_episode_seed is not None:
            best["episode_seed"] = np.array(model.best_episode_seed)
        write_arrays(folder / "best_policy.npz", best)
    else:
        _write_under_way(model, folder)
        _write_buffer(model, folder, transitions=save_replay_buffer and "buffer" not in exclude)


def _write_under_way(model: BaseAlgorithm, folder: Path) -> None:
    state = {
        "draws": global_state(model.device),
        "actions": generator_state(model.action_space.np_random),
        "episodes": episode_states(_below(model)),
        # Of sb3-contrib's RecurrentPPO: pairs of tensors, which its own file leaves out.
        "memory": [list(pair) for pair in getattr(model, "_last_lstm_states", None) or ()],
    }
    save(folder / UNDER_WAY, _KIND, {}, state)


def _write_buffer(model: BaseAlgorithm, folder: Path, *, transitions: bool) -> None:
    buffer: Any = getattr(model, "replay_buffer", None)
    if isinstance(buffer, BonusReplayBuffer):
        buffer.save(folder / TRANSITIONS, transitions=transitions)
    elif transitions and type(buffer) in _PLAIN_BUFFERS:
        n = min(buffer.size() + 1, buffer.buffer_size)  # the last row may lead to the next one
        columns = {name: column[:n] for name, column in _columns(buffer).items()}
        state = {"columns": columns, "pos": buffer.pos, "full": buffer.full}
        save(folder / TRANSITIONS, _BUFFER_KIND, {}, state)


def _columns(buffer: ReplayBuffer) -> dict[str, Array]:
    """The arrays (buffer_size, ...) of a replay buffer, one for each key of a Dict."""
    columns: dict[str, Array] = {}
    for name in _COLUMNS:
        column = getattr(buffer, name, {})  # one that saves memory lacks next observations
        parts = column if isinstance(column, dict) else {"": column}
        columns |= {f"{name}/{key}": part for key, part in parts.items()}
    return columns


def restore_under_way(model: BaseAlgorithm, folder: Path) -> None:
    """Bring a model that was loaded to where it stood, as far as its checkpoint knows.

    Episodes that cannot continue begin anew; it warns where transitions are missing.
    """
    _restore_transitions(model, folder)
    state = read(folder / UNDER_WAY, _KIND)[1]
    if not load_episode_states(_below(model), state["episodes"]):
        model._last_obs = None
    elif state["memory"]:
        learner: Any = model
        pairs = [tuple(part.to(model.device) for part in pair) for pair in state["memory"]]
        learner._last_lstm_states = type(learner._last_lstm_states)(*pairs)
    load_generator_state(model.action_space.np_random, state["actions"])
    load_global_state(state["draws"], model.device)


def _below(model: BaseAlgorithm) -> VecEnv:
    """The environments of a model, below a bonus, whose own file knows its state."""
    env, wrapper = model.get_env(), bonus_wrapper(model)
    assert env is not None
    return env if wrapper is None else wrapper.venv


def _restore_transitions(model: BaseAlgorithm, folder: Path) -> None:
    buffer = getattr(model, "replay_buffer", None)
    if isinstance(buffer, BonusReplayBuffer):
        buffer.restore(folder / TRANSITIONS)
    elif buffer is not None and (folder / TRANSITIONS).exists():
        saved = read(folder / TRANSITIONS, _BUFFER_KIND)[1]
        for name, column in _columns(buffer).items():
            rows: npt.NDArray[np.generic] = saved["columns"][name]
            column[: len(rows)] = rows
        buffer.pos, buffer.full = saved["pos"], saved["full"]
    if buffer is not None and model.num_timesteps and not buffer.size():
        warnings.warn(
            "The checkpoint was taken without the replay buffer, which begins empty: what is "
            "learned from here on is not what an uninterrupted run would have learned.",
            stacklevel=4,
        )
