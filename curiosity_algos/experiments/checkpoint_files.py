"""The files of a checkpoint that hold a model, and the models that can be recorded."""

from __future__ import annotations

from pathlib import Path
from typing import TypeAlias

import numpy as np
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

from curiosity_algos.experiments.run_folder import write_arrays
from curiosity_algos.experiments.under_way import write_transitions, write_under_way
from curiosity_algos.loops.evolutionary_algorithm import EvolutionaryAlgorithm
from curiosity_algos.sb3.bonus_wrapper import BonusVecEnvWrapper
from curiosity_algos.sb3.callbacks import bonus_wrapper
from curiosity_algos.sb3.resumable import Resumable

Recordable: TypeAlias = EvolutionaryAlgorithm | OnPolicyAlgorithm | OffPolicyAlgorithm


def write_model(
    model: Recordable, folder: Path, exclude: list[str], *, save_replay_buffer: bool
) -> None:
    """Save a model, the wrappers of its VecEnv that learn, and its best policy in a checkpoint.

    Of Stable-Baselines3's own algorithms also what their file lacks of the run.
    """
    model.save(folder / "model", exclude)
    bonus, normalize = bonus_wrapper(model), model.get_vec_normalize_env()
    if bonus is not None:
        bonus.save(folder / "bonus.pt")
    if normalize is not None:
        normalize.save(str(folder / "vecnormalize.pkl"))
    if isinstance(model, EvolutionaryAlgorithm):
        policy, best_return = model.policy, np.array(model.best_return)
        best = {"parameters": policy.vector, "net_arch": policy.net_arch, "return": best_return}
        write_arrays(folder / "best_policy.npz", best)
    elif not isinstance(model, Resumable):
        write_under_way(model, folder)
        if save_replay_buffer and "buffer" not in exclude:
            write_transitions(model, folder)


def check_recordable(model: object) -> None:
    """Check that a run of the model can be recorded.

    Raises:
        ValueError: If it steps no VecEnv, or no Monitor sees its episodes.
    """
    if isinstance(model, EvolutionaryAlgorithm):
        return
    if not isinstance(model, OnPolicyAlgorithm | OffPolicyAlgorithm):
        raise ValueError(
            "SaveRun is for algorithms of curiosity_algos, and those of Stable-Baselines3 that "
            f"step a VecEnv, got {type(model).__name__}."
        )
    env = model.get_env()
    if env is None or not _sees_the_task(env):
        raise ValueError(
            "`env` must have a Monitor, below wrappers that change rewards: wrap the environment "
            "itself in Stable-Baselines3's VecMonitor."
        )


def _sees_the_task(env: VecEnv) -> bool:
    """Whether a Monitor sees each episode, with the rewards of the task."""
    monitor = unwrap_vec_wrapper(env, VecMonitor)
    if monitor is None:
        return all(env.env_is_wrapped(Monitor))
    changes_rewards = (BonusVecEnvWrapper, VecNormalize)
    return not any(is_vecenv_wrapped(monitor.venv, each) for each in changes_rewards)
