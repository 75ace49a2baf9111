"""Whether a value of its own for the bonus helps PPO: `python -m benchmarks.two_heads` tells.

One head learns from the sum of both rewards, as README's recipe does. Two heads (Burda et al. 2018)
have a value of the task and one of the bonus, whose sum of future rewards goes on after the end of
an episode, and weigh the advantages of the two. Runs that `two_heads.csv` has are left alone.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from itertools import product
from pathlib import Path
from typing import Annotated, Any

import gymnasium as gym
import numpy as np
import pandas as pd
import torch as th
import typer
from gymnasium import spaces
from gymnasium.wrappers import RepeatAction
from stable_baselines3 import PPO
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.vec_env import VecEnvWrapper
from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs, VecEnvStepReturn

from benchmarks import minigrid
from benchmarks.kept import times
from benchmarks.measure import markdown
from benchmarks.results import FOLDER, add_rows, recorded
from curiosity_algos import BonusVecEnvWrapper
from curiosity_algos.evaluation.batches import terminations

DOOR = "MiniGrid-DoorKey-8x8-v0"
N_EPISODES, RELIABLE = 100, 90
KEYS = ["task", "learner", "seed"]


class Lock(gym.Env[Any, Any]):
    """Ten wheels that are turned one after the other; a wrong turn ends the episode.

    Each turn is one of four, and the right ones are drawn. The last wheel earns 1. A random policy
    opens it once in a million episodes, and who goes on to where it is new risks the end.
    """

    N_WHEELS, N_TURNS = 10, 4
    observation_space = spaces.Box(0.0, 1.0, (N_WHEELS + 1,))
    action_space = spaces.Discrete(N_TURNS)

    def __init__(self) -> None:
        self._right = np.random.default_rng(0).integers(self.N_TURNS, size=self.N_WHEELS)
        self._n_turned = 0

    def reset(self, *, seed: Any = None, options: Any = None) -> tuple[np.ndarray, dict[str, Any]]:
        """Turn all wheels back."""
        super().reset(seed=seed)
        self._n_turned = 0
        return self._observation, {}

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Turn the next wheel."""
        is_right = bool(action == self._right[self._n_turned])
        self._n_turned += is_right
        is_open = self._n_turned == self.N_WHEELS
        return self._observation, float(is_open), is_open or not is_right, False, {}

    @property
    def _observation(self) -> np.ndarray:
        return np.eye(self.N_WHEELS + 1, dtype=np.float32)[self._n_turned]


class BothRewards(VecEnvWrapper):
    """Gives the reward of the task and the bonus, (n, 2), in the place of their sum.

    Where a time limit ended an episode it adds what the policy expects of the rest: SB3's PPO
    cannot do that with two rewards.

    Attributes:
        model: The PPO that plays.
        ended: (n, 2), whether the sum of future rewards ends with the last step: the bonus' goes on
            after an end of the task.
    """

    model: PPO
    ended: np.ndarray

    def reset(self) -> VecEnvObs:
        """Begin new episodes."""
        return self.venv.reset()

    def step_wait(self) -> VecEnvStepReturn:
        """End a step."""
        observations, _, dones, infos = self.venv.step_wait()
        truncated = dones & ~terminations(dones, infos)
        self.ended = np.column_stack([dones, truncated])
        rewards = np.array([[info["reward_extrinsic"], info["reward_intrinsic"]] for info in infos])
        for i in np.flatnonzero(truncated):
            rewards[i] += self.model.gamma * self._value(infos[i].pop("terminal_observation"))
        return observations, rewards.astype(np.float32), dones, infos

    def _value(self, observation: np.ndarray) -> np.ndarray:
        policy = self.model.policy
        with th.no_grad():
            values = policy.predict_values(policy.obs_to_tensor(observation)[0])
        value: np.ndarray = values[0].cpu().numpy()
        return value


class TwoValues(ActorCriticPolicy):
    """A policy whose value network has two outputs.

    That of the task begins at 0: its advantage weighs so much that nothing else would count.
    """

    def _build(self, lr_schedule: Callable[[float], float]) -> None:
        super()._build(lr_schedule)
        self.value_net = th.nn.Linear(self.mlp_extractor.latent_dim_vf, 2)
        th.nn.init.orthogonal_(self.value_net.weight)
        th.nn.init.zeros_(self.value_net.weight[0])
        th.nn.init.zeros_(self.value_net.bias)
        learning_rate: Any = lr_schedule(1.0)
        self.optimizer = self.optimizer_class(
            self.parameters(), lr=learning_rate, **self.optimizer_kwargs
        )


class TwoReturns(RolloutBuffer):
    """Keeps rewards, values and returns (T, n, 2), and the weighted sum of both advantages.

    SB3's PPO flattens values and returns in the same order, so its loss is the mean over both.

    Attributes:
        venv: The environments that it is filled from.
        extrinsic_weight: Of the task's advantage; the bonus' is 1.
    """

    venv: BothRewards
    extrinsic_weight: float

    def reset(self) -> None:
        """Forget the rollout."""
        super().reset()
        shape = self.buffer_size, self.n_envs, 2
        self.rewards, self.values, self.returns = (np.zeros(shape, np.float32) for _ in range(3))
        self.ended = np.zeros(shape, np.bool_)

    def add(self, *step: Any) -> None:
        """Keep a step."""
        *before, values, log_probs = step
        pos, flat = self.pos, th.zeros(1)  # SB3 flattens the values, one of each environment
        super().add(*before, flat, log_probs)
        self.values[pos], self.ended[pos] = values.cpu().numpy(), self.venv.ended

    def compute_returns_and_advantage(self, last_values: th.Tensor, dones: np.ndarray) -> None:
        """Generalized advantages of both rewards."""
        following, advantage = last_values.cpu().numpy(), np.zeros((self.n_envs, 2), np.float32)
        for t in reversed(range(self.buffer_size)):
            goes_on = ~self.ended[t]
            error = self.rewards[t] + self.gamma * goes_on * following - self.values[t]
            advantage = error + self.gamma * self.gae_lambda * goes_on * advantage
            self.returns[t], following = advantage + self.values[t], self.values[t]
        advantages = self.returns - self.values
        self.advantages = self.extrinsic_weight * advantages[..., 0] + advantages[..., 1]


@dataclass(frozen=True)
class Task:
    """What is learned, and how.

    Attributes:
        make_env: Gives an environment, in which return is success alone.
        timesteps: As PPO counts them.
        weight: Of the bonus.
        bonus: Its name.
        settings: Of PPO.
    """

    make_env: Callable[[], gym.Env[Any, Any]]
    timesteps: int
    weight: float = 0.02
    bonus: str = "apt"
    settings: dict[str, Any] = field(default_factory=lambda: {"n_steps": 64})


def _maze(name: str) -> gym.Env[Any, Any]:
    return RepeatAction(gym.make(f"CuriosityMaze-{name}-v0"), 10)


TASKS = {
    **{name: Task(partial(_maze, name), 300_000) for name in ("Hard", "US", "Snake")},
    "a lock": Task(Lock, 200_000),
    "DoorKey-8x8": Task(
        partial(minigrid.make_env, DOOR), minigrid.FRAMES[DOOR], 0.1, "noveld", minigrid.SETTINGS
    ),
}


def one_head(venv: BonusVecEnvWrapper, weight: float, **settings: Any) -> PPO:
    """PPO on the sum of both rewards."""
    return PPO("MlpPolicy", venv, **settings)


def two_heads(venv: BonusVecEnvWrapper, weight: float, **settings: Any) -> PPO:
    """PPO with two values, each of which weighs in the loss as much as one does.

    Advantages are weighted, in place of the bonus: its value then learns from rewards of size 1.
    """
    venv.weight = 1.0
    both = BothRewards(venv)
    model = PPO(TwoValues, both, rollout_buffer_class=TwoReturns, vf_coef=1.0, **settings)
    buffer: Any = model.rollout_buffer
    both.model, buffer.venv, buffer.extrinsic_weight = model, both, 1.0 / weight
    return model


LEARNERS: dict[str, Callable[..., PPO]] = {"one head": one_head, "two heads": two_heads}


class Arrivals(BaseCallback):
    """When an episode first had a return, and when 90 of the last 100 had one.

    Attributes:
        first: Timesteps, or None.
        reliable: Timesteps, or None.
    """

    first: int | None = None
    reliable: int | None = None

    def __init__(self) -> None:
        super().__init__()
        self._last: deque[bool] = deque(maxlen=N_EPISODES)

    def _on_step(self) -> bool:
        for info in self.locals["infos"]:
            if "episode" in info:
                self._last.append(info["episode"]["r"] > 0.0)
        if self.first is None and any(self._last):
            self.first = self.num_timesteps
        if self.reliable is None and sum(self._last) >= RELIABLE:
            self.reliable = self.num_timesteps
        return True


def train(name: str, learner: str, seed: int) -> dict[str, Any]:
    """A run: when it arrived, and in how many of 100 episodes its last policy arrives."""
    th.set_num_threads(1)
    task, arrivals = TASKS[name], Arrivals()
    venv = make_vec_env(task.make_env, n_envs=16, seed=seed)
    venv = BonusVecEnvWrapper(venv, bonus=task.bonus, weight=task.weight, seed=seed, device="cpu")
    model = LEARNERS[learner](venv, task.weight, seed=seed, device="cpu", **task.settings)
    model.learn(task.timesteps, arrivals)
    returns, _ = evaluate_policy(
        model,
        make_vec_env(task.make_env, n_envs=16, seed=10_000),
        n_eval_episodes=N_EPISODES,
        deterministic=False,
        return_episode_rewards=True,
    )
    return {
        **dict(zip(KEYS, (name, learner, seed), strict=True)),
        "timesteps": task.timesteps,
        "first_success_timesteps": arrivals.first,
        "reliable_timesteps": arrivals.reliable,
        "drawn": sum(each > 0.0 for each in np.atleast_1d(returns)),
    }


def main(
    tasks: str = ",".join(TASKS),
    learners: str = ",".join(LEARNERS),
    seeds: str = "0,1,2",
    out: Annotated[Path, typer.Option(help="Where the CSV file goes.")] = FOLDER,
) -> None:
    """Train each task with each learner and seed, and add its row to the CSV file."""
    path = out / "two_heads.csv"
    for key in product(tasks.split(","), learners.split(","), map(int, seeds.split(","))):
        if key not in recorded(path, KEYS):
            add_rows(pd.DataFrame([train(*key)]), path, KEYS)


def table(values: pd.DataFrame) -> str:
    """A row for each task and learner: when each seed arrived, and its last policy."""
    rows = []
    for (task, learner), runs in values.groupby(["task", "learner"], sort=False):
        when = [times(runs[f"{what}_timesteps"], 1e3) for what in ("first_success", "reliable")]
        rows.append([task, learner, *map(" / ".join, [*when, runs["drawn"].map(str)])])
    first, reliable = "First success (k timesteps)", f"{RELIABLE} of the last {N_EPISODES}"
    return markdown(["Task", "PPO with", first, reliable, f"Of {N_EPISODES} at the end"], rows)


if __name__ == "__main__":
    typer.run(main)
