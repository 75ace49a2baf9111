"""A callback that leaves a record of a run."""

from __future__ import annotations

import os
import time
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from filelock import FileLock
from stable_baselines3.common.callbacks import BaseCallback, CallbackList

from curiosity_algos.common.arrays import Array, Int64Array
from curiosity_algos.common.generators import generator_state, load_generator_state
from curiosity_algos.evaluation.rollouts import final_behaviors
from curiosity_algos.experiments.checkpoint_files import Recordable, check_recordable, write_model
from curiosity_algos.experiments.description import check_same, describe_run, describe_settings
from curiosity_algos.experiments.progress_log import SECONDS, TIMESTEPS, ProgressLog
from curiosity_algos.experiments.run_folder import (
    REWARDING,
    Columns,
    RunFolder,
    read_arrays,
    write_arrays,
    write_json,
)
from curiosity_algos.loops.evolutionary_algorithm import EvolutionaryAlgorithm
from curiosity_algos.sb3.callbacks import ExplorationCallback
from curiosity_algos.state.episodes import record_episodes
from curiosity_algos.state.file import read, save
from curiosity_algos.state.settings import python_number
from curiosity_gym.validation import check_positive

N_REWARDING, N_SAMPLED = 5000, 1000
"""Most policies that a checkpoint keeps: of those that succeeded, and of all."""
_FOUND = "what a run has found"
"""Kind of the file of an `ExplorationCallback`'s state."""
_SPAWN_KEYS = 0x5A7E, 0x5A7F
"""Of the draws of the two samples of policies."""
FIELDS = ("parameters", "return", "generation", "episode_seed")
"""Of a policy in `rewarding.npz` and `sample.npz`."""


class Reservoir:
    """Keeps `size` policies, every one of those seen with the same probability (Vitter 1985, R).

    The states of an episode are not stored: the policy and the seed play it again.
    """

    def __init__(self, size: int, seed: np.random.SeedSequence) -> None:
        self.size = size
        self.n_seen = 0
        self._policies: list[dict[str, Any]] = []
        self._rng = np.random.default_rng(seed)

    def add(self, policy: Mapping[str, Any]) -> None:
        """See one more policy, a value for each of `FIELDS`, and store a copy if it is drawn."""
        self.n_seen += 1
        place = len(self._policies)
        if place >= self.size:
            place = int(self._rng.integers(self.n_seen))
        if place < self.size:  # copied: a view would keep the whole generation in memory
            self._policies[place : place + 1] = [{k: np.array(v) for k, v in policy.items()}]

    def arrays(self) -> dict[str, Array]:
        """The `FIELDS` (n, ...) of n stored policies, `n_seen`, and the state of the draws."""
        stacked = {name: np.array([policy[name] for policy in self._policies]) for name in FIELDS}
        state = generator_state(self._rng)
        return {**stacked, "n_seen": np.array(self.n_seen), "rng": np.array(state)}

    def load(self, arrays: Mapping[str, Array]) -> None:
        """Restore what `arrays` gave."""
        columns = [arrays[name] for name in FIELDS]
        self._policies = [dict(zip(FIELDS, row, strict=True)) for row in zip(*columns, strict=True)]
        self.n_seen = int(arrays["n_seen"])
        load_generator_state(self._rng, str(arrays["rng"]))


class SaveRun(BaseCallback):
    """Records a run in a folder, see `curiosity_algos.experiments.run_folder`.

    A run that was killed continues from its last checkpoint, `RunFolder(folder).checkpoint`, with
    `reset_num_timesteps=False`, and ends in the same files. `load_baseline` loads `TD3ICM`, and
    algorithms of Stable-Baselines3 and sb3-contrib. A VecNormalize is in the checkpoint's
    `vecnormalize.pkl`; `load_baseline` leaves it to you.

    Args:
        folder: Folder of the run: empty or missing, or that of the run that continues.
        interval: Seconds between two checkpoints, above 0. One more is taken when `learn` ends,
            without the transitions that bonuses and TD3 are trained on: a run that continues from
            there collects new ones, and the model warns of it.
        save_replay_buffer: Whether checkpoints hold the transitions of a replay buffer. The last
            one does not; all hold the bonus and the weight of a `BonusReplayBuffer`.

    Raises:
        ValueError: When `learn` begins: if the model steps no VecEnv, as sb3-contrib's ARS, or no
            Monitor sees its episodes; if the folder holds another run, or another process trains
            there. Later: if a behavior is not finite, or of other entries than before.

    Warns:
        UserWarning: When a run begins in an environment that `run.json` cannot say how to make.
    """

    model: Recordable

    def __init__(
        self,
        folder: str | os.PathLike[str],
        *,
        interval: float = 60.0,
        save_replay_buffer: bool = False,
    ) -> None:
        super().__init__()
        check_positive(interval=interval)
        self.folder = RunFolder(folder)
        self.interval = interval
        self.save_replay_buffer = save_replay_buffer
        self._log: ProgressLog | None = None
        self._lock: FileLock | None = None

    def _on_training_start(self) -> None:
        self.close()
        check_recordable(self.model)
        seeds = [np.random.SeedSequence(self.model.seed, spawn_key=(key,)) for key in _SPAWN_KEYS]
        self._rewarding = Reservoir(N_REWARDING, seeds[0])
        self._sample = Reservoir(N_SAMPLED, seeds[1])
        self._pending: list[Columns] = []
        description = describe_run(self.model)
        self._check_folder(description)
        self._lock = self.folder.lock()
        observers: list[BaseCallback] = []
        if not isinstance(self.model, EvolutionaryAlgorithm):  # which counts by itself
            observers.append(ExplorationCallback())
            record_episodes(self.training_env)
        self._observers = CallbackList(observers)
        self._observers.init_callback(self.model)
        self._observers.on_training_start(self.locals, self.globals)
        self._begin_or_go_on(description)
        self._began = self._saved = time.monotonic()
        self._log = ProgressLog(self.folder.progress, self.model.num_timesteps, self._state)
        self.logger.output_formats.append(self._log)

    @property
    def _found(self) -> EvolutionaryAlgorithm | ExplorationCallback:
        """The object that knows of coverage, best return, first reward and success."""
        return next(iter(self._observers.callbacks), self.model)  # type: ignore[return-value]

    def _check_folder(self, description: dict[str, Any]) -> None:
        if self.folder.is_empty():
            return
        result = self.folder.result()
        there = self.folder.describe() | result.get("in_force", {})
        there["num_timesteps"] = result.get("timesteps", 0)
        here = description | {"num_timesteps": self.model.num_timesteps}
        check_same(self.folder.path, there, here)

    def _begin_or_go_on(self, description: dict[str, Any]) -> None:
        checkpoint = self.folder.checkpoint
        if self.folder.is_empty():
            self.folder.begin(description)
            if reason := description.get("env_unknown"):
                warnings.warn(
                    f"run.json cannot say how to make `env`: {reason}. `play` and `export_minari` "
                    "will need an `env`.",
                    stacklevel=2,
                )
        result = self.folder.result()
        self._n_episodes = result.get("n_episodes", 0)
        self._seconds_before: float = result.get("seconds", 0.0)
        self.folder.drop_after(self._n_episodes)
        self._n_entries = self.folder.n_entries()
        if checkpoint is None:
            return
        self._rewarding.load(read_arrays(checkpoint / "rewarding.npz", REWARDING))
        if isinstance(self.model, EvolutionaryAlgorithm):
            self._sample.load(read_arrays(checkpoint / "sample.npz", REWARDING))
        if isinstance(self._found, ExplorationCallback):
            found = read(checkpoint / "found.npz", _FOUND)[1]
            self._found.load_state_dict(found)
        for name, (value, count) in result["pending_log"].items():
            self.logger.name_to_value[name], self.logger.name_to_count[name] = value, count

    def _on_rollout_start(self) -> None:
        # All of the rollout before has been learned from and logged by now.
        if time.monotonic() - self._saved >= self.interval:
            self.save()

    def _on_step(self) -> bool:
        self._observers.on_step()
        infos = self.locals["infos"]
        # For a Monitor, too: what ends for the learner alone, as with a life in Atari, goes on.
        ended = np.array(
            [i for i in np.flatnonzero(self.locals["dones"]) if "episode" in infos[i]], np.int64
        )
        if len(ended):
            self._pending.append(self._final_states(ended))
            self._sample_policies()
        return True

    def _on_rollout_end(self) -> None:
        self._observers.on_rollout_end()

    def _on_training_end(self) -> None:
        assert self._log is not None
        self._log.end(self.logger.name_to_value)
        self._save(exclude=["buffer"])
        self.folder.note(ended=True)
        self.close()

    def close(self) -> None:
        """Let go of the folder, as when `learn` ends; after an error, before others may use it."""
        if self._log is not None and self._log in self.logger.output_formats:
            self.logger.output_formats.remove(self._log)
        if self._lock is not None:
            self._lock.release()

    def _state(self) -> dict[str, float]:
        """Timesteps, seconds and coverage, for the log."""
        coverage = {f"coverage/{k}": share for k, share in self._found.coverage_shares.items()}
        return {TIMESTEPS: self.model.num_timesteps, SECONDS: self._seconds(), **coverage}

    def _final_states(self, ended: Int64Array) -> Columns:
        """An entry for each episode that ended in this step."""
        infos = [self.locals["infos"][i] for i in ended]
        episodes = [info["episode"] for info in infos]
        behaviors, n_entries = final_behaviors(infos), self._n_entries
        self._n_entries = behaviors.shape[1]
        if n_entries not in (None, self._n_entries):
            raise ValueError(
                '`env` must end every episode with an info["behavior"] of as many numbers, or none '
                f"with any: one had {self._n_entries}, those before {n_entries}."
            )
        intrinsic = self.locals.get("intrinsic")
        return {
            "generation": np.full(len(ended), getattr(self.model, "generation", 0)),
            "timesteps": np.full(len(ended), self.model.num_timesteps),
            "return": np.array([episode["r"] for episode in episodes], dtype=np.float64),
            "length": np.array([episode["l"] for episode in episodes]),
            "success": np.array([bool(info.get("is_success", False)) for info in infos]),
            "curiosity": np.full(len(ended), np.nan) if intrinsic is None else intrinsic[ended],
            "behavior": behaviors,
        }

    def _sample_policies(self) -> None:
        parameters = self.locals.get("parameters")
        if parameters is None:  # an algorithm that trains one policy
            return
        columns = self._pending[-1]
        for i, is_success in enumerate(columns["success"]):
            policy = {"parameters": parameters[i], "episode_seed": self.locals["episode_seed"]}
            policy |= {k: columns[k][i] for k in ("return", "generation")}
            self._sample.add(policy)
            if is_success:
                self._rewarding.add(policy)

    def _seconds(self) -> float:
        return self._seconds_before + time.monotonic() - self._began

    def save(self) -> None:
        """Take a checkpoint now, after a generation or a step."""
        self._save(exclude=[])

    def _save(self, exclude: list[str]) -> None:
        if self._pending:
            joined = {
                name: np.concatenate([each[name] for each in self._pending])
                for name in self._pending[0]
            }
            self.folder.add_final_states(self._n_episodes, joined)
            self._n_episodes += len(joined["return"])
            self._pending.clear()
        self.folder.commit(
            self.model.num_timesteps, lambda folder: self._write_checkpoint(folder, exclude)
        )
        self._saved = time.monotonic()

    def _write_checkpoint(self, folder: Path, exclude: list[str]) -> None:
        write_model(self.model, folder, exclude, save_replay_buffer=self.save_replay_buffer)
        write_arrays(folder / "rewarding.npz", self._rewarding.arrays())
        if isinstance(self.model, EvolutionaryAlgorithm):
            write_arrays(folder / "sample.npz", self._sample.arrays())
        if isinstance(self._found, ExplorationCallback):
            save(folder / "found.npz", _FOUND, {}, self._found.state_dict())
        write_json(folder / "result.json", self._result())

    def _result(self) -> dict[str, Any]:
        model, found = self.model, self._found
        return {
            "timesteps": model.num_timesteps,
            "total_timesteps": int(model._total_timesteps),  # SB3 keeps `1e6` as it was given
            "n_episodes": self._n_episodes,
            "best_return": found.best_return if np.isfinite(found.best_return) else None,
            "first_reward_timesteps": found.first_reward_timesteps,
            "first_success_timesteps": found.first_success_timesteps,
            "coverage": found.coverage_shares,
            "n_rewarding": self._rewarding.n_seen,
            "seconds": self._seconds(),
            "pending_log": self._pending_log(),
            "in_force": describe_settings(model),
            "ended": False,
        }

    def _pending_log(self) -> dict[str, tuple[float, int]]:
        """Values and counts of the next row: an algorithm may log less often than it is saved."""
        assert self._log is not None
        recorded, counts = self.logger.name_to_value, self.logger.name_to_count
        numbers = int | float | np.number
        return {
            name: (python_number(value), counts.get(name, 0))
            for name, value in (self._log.pending | recorded).items()
            if isinstance(value, numbers)
        }
