"""A replay buffer that adds an exploration bonus to the reward each time it samples."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
import numpy.typing as npt
import torch as th
from gymnasium import spaces
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.type_aliases import ReplayBufferSamples
from stable_baselines3.common.vec_env import VecNormalize

from curiosity_algos.bonuses.base import Bonus, check_rewards
from curiosity_algos.bonuses.encoders import action_scale
from curiosity_algos.bonuses.spans import draw_steps, horizon_of
from curiosity_algos.common.randomness import generator_state, load_generator_state
from curiosity_algos.evaluation.rollouts import check_observations

N_SCORED = 2048
"""Vectors whose bonus is computed in one call, as each call costs as much as a batch itself."""
COLUMNS = ("observations", "actions", "next_observations", "rewards", "dones", "timeouts")


class CuriosityReplayBuffer(ReplayBuffer):
    """Keeps the rewards of the task, and gives `reward + weight * bonus` with the bonus of now.

    A bonus stored with its transition would be that of a module long since trained on. Value
    targets stop at terminations only: the last step of a truncated episode goes on.

    Actions are held scaled to [-1, 1], as Stable-Baselines3 does; a bonus gets them as the
    environment takes them.

    Args:
        capacity: Transitions kept, the newest.
        observation_space: Of a single environment.
        action_space: One-dimensional Box with bounds.
        bonus: Scores the transitions that are sampled; who holds the buffer trains it.
        weight: Of the bonus.
        extrinsic: Whether the reward of the task counts.
        seed: Of the draws.
        device: Where samples go.
    """

    _ahead: Iterator[tuple[npt.NDArray[Any], npt.NDArray[Any]]] = iter(())

    def __init__(
        self,
        capacity: int,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        *,
        bonus: Bonus,
        weight: float,
        extrinsic: bool,
        seed: np.random.SeedSequence,
        device: th.device,
    ) -> None:
        super().__init__(capacity, observation_space, action_space, device)
        self.bonus = bonus
        self.weight = weight
        self.extrinsic = extrinsic
        assert isinstance(action_space, spaces.Box)
        self._center, self._half_range = action_scale(action_space)
        self._rng = np.random.default_rng(seed)

    def add(
        self,
        obs: npt.NDArray[Any],
        next_obs: npt.NDArray[Any],
        action: npt.NDArray[Any],
        reward: npt.NDArray[Any],
        done: npt.NDArray[Any],
        infos: list[dict[str, Any]],
    ) -> None:
        """Add as SB3 does, but nothing that would train networks to NaN.

        Raises:
            ValueError: If an observation or the reward is not finite.
        """
        check_observations(obs)
        check_observations(next_obs)
        check_rewards(reward)
        self._end_what_was_left(obs)
        super().add(obs, next_obs, action, reward, done, infos)

    def _end_what_was_left(self, obs: npt.NDArray[Any]) -> None:
        """Truncate the episode before, if this step begins another: no span goes over a gap."""
        newest = self.pos - 1
        if self.size() and not np.array_equal(self.next_observations[newest], obs):
            is_done = self.dones[newest] > 0
            self.timeouts[newest] = np.where(is_done, self.timeouts[newest], 1.0)
            self.dones[newest] = 1.0

    def sample(self, batch_size: int, env: VecNormalize | None = None) -> ReplayBufferSamples:
        """Transitions drawn uniformly with replacement; the bonus sees raw observations."""
        rows, curiosity = next(self._ahead, None) or next(self._drawn(1, batch_size))
        observations, _, next_observations = self._transitions(rows)
        rewards = self.weight * curiosity
        if self.extrinsic:
            rewards = rewards + self._normalize_reward(self.rewards[rows, 0], env)
        ended = self.dones[rows] * (1.0 - self.timeouts[rows])
        values: tuple[Any, ...] = (
            self._normalize_obs(observations, env),
            self.actions[rows, 0],
            self._normalize_obs(next_observations, env),
            ended,
            rewards.astype(np.float32)[:, None],
        )
        return ReplayBufferSamples(*map(self.to_torch, values))

    @contextmanager
    def drawn_ahead(self, n_batches: int, batch_size: int) -> Iterator[None]:
        """A context in which bonus and buffer stay as they are: batches at less cost.

        Their rows are those that are drawn otherwise; of batches that are no multiples of 128 the
        bonus may be rounded otherwise.
        """
        self._ahead = self._drawn(n_batches, batch_size)
        try:
            yield
        finally:
            self._ahead = iter(())

    def _drawn(
        self, n_batches: int, batch_size: int
    ) -> Iterator[tuple[npt.NDArray[Any], npt.NDArray[Any]]]:
        """Rows (n,) of each batch and their bonus (n,), computed when the batch is needed."""
        is_image = len(self.observation_space.shape or ()) > 1  # of which one batch is a lot
        n_together = 1 if is_image else max(1, N_SCORED // batch_size)
        for begin in range(0, n_batches, n_together):
            n = min(n_together, n_batches - begin)
            rows = self._draw(n * batch_size)
            curiosity = self.bonus.score(*self._transitions(rows))
            yield from zip(rows.reshape(n, -1), curiosity.reshape(n, -1), strict=True)

    def sample_transitions(self, batch_size: int) -> tuple[th.Tensor, ...]:
        """Observations, actions and next observations, as a bonus is trained on them."""
        rows, horizon = self._draw(batch_size), horizon_of(self.bonus)
        windows = (rows[:, None] + np.arange(horizon)) % self.buffer_size
        steps = np.minimum(draw_steps(self._rng, rows.shape, horizon), self._steps_left(windows))
        ends = windows[np.arange(batch_size), steps - 1]
        observations, actions, _ = self._transitions(rows)
        spans = observations, actions, self.next_observations[ends, 0]
        return tuple(map(th.from_numpy, spans))

    def _steps_left(self, windows: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        """Steps (n,) of each window (n, H) until its episode ends, or the newest transition."""
        newest = (self.pos - 1) % self.buffer_size
        is_last = (self.dones[windows, 0] > 0) | (windows == newest)
        is_last[:, -1] = True
        steps: npt.NDArray[np.int64] = is_last.argmax(axis=1) + 1
        return steps

    def newest(self, n: int) -> tuple[npt.NDArray[Any], ...]:
        """The last n transitions, in the order of their steps; fewer where fewer are held."""
        n = min(n, self.size())
        return self._transitions((self.pos - n + np.arange(n)) % self.buffer_size)

    def _draw(self, n: int) -> npt.NDArray[np.int64]:
        return self._rng.integers(self.size(), size=n)

    def _transitions(self, rows: npt.NDArray[np.int64]) -> tuple[npt.NDArray[Any], ...]:
        """Observations, actions and next observations, as a bonus takes them."""
        actions = self._center + self._half_range * self.actions[rows, 0]
        return self.observations[rows, 0], actions, self.next_observations[rows, 0]

    def state_dict(self) -> dict[str, Any]:
        """Transitions held, and the state of the draws."""
        held = {name: getattr(self, name)[: self.size()] for name in COLUMNS}
        buffer = {name: th.from_numpy(column.copy()) for name, column in held.items()}
        return {"buffer": {**buffer, "pos": self.pos}, "rng": generator_state(self._rng)}

    def load_state_dict(self, state: Mapping[str, Any], strict: bool = True) -> None:
        """Take over what `state_dict` gave; transitions left out of the file are none."""
        load_generator_state(self._rng, state["rng"])
        if "buffer" not in state:
            return
        held = dict(state["buffer"])
        position, n = held.pop("pos"), len(held["actions"])
        rows = np.arange(n)
        if n not in (position, self.buffer_size) or n > self.buffer_size:
            rows = ((position + rows) % n)[-self.buffer_size :]  # the newest of another capacity
            position = len(rows)
        self.pos, self.full = position % self.buffer_size, len(rows) == self.buffer_size
        for name, column in held.items():
            getattr(self, name)[: len(rows)] = column.cpu().numpy()[rows]
