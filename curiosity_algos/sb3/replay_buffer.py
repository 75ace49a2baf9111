"""A replay buffer that adds an exploration bonus to the reward each time it samples."""

from __future__ import annotations

import copy
import os
from typing import Any, ClassVar

import numpy as np
import torch as th
from gymnasium import spaces
from stable_baselines3.common.type_aliases import DictReplayBufferSamples, ReplayBufferSamples
from stable_baselines3.common.vec_env import VecNormalize

from curiosity_algos.bonuses.base import Bonus, check_rewards, check_scores, show, train
from curiosity_algos.bonuses.encoders import ImageInputs, action_scale
from curiosity_algos.bonuses.episodes import check_needs_no_episodes
from curiosity_algos.bonuses.make import check_bonus_choice, for_one_policy, make_bonus
from curiosity_algos.bonuses.spans import horizon_of
from curiosity_algos.bonuses.transitions import draw_steps
from curiosity_algos.bonuses.views import View
from curiosity_algos.checkpoints.plain_files import plain
from curiosity_algos.common.arrays import Array, Int64Array, Mask
from curiosity_algos.common.networks import single_torch_thread
from curiosity_algos.evaluation.rollouts import check_observations
from curiosity_algos.sb3.held_observations import check_sb3_takes
from curiosity_algos.sb3.ordered_replay_buffer import OrderedReplayBuffer
from curiosity_algos.sb3.replay_arguments import (
    check_interval,
    check_schedule,
    check_size,
    seed_sequence,
)
from curiosity_algos.sb3.replay_file import check_buffer, read_buffer, write_buffer
from curiosity_algos.sb3.scale import BonusScale, check_discount
from curiosity_algos.state.settings import HasSettings
from curiosity_gym.validation import check_at_least_one, check_bool, check_not_negative

N_SCORED = 2048
"""Vectors whose bonus is computed in one call, as each call costs as much as a batch itself."""
N_WHOLE = 128
"""Of multiples of so many a bonus has the same bits whatever stands beside it."""
SETTLED = frozenset({"bonus", "bonus_kwargs", "buffer_size", "n_envs", "observation_key", "seed"})
"""Settings that a buffer was made with."""
COUNTERS = ("metrics", "_n_untrained", "_n_trainings")
"""What else a file holds, by the name of its attribute."""


class BonusReplayBuffer(HasSettings, OrderedReplayBuffer):
    """Keeps the rewards of the task, and gives `reward + weight * bonus` with the bonus of now.

    A bonus stored with its transition would be that of a module long since trained on. Any
    off-policy algorithm of Stable-Baselines3's API takes it:

        SAC("MlpPolicy", env, replay_buffer_class=BonusReplayBuffer,
            replay_buffer_kwargs={"bonus": "apt"})

    The bonus is trained on what is collected, and divided by the running standard deviation of its
    discounted sum (Burda et al. 2018), so that a `weight` means much the same whatever its scale.
    Until its first training it is 0; between two of them no transition is scored twice. Value
    targets stop at terminations only, unless `handle_timeout_termination` is off: the last step of
    a truncated episode goes on.

    Args:
        buffer_size: Transitions kept of all environments, the newest: one of each at least, and two
            with `optimize_memory_usage`.
        observation_space: Of a single environment: Box, MultiBinary, Discrete or MultiDiscrete from
            0, or a Dict of such, which `MultiInputPolicy` takes. Samples are SB3's own; the bonus
            sees images as they are, and others as vectors.
        action_space: Box with bounds, or Discrete.
        device: Where samples go, and the networks of a bonus that is named.
        n_envs: Environments side by side.
        optimize_memory_usage: As in SB3.
        handle_timeout_termination: As in SB3; None: unless `optimize_memory_usage`. Without it no
            end of an episode is known to be the task's, and the bonus observes none.
        bonus: "apt", "disagreement", "icm", "ramp", "rnd", or a `Bonus` made for the spaces, which
            this then trains.
        observation_key: The entry of a Dict that the bonus sees; None: all, as one vector.
        bonus_kwargs: Of a bonus that is named, as `BonusVecEnvWrapper` has them.
        weight: Of the bonus, at least 0.
        extrinsic: Whether the reward of the task counts; False: curiosity alone.
        gamma: Discount of the sum that the bonus is scaled by, from 0 to below 1; None: the bonus
            counts as it is.
        train_interval: Transitions of all environments between two trainings; None: it trains when
            `train_bonus` is called.
        n_updates: Gradient steps a training.
        batch_size: Transitions a gradient step of the bonus.
        seed: Of the networks and the draws; None: drawn from NumPy's generator, which SB3's
            algorithms seed with theirs.

    Attributes:
        metrics: Mean losses of the last training, and the bonus of what it was called for:
            `ExplorationCallback` logs them.

    Raises:
        ValueError: If an argument is out of its range, the spaces are of another kind, or the bonus
            asks what an episode has seen, as `E3B`, `NGU` and `NovelD` do: `BonusVecEnvWrapper`
            knows it.
    """

    _checks: ClassVar = {
        "weight": check_not_negative,
        "extrinsic": check_bool,
        "train_interval": check_interval,
        **dict.fromkeys(("n_updates", "batch_size"), check_at_least_one),
    }

    def __init__(
        self,
        buffer_size: int,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        device: th.device | str = "auto",
        n_envs: int = 1,
        optimize_memory_usage: bool = False,
        handle_timeout_termination: bool | None = None,
        *,
        bonus: str | Bonus = "apt",
        bonus_kwargs: dict[str, Any] | None = None,
        observation_key: str | None = None,
        weight: float = 1.0,
        extrinsic: bool = True,
        gamma: float | None = 0.99,
        train_interval: int | None = 2048,
        n_updates: int = 64,
        batch_size: int = 256,
        seed: int | np.random.SeedSequence | None = None,
    ) -> None:
        check_bonus_choice(bonus, {} if bonus_kwargs is None else bonus_kwargs)
        check_schedule(gamma, n_updates, batch_size)
        check_size(buffer_size, n_envs, optimize_memory_usage)
        check_sb3_takes(observation_space)
        self._view = View(observation_space, observation_key)
        if handle_timeout_termination is None:
            handle_timeout_termination = not optimize_memory_usage
        seed = seed_sequence(seed)
        (networks_seed,) = copy.deepcopy(seed).spawn(1)  # two buffers of one seed are the same
        bonus_kwargs = for_one_policy(bonus, bonus_kwargs or {})
        self._named = {"bonus": bonus, **bonus_kwargs} if isinstance(bonus, str) else {}
        self.bonus = make_bonus(
            bonus, bonus_kwargs, self._view.space, action_space, seed=networks_seed, device=device
        )
        check_needs_no_episodes(self.bonus, "a replay buffer")
        super().__init__(
            buffer_size,
            observation_space,
            action_space,
            device,
            n_envs,
            optimize_memory_usage,
            handle_timeout_termination,
            rng=np.random.default_rng(seed),
        )
        self.observation_key = observation_key
        self._shows_images = ImageInputs.of(self._view.space) is not None
        self.weight = weight
        self.extrinsic = extrinsic
        self.train_interval = train_interval
        self.n_updates = n_updates
        self.batch_size = batch_size
        self.metrics: dict[str, float] = {}
        self._scale = None if gamma is None else BonusScale(n_envs, gamma=gamma)
        self._n_untrained = 0  # steps of every environment
        self._n_trainings = 0
        shape = self.buffer_size, n_envs
        self.scores, self.scored_at = np.zeros(shape, np.float32), np.zeros(shape, np.int64)
        self._settled = SETTLED | ({"gamma"} if gamma is None else set())

    @property
    def gamma(self) -> float | None:
        """Discount of the sum that the bonus is scaled by, or None where it counts as it is."""
        return None if self._scale is None else self._scale.gamma

    @gamma.setter
    def gamma(self, gamma: float) -> None:
        assert self._scale is not None
        check_discount(gamma)
        self._scale.gamma = plain(gamma)

    @property
    def _made(self) -> dict[str, Any]:
        """What a file must have been made with to be taken."""
        made = {
            **self._named,
            "n_envs": self.n_envs,
            "optimize_memory_usage": self.optimize_memory_usage,
            "is_scaled": self._scale is not None,
            "observation_key": self.observation_key,
        }
        return {name: plain(value) for name, value in made.items()}

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
            ValueError: If an observation or a reward is not finite, or the environments are not as
                many as when this was made.
        """
        if len(reward) != self.n_envs:
            raise ValueError(
                f"`env` must have {self.n_envs} environments, as its replay buffer has, got "
                f"{len(reward)}."
            )
        for each in (obs, next_obs):
            for entry in each.values() if isinstance(each, dict) else [each]:
                check_observations(entry)
        check_rewards(reward)
        self.scored_at[[self.pos - 1, self.pos]] = 0  # where the newest leads may change, too
        super().add(obs, next_obs, action, reward, done, infos)
        self._n_untrained += 1
        if self.train_interval and self._n_untrained * self.n_envs >= self.train_interval:
            self.train_bonus()

    def train_bonus(self) -> None:
        """Train the bonus, and score what came since the last time; nothing where nothing came."""
        n, self._n_untrained = self._n_untrained, 0
        if not n:
            return
        with single_torch_thread():
            rows, envs = self._newest(n)
            for some in self._parts(len(rows)):
                self._show(rows[some], envs[some])
            draw = self.sample_transitions
            losses = train(self.bonus, draw, n_updates=self.n_updates, batch_size=self.batch_size)
            bonus = self._score(rows, envs)
        self._n_trainings += 1
        if self._scale is not None:
            steps = bonus.astype(np.float64).reshape(-1, self.n_envs)
            bonus = np.stack([self._scale.scaled(step, is_learning=True) for step in steps])
        mean, largest = self.weight * bonus.mean(), self.weight * bonus.max()
        self.metrics = {**losses, "intrinsic/mean": float(mean), "intrinsic/max": float(largest)}

    # -- what is learned from -------------------------------------------------------------------

    def sample(self, batch_size: int, env: VecNormalize | None = None) -> ReplayBufferSamples:
        """Transitions drawn uniformly with replacement; the bonus sees raw observations."""
        drawn = self._draw(batch_size)
        rows, envs = self._places(drawn)
        rewards = self.weight * self._bonus_of(drawn)
        if self.extrinsic:
            rewards = rewards + self._normalize_reward(self.rewards[rows, envs], env)
        is_dict = isinstance(self.observation_space, spaces.Dict)
        samples: Any = DictReplayBufferSamples if is_dict else ReplayBufferSamples
        return samples(  # type: ignore[no-any-return]
            self._sampled(self.observations[rows, envs], env),
            self.to_torch(self.actions[rows, envs]),
            self._sampled(self._next_observations(rows, envs), env),
            self.to_torch(self._terminated(rows, envs)[:, None].astype(np.float32)),
            self.to_torch(rewards.astype(np.float32)[:, None]),
        )

    def _sampled(self, held: Array, env: VecNormalize | None) -> th.Tensor | dict[str, th.Tensor]:
        """Observations as SB3's policies take them."""
        shown = self._normalize_obs(self._held.sampled(held), env)
        if isinstance(shown, dict):
            return {name: self.to_torch(entry) for name, entry in shown.items()}
        return self.to_torch(shown)

    @property
    def _n_scored(self) -> int:
        """Transitions whose bonus is computed in one call; of images a batch is more than these."""
        return 1 if self._shows_images else N_SCORED

    def _bonus_of(self, drawn: Int64Array) -> Array:
        """Bonus (n,) of transitions, scaled, before it is weighted."""
        if not self._n_trainings:
            return np.zeros(len(drawn), dtype=np.float32)
        self._score_unknown(drawn)
        bonus: Array = self.scores[self._places(drawn)]
        return bonus if self._scale is None else self._scale.scaled(bonus, is_learning=False)

    def _score_unknown(self, drawn: Int64Array) -> None:
        """Score those of the transitions that were not since the bonus was last trained.

        Others that may be drawn later fill a batch up.
        """
        unknown = self._unknown(np.unique(drawn))
        if not len(unknown):
            return
        n_whole = min(N_WHOLE, len(drawn))
        n = -(-len(unknown) // n_whole) * n_whole
        others = (drawn[0] + np.arange(N_SCORED)) % (self._n_held * self.n_envs)
        others = np.setdiff1d(self._unknown(others), unknown)
        places = self._places(np.resize(np.concatenate([unknown, others])[:n], n))
        with single_torch_thread():
            self.scores[places] = self._score(*places)
        self.scored_at[places] = self._n_trainings

    def _unknown(self, drawn: Int64Array) -> Int64Array:
        """Those of the transitions that were not scored since then."""
        unknown: Int64Array = drawn[self.scored_at[self._places(drawn)] != self._n_trainings]
        return unknown

    def _score(self, rows: Int64Array, envs: Int64Array) -> Array:
        """Bonus (n,) of the transitions of these places, as the module gives it."""
        scores = []
        for some in self._parts(len(rows)):
            before, actions, after = self._transitions(rows[some], envs[some])
            scores.append(self.bonus.score(before, actions, after))
            check_scores(scores[-1], before, after)
        return np.concatenate(scores)

    def _parts(self, n: int) -> list[slice]:
        """Parts of n transitions whose layers fit the cache, or the memory."""
        size = max(self._n_scored, self.batch_size)
        return [slice(begin, begin + size) for begin in range(0, n, size)]

    def sample_transitions(self, batch_size: int) -> tuple[th.Tensor, ...]:
        """Observations, actions and next observations, as a bonus is trained on them."""
        (rows, envs), horizon = self._places(self._draw(batch_size)), horizon_of(self.bonus)
        windows = (rows[:, None] + np.arange(horizon)) % self.buffer_size
        left = self._steps_left(windows, envs)
        steps = np.minimum(draw_steps(self._rng, rows.shape, horizon), left)
        ends = windows[np.arange(batch_size), steps - 1]
        before, actions, _ = self._transitions(rows, envs)
        after = self._seen(self._next_observations(ends, envs))
        actions = actions.reshape(batch_size, -1).astype(np.float32, copy=False)
        return th.from_numpy(before), th.from_numpy(actions), th.from_numpy(after)

    def _transitions(self, rows: Int64Array, envs: Int64Array) -> tuple[Array, ...]:
        """Observations, actions and next observations, as a bonus takes them."""
        return (
            self._seen(self.observations[rows, envs]),
            self._taken(self.actions[rows, envs]),
            self._seen(self._next_observations(rows, envs)),
        )

    def _show(self, rows: Int64Array, envs: Int64Array) -> None:
        before = self._seen(self.observations[rows, envs])
        # Without memory of limits of time no end is known to be the task's, or no end is held.
        terminated = self._terminated(rows, envs) & self.handle_timeout_termination
        ends = self._next_observations(rows[terminated], envs[terminated])
        show(self.bonus, before, self._seen(ends))

    def _terminated(self, rows: Int64Array, envs: Int64Array) -> Mask:
        """Where the task ended an episode, no limit of time."""
        terminated: Mask = (self.dones[rows, envs] > 0) & (self.timeouts[rows, envs] == 0)
        return terminated

    def _seen(self, held: Array) -> Array:
        """Observations as the bonus sees them."""
        seen = self._view(self._held.own(held))
        return seen if self._shows_images else seen.astype(np.float32, copy=False)

    def _taken(self, actions: Array) -> Array:
        """Actions as the environment takes them: (n, A) of a Box, (n,) of a Discrete."""
        if not isinstance(self.action_space, spaces.Box):
            return actions[:, 0]
        center, half_range = action_scale(self.action_space)
        return center + half_range * actions.astype(np.float32, copy=False)

    # -- save and load --------------------------------------------------------------------------

    @property
    def settings(self) -> dict[str, Any]:
        """What callbacks may change, as it is now."""
        return {name: getattr(self, name) for name in (*self._checks, "gamma")}

    def save(self, path: str | os.PathLike[str], *, transitions: bool = True) -> None:
        """Write transitions and bonus to a file that `restore` reads without running code.

        Args:
            path: Of the file.
            transitions: False: all but them.

        Raises:
            OSError: If it cannot be written; an older file is then as it was.
            ValueError: If the state of a bonus of your own holds what no file of torch may.
        """
        parts = {
            "made": self._made,
            "bonus": self.bonus.state_dict(),
            "scale": None if self._scale is None else self._scale.state_dict(),
            "settings": {name: getattr(self, name) for name in self._checks},
            "counters": {name: getattr(self, name) for name in COUNTERS},
        }
        write_buffer(path, self.state_dict(transitions=transitions) | parts)

    def restore(self, path: str | os.PathLike[str]) -> None:
        """Take over what `save` of a buffer with the same settings wrote.

        Those that a callback may have changed, as `weight`, are as they were when it was saved.

        Raises:
            FileNotFoundError: If there is no such file.
            ValueError: If it is damaged, or another's, or its bonus was made with other keywords;
                this buffer is then as it was.
        """
        saved = read_buffer(path, self._made)
        before = self.bonus.state_dict()
        own = {"next_observations": self.observations, **vars(self)}
        columns = {name: own[name] for name in (*self._columns, "next_observations")}
        try:
            check_buffer(saved, columns, {name: own[name] for name in COUNTERS})
            settings = {name: saved["settings"][name] for name in self._checks}
            for name in settings.keys() - self._made_with:
                self._checks[name](**{name: settings[name]})
            self.bonus.load_state_dict(saved["bonus"])
            if self._scale is not None:
                self._scale.load_state_dict(saved["scale"])
        except Exception as error:  # what a file holds can fail in any way
            self.bonus.load_state_dict(before)
            raise ValueError(
                f"`path` must be saved of a {type(self).__name__} with the same settings, {path} "
                "is not."
            ) from error
        self.load_state_dict(saved)
        vars(self).update(saved["counters"] | settings)
