"""A replay buffer that adds an exploration bonus to the reward each time it samples."""

from __future__ import annotations

import copy
import os
from collections.abc import Mapping
from typing import Any, Unpack

import numpy as np
import torch as th
from gymnasium import spaces
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.preprocessing import get_obs_shape
from stable_baselines3.common.type_aliases import DictReplayBufferSamples, ReplayBufferSamples
from stable_baselines3.common.vec_env import VecNormalize

from curiosity_algos.bonuses.base import check_needs_no_episodes, check_rewards
from curiosity_algos.bonuses.encoders import ImageInputs, action_scale
from curiosity_algos.bonuses.transitions import draw_steps
from curiosity_algos.bonuses.views import View
from curiosity_algos.common.arrays import Array, Int64Array, Mask
from curiosity_algos.common.generators import generator_state, load_generator_state
from curiosity_algos.common.networks import single_torch_thread
from curiosity_algos.curiosity.curiosity import (
    Curiosity,
    CuriosityKeywords,
    OfCuriosity,
    check_keywords_of,
)
from curiosity_algos.evaluation.rollouts import check_observations
from curiosity_algos.sb3.observations import ObservationRows, check_sb3_takes
from curiosity_algos.state import file
from curiosity_algos.state.check import check_keys, check_like
from curiosity_algos.state.settings import HasSettings
from curiosity_gym.validation import check_at_least_one, check_seed

KIND = "BonusReplayBuffer"
DEFAULTS: CuriosityKeywords = {"weight": 1.0, "norm_reward": False}
"""Other than those of `Curiosity`, which were chosen with PPO: a critic learns little from .02."""
N_SCORED = 2048
"""Vectors whose bonus is computed in one call, as each call costs as much as a batch itself."""
N_WHOLE = 128
"""Of multiples of so many a bonus has the same bits whatever stands beside it."""
COLUMNS = (
    *("observations", "next_observations", "actions", "rewards", "dones", "timeouts"),
    *("scores", "scored_at"),
)
"""Of each transition; last what the bonus said, and after which training."""


class BonusReplayBuffer(HasSettings, ReplayBuffer):
    """Keeps the rewards of the task, and gives `reward + weight * bonus` with the bonus of now.

    With `norm_reward` the sum is over its scale, as in `BonusVecEnvWrapper`.

    A bonus stored with its transition would be that of long ago. Any off-policy algorithm of
    Stable-Baselines3's API takes it:

        SAC("MlpPolicy", env, replay_buffer_class=BonusReplayBuffer,
            replay_buffer_kwargs={"bonus": "apt"})

    The bonus is trained on what is collected, and divided by the running standard deviation of its
    discounted sum (Burda et al. 2018), so that a `weight` means much the same whatever its scale.
    Until its first training it is 0; between two of them no transition is scored twice. Value
    targets stop at terminations only: the last step of a truncated episode goes on.

    Further keywords are those of `Curiosity`: `bonus`, `bonus_kwargs`, `weight` (1 by default),
    `extrinsic`, `norm_reward` (False by default), `gamma`, `train_interval`, `n_updates` and
    `batch_size`. Without a `train_interval` it trains when `train_bonus` is called.

    Args:
        buffer_size: Transitions kept of all environments, the newest: one of each at least.
        observation_space: Of a single environment: Box, MultiBinary, Discrete or MultiDiscrete from
            0, or a Dict of such, which `MultiInputPolicy` takes. Samples are SB3's own; the bonus
            sees images as they are, and others as vectors.
        action_space: Box with bounds, or Discrete.
        device: Where samples go, and the networks of a bonus that is named.
        n_envs: Environments side by side.
        optimize_memory_usage: False: the bonus needs the last observations of episodes.
        observation_key: The entry of a Dict that the bonus sees; None: all, as one vector.
        seed: Of the networks and the draws; None: drawn from NumPy's generator, which SB3's
            algorithms seed with theirs.

    Attributes:
        metrics: Mean losses of the last training, and the bonus of what it was called for:
            `ExplorationCallback` logs them.
        settings: What callbacks may change, as it is now.

    Raises:
        ValueError: If an argument is out of its range, the spaces are of another kind, or the bonus
            asks what an episode has seen, as `E3B`, `ETD`, `NGU` and `NovelD` do.
    """

    bonus, bonus_kwargs, metrics = OfCuriosity(), OfCuriosity(), OfCuriosity()
    weight, extrinsic, norm_reward = OfCuriosity(), OfCuriosity(), OfCuriosity()
    gamma = OfCuriosity()
    train_interval, n_updates, batch_size = OfCuriosity(), OfCuriosity(), OfCuriosity()
    settings = OfCuriosity()

    def __init__(
        self,
        buffer_size: int,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        device: th.device | str = "auto",
        n_envs: int = 1,
        optimize_memory_usage: bool = False,
        *,
        observation_key: str | None = None,
        seed: int | np.random.SeedSequence | None = None,
        **curiosity: Unpack[CuriosityKeywords],
    ) -> None:
        check_keywords_of(type(self), curiosity)
        check_at_least_one(buffer_size=buffer_size)
        check_sb3_takes(observation_space)
        if optimize_memory_usage:
            raise ValueError(
                "`optimize_memory_usage` must be False: the bonus needs the last observations of "
                "episodes."
            )
        seed = _seed_sequence(seed)
        (networks_seed,) = copy.deepcopy(seed).spawn(1)  # two buffers of one seed are the same
        self._view = View(observation_space, observation_key)
        both_spaces = self._view.space, action_space
        self.curiosity = Curiosity(
            *both_spaces,
            n_envs=n_envs,
            seed=networks_seed,
            device=device,
            **CuriosityKeywords({**DEFAULTS, **curiosity}),
        )
        check_needs_no_episodes(self.bonus, "a replay buffer")
        self._rows = rows = ObservationRows(observation_space)
        super().__init__(buffer_size, rows.array_space, action_space, device, n_envs)
        self.observation_space = observation_space
        self.obs_shape = get_obs_shape(observation_space)  # type: ignore[assignment]  # SB3's of a Dict
        self.observations = rows.view(self.observations)
        self.next_observations = rows.view(self.next_observations)
        shape = self.buffer_size, n_envs
        self.scores, self.scored_at = np.zeros(shape, np.float32), np.zeros(shape, np.int64)
        self._rng = np.random.default_rng(seed)
        self._shows_images = ImageInputs.of(self._view.space) is not None
        self.observation_key = observation_key
        self._settled = {"buffer_size", "n_envs", "observation_key", "seed"}

    def __repr__(self) -> str:
        size, most = (n * self.n_envs for n in (self.size(), self.buffer_size))
        return f"<{type(self).__name__}: {size:,} of {most:,} transitions>"

    # -- what is collected ----------------------------------------------------------------------

    def add(
        self,
        obs: Any,
        next_obs: Any,
        action: Array,
        reward: Array,
        done: Array,
        infos: list[dict[str, Any]],
    ) -> None:
        """Add as SB3 does, but nothing that would train networks to NaN.

        Raises:
            ValueError: If an observation or a reward is not finite, or has a bonus already.
        """
        if "reward_intrinsic" in infos[0]:
            raise ValueError(
                "`env` must have no BonusVecEnvWrapper: BonusReplayBuffer adds a bonus itself."
            )
        for observations in (obs, next_obs):
            entries = observations.values() if isinstance(observations, dict) else [observations]
            for entry in entries:
                check_observations(entry)
        check_rewards(reward)
        self.scored_at[self.pos] = 0
        obs, next_obs = (self._rows.stored(seen, self.n_envs) for seen in (obs, next_obs))
        self._end_what_was_left(obs)
        super().add(obs, next_obs, action, reward, done, infos)
        if self.curiosity.is_due(self.n_envs):
            self.train_bonus()

    def _end_what_was_left(self, obs: Array) -> None:
        """Truncate episodes before that this step does not go on with: no span goes over a gap."""
        if not self.size():
            return
        newest = (self.pos - 1) % self.buffer_size
        differs = (self.next_observations[newest] != obs).reshape(self.n_envs, -1).any(axis=1)
        is_left = differs & (self.dones[newest] == 0)
        self.dones[newest, is_left] = self.timeouts[newest, is_left] = 1.0
        if not self.curiosity.n_untrained:  # the scale has seen that step
            self.curiosity.total_scale.end(is_left)

    def train_bonus(self) -> None:
        """Train the bonus, and score what came since the last time; nothing where nothing came."""
        curiosity = self.curiosity
        newest = self._newest(curiosity.n_untrained // self.n_envs)
        if not len(newest):
            return
        with single_torch_thread():
            for some in self._parts(newest):
                self._observe(some)
            losses = curiosity.train(self.sample_transitions)
            bonus = self._score(newest)
        of_steps = self.rewards.take(newest), bonus.astype(np.float64), self.dones.take(newest) > 0
        paid = []
        for rewards, scores, ended in zip(
            *(each.reshape(-1, self.n_envs) for each in of_steps), strict=True
        ):
            paid.append(curiosity.scaled(scores, is_learning=True))
            curiosity.total(rewards, paid[-1], ended=ended, is_learning=True)
        mean, largest = self.weight * np.mean(paid), self.weight * np.max(paid)
        self.metrics = {**losses, "intrinsic/mean": float(mean), "intrinsic/max": float(largest)}

    # -- what is learned from -------------------------------------------------------------------

    def sample(self, batch_size: int, env: VecNormalize | None = None) -> ReplayBufferSamples:
        """Transitions drawn uniformly with replacement; the bonus sees raw observations.

        Raises:
            ValueError: If both the buffer and a VecNormalize scale rewards.
        """
        if self.norm_reward and env is not None and env.norm_reward:
            raise ValueError(
                "`norm_reward` must be False of the buffer or of the VecNormalize: each would "
                "scale what the other has scaled."
            )
        drawn = self._draw(batch_size)
        rewards = self._normalize_reward(self.rewards.take(drawn), env)
        rewards = self.curiosity.total(rewards, self._bonus_of(drawn))
        is_dict = isinstance(self.observation_space, spaces.Dict)
        samples: Any = DictReplayBufferSamples if is_dict else ReplayBufferSamples
        return samples(  # type: ignore[no-any-return]
            self._sampled(self._at("observations", drawn), env),
            self.to_torch(self._at("actions", drawn)),
            self._sampled(self._at("next_observations", drawn), env),
            self.to_torch(self._terminated(drawn)[:, None].astype(np.float32)),
            self.to_torch(rewards.astype(np.float32)[:, None]),
        )

    def _sampled(self, rows: Array, env: VecNormalize | None) -> th.Tensor | dict[str, th.Tensor]:
        normalized = self._normalize_obs(self._rows.sampled(rows), env)
        if isinstance(normalized, dict):
            return {name: self.to_torch(entry) for name, entry in normalized.items()}
        return self.to_torch(normalized)

    def _bonus_of(self, drawn: Int64Array) -> Array:
        """Bonus (n,) of transitions, scaled, before it is weighted."""
        if not self.curiosity.n_trainings:
            return np.zeros(len(drawn), dtype=np.float32)
        self._score_unknown(drawn)
        return self.curiosity.scaled(self.scores.take(drawn))

    def _score_unknown(self, drawn: Int64Array) -> None:
        """Score those of the transitions that were not since the bonus was last trained.

        Others that may be drawn later fill a batch up.
        """
        unknown = self._unknown(np.unique(drawn))
        if not len(unknown):
            return
        n_whole = min(N_WHOLE, len(drawn))
        n = -(-len(unknown) // n_whole) * n_whole
        others = (drawn[0] + np.arange(N_SCORED)) % (self.size() * self.n_envs)
        others = np.setdiff1d(self._unknown(others), unknown)
        scored = np.resize(np.concatenate([unknown, others])[:n], n)
        with single_torch_thread():
            self.scores.put(scored, self._score(scored))
        self.scored_at.put(scored, self.curiosity.n_trainings)

    def _unknown(self, drawn: Int64Array) -> Int64Array:
        """Those of the transitions that were not scored since then."""
        return np.asarray(drawn[self.scored_at.take(drawn) != self.curiosity.n_trainings])

    def _score(self, numbers: Int64Array) -> Array:
        """Bonus (n,) of transitions, as the module gives it."""
        parts = map(self._transitions, self._parts(numbers))
        return np.concatenate([self.curiosity.score(*part) for part in parts])

    def _parts(self, numbers: Int64Array) -> list[Int64Array]:
        """Parts whose layers fit the cache; a batch of images fills it."""
        size = self.batch_size if self._shows_images else max(N_SCORED, self.batch_size)
        return [numbers[begin : begin + size] for begin in range(0, len(numbers), size)]

    def sample_transitions(self, batch_size: int) -> tuple[th.Tensor, ...]:
        """Observations, actions, and next observations, which may be some steps later."""
        drawn, horizon = self._draw(batch_size), self.curiosity.horizon
        windows = (drawn[:, None] + np.arange(horizon) * self.n_envs) % self.dones.size
        newest = (self.pos - 1) % self.buffer_size
        is_last = (self.dones.take(windows) > 0) | (windows // self.n_envs == newest)
        is_last[:, -1] = True
        steps = np.minimum(draw_steps(self._rng, drawn.shape, horizon), is_last.argmax(axis=1) + 1)
        ends = windows[np.arange(batch_size), steps - 1]
        before, actions, _ = self._transitions(drawn)
        after = self._seen(self._at("next_observations", ends))
        actions = actions.reshape(batch_size, -1).astype(np.float32, copy=False)
        return th.from_numpy(before), th.from_numpy(actions), th.from_numpy(after)

    def _transitions(self, numbers: Int64Array) -> tuple[Array, ...]:
        return (
            self._seen(self._at("observations", numbers)),
            self._taken(self._at("actions", numbers)),
            self._seen(self._at("next_observations", numbers)),
        )

    def _observe(self, numbers: Int64Array) -> None:
        before = self._seen(self._at("observations", numbers))
        ends = self._at("next_observations", numbers[self._terminated(numbers)])
        self.curiosity.observe(before, self._seen(ends))

    def _terminated(self, numbers: Int64Array) -> Mask:
        """Where the task ended an episode, no limit of time."""
        return np.asarray((self.dones.take(numbers) > 0) & (self.timeouts.take(numbers) == 0))

    def _seen(self, rows: Array) -> Array:
        seen = self._view(self._rows.own(rows))
        return seen if self._shows_images else seen.astype(np.float32, copy=False)

    def _taken(self, actions: Array) -> Array:
        """Actions as the environment takes them: (n, A) of a Box, (n,) of a Discrete."""
        if not isinstance(self.action_space, spaces.Box):
            return actions[:, 0]
        center, half_range = action_scale(self.action_space)
        return center + half_range * actions.astype(np.float32, copy=False)

    def _draw(self, n: int) -> Int64Array:
        """Numbers of transitions, drawn uniformly; the environments of a row follow each other."""
        return self._rng.integers(self.size() * self.n_envs, size=n)

    def _newest(self, n: int) -> Int64Array:
        """Numbers of the last n steps of every environment, in their order."""
        n = min(n, self.size())
        begin = (self.pos - n) * self.n_envs
        return np.arange(begin, begin + n * self.n_envs) % self.dones.size

    def _at(self, column: str, numbers: Int64Array) -> Array:
        rows: Array = getattr(self, column)
        return rows.reshape(-1, *rows.shape[2:])[numbers]

    # -- save and load --------------------------------------------------------------------------

    def _stored(self, n: int) -> dict[str, Any]:
        """The first n rows of each column, as they lie; of a Dict of observations by entry."""
        return {name: self._rows.sampled(getattr(self, name)[:n]) for name in COLUMNS}

    def state_dict(self, *, transitions: bool = True) -> dict[str, Any]:
        """Everything that a resumed run needs, with or without transitions."""
        n, pos, full = (self.size(), self.pos, self.full) if transitions else (0, 0, False)
        return {
            "curiosity": self.curiosity.state_dict(),
            "rng": generator_state(self._rng),
            "transitions": {**self._stored(n), "pos": pos, "full": full},
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` of a buffer with the same settings gave.

        Raises:
            ValueError: If it is another's; nothing but a bonus of your own has changed then.
        """
        check_keys(state, ("curiosity", "rng", "transitions"))
        columns, rng = dict(state["transitions"]), np.random.default_rng(0)
        check_like(columns, {**self._stored(0), "pos": 0, "full": False}, "transitions")
        load_generator_state(rng, state["rng"])
        self.curiosity.load_state_dict(state["curiosity"])
        self._rng, self.pos, self.full = rng, columns.pop("pos"), columns.pop("full")
        for name, column in columns.items():
            self._rows.load(getattr(self, name), column)

    def save(self, path: str | os.PathLike[str], *, transitions: bool = True) -> None:
        """Write transitions and bonus to a file that `restore` reads without running code.

        Args:
            path: Of the file.
            transitions: False: all but them.

        Raises:
            OSError: If it cannot be written; an older file is then as it was.
            ValueError: If the state of a bonus of your own holds more than arrays, tensors and
                plain values.
        """
        state = self.state_dict(transitions=transitions)
        file.save(path, KIND, {"made": self._made, "now": self.settings}, state)

    @property
    def _made(self) -> dict[str, Any]:
        names = "buffer_size", "n_envs", "observation_key"
        return self.curiosity.made_with | {name: getattr(self, name) for name in names}

    def restore(self, path: str | os.PathLike[str]) -> None:
        """Take over what `save` of a buffer with the same settings wrote.

        Those that a callback may have changed, as `weight`, are as they were when it was saved.

        Raises:
            FileNotFoundError: If there is no such file.
            ValueError: If it is damaged, or another's, or its bonus was made with other keywords;
                this buffer is then as it was.
        """
        settings, state = file.read(path, KIND)
        what, before = "`path` must be saved of a buffer with", self.settings
        if (made := settings.get("made")) != self._made:
            raise ValueError(f"{what} {self._made}, {path} is of {made}.")
        try:
            self.curiosity.load_settings(settings.get("now"))
            self.load_state_dict(state)
        except Exception as error:  # a damaged file fails in more ways than can be named
            self.curiosity.load_settings(before)
            raise ValueError(f"{what} the same spaces, {path} is not: {error}") from error


def _seed_sequence(seed: int | np.random.SeedSequence | None) -> np.random.SeedSequence:
    """The seed's sequence; of None one that NumPy's generator draws."""
    if isinstance(seed, np.random.SeedSequence):
        return seed
    check_seed(seed)
    # The global generator is what SB3's algorithms seed.
    return np.random.SeedSequence(np.random.randint(2**31) if seed is None else seed)  # noqa: NPY002
