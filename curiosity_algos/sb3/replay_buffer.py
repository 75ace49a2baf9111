"""A replay buffer that adds an exploration bonus to the reward each time it samples."""

from __future__ import annotations

import copy
import os
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

from curiosity_algos.bonuses.base import Bonus, check_rewards, train
from curiosity_algos.bonuses.encoders import ImageInputs, action_scale
from curiosity_algos.bonuses.episodes import check_needs_no_episodes
from curiosity_algos.bonuses.make import check_bonus_choice, for_one_policy, make_bonus
from curiosity_algos.bonuses.spans import draw_steps, horizon_of
from curiosity_algos.checkpoints.plain_files import check_plain, plain, read_plain, write_plain
from curiosity_algos.common.networks import single_torch_thread
from curiosity_algos.common.randomness import generator_state, integer_seed, load_generator_state
from curiosity_algos.evaluation.rollouts import check_observations
from curiosity_algos.sb3.scale import BonusScale, check_discount
from curiosity_gym.validation import check_at_least_one, check_bool, check_positive, check_seed

N_SCORED = 2048
"""Vectors whose bonus is computed in one call, as each call costs as much as a batch itself."""
COLUMNS = ("observations", "actions", "rewards", "dones", "timeouts")
COUNTERS = ("metrics", "_n_untrained", "_has_trained")
"""What else a file holds, by the name of its attribute."""
FORMAT = "curiosity replay buffer 2"
Array = npt.NDArray[Any]
IntArray = npt.NDArray[np.int64]


class BonusReplayBuffer(ReplayBuffer):
    """Keeps the rewards of the task, and gives `reward + weight * bonus` with the bonus of now.

    A bonus stored with its transition would be that of a module long since trained on. Any
    off-policy algorithm of Stable-Baselines3's API takes it:

        SAC("MlpPolicy", env, replay_buffer_class=BonusReplayBuffer,
            replay_buffer_kwargs={"bonus": "apt"})

    The bonus is trained on what is collected, and divided by the running standard deviation of its
    discounted sum (Burda et al. 2018), so that a `weight` means much the same whatever its scale.
    Until its first training it is 0. Value targets stop at terminations only, unless
    `handle_timeout_termination` is off: the last step of a truncated episode goes on.

    Args:
        buffer_size: Transitions kept of all environments, the newest: one of each at least, and two
            with `optimize_memory_usage`.
        observation_space: Of a single environment: Box of one dimension, or of images.
        action_space: Box with bounds, or Discrete.
        device: Where samples go, and the networks of a bonus that is named.
        n_envs: Environments side by side.
        optimize_memory_usage: As in SB3.
        handle_timeout_termination: As in SB3; None: unless `optimize_memory_usage`.
        bonus: "apt", "disagreement", "icm", "ramp", "rnd", or a `Bonus` made for the spaces, which
            this then trains.
        bonus_kwargs: Of a bonus that is named, as `BonusVecEnvWrapper` has them.
        weight: Of the bonus, above 0.
        extrinsic: Whether the reward of the task counts; False: curiosity alone.
        gamma: Discount of the sum that the bonus is scaled by, from 0 to below 1; None: the bonus
            counts as it is.
        train_interval: Transitions of all environments between two trainings; None: another
            trains, `gamma` is None, and the bonus counts from the beginning.
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

    _ahead: Iterator[tuple[IntArray, Array]] = iter(())

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
        bonus: str | Bonus = "icm",
        bonus_kwargs: dict[str, Any] | None = None,
        weight: float = 1.0,
        extrinsic: bool = True,
        gamma: float | None = 0.99,
        train_interval: int | None = 2048,
        n_updates: int = 64,
        batch_size: int = 256,
        seed: int | np.random.SeedSequence | None = None,
    ) -> None:
        check_bonus_choice(bonus, {} if bonus_kwargs is None else bonus_kwargs)
        check_positive(weight=weight)
        check_bool(extrinsic=extrinsic)
        _check_schedule(gamma, train_interval, n_updates, batch_size)
        _check_size(buffer_size, n_envs, optimize_memory_usage)
        if handle_timeout_termination is None:
            handle_timeout_termination = not optimize_memory_usage
        seed = _sequence(seed)
        (networks_seed,) = copy.deepcopy(seed).spawn(1)  # two buffers of one seed are the same
        bonus_kwargs = for_one_policy(bonus, bonus_kwargs or {})
        named = {"bonus": bonus, **bonus_kwargs} if isinstance(bonus, str) else {}
        self._made = {name: plain(value) for name, value in named.items()}
        self.bonus = make_bonus(
            bonus,
            bonus_kwargs,
            observation_space,
            action_space,
            seed=integer_seed(networks_seed),
            device=device,
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
        )
        self.weight = float(weight)
        self.extrinsic = bool(extrinsic)
        self.train_interval = train_interval
        self.n_updates = n_updates
        self.batch_size = batch_size
        self.metrics: dict[str, float] = {}
        self._rng = np.random.default_rng(seed)
        self._scale = None if gamma is None else BonusScale(n_envs, gamma=gamma)
        self._n_untrained = 0  # steps of every environment
        self._has_trained = train_interval is None

    # -- what is collected ----------------------------------------------------------------------

    def add(
        self,
        obs: Array,
        next_obs: Array,
        action: Array,
        reward: Array,
        done: Array,
        infos: list[dict[str, Any]],
    ) -> None:
        """Add as SB3 does, but nothing that would train networks to NaN.

        Raises:
            ValueError: If an observation or a reward is not finite.
        """
        check_observations(obs)
        check_observations(next_obs)
        check_rewards(reward)
        self._end_what_was_left(obs)
        super().add(obs, next_obs, action, reward, done, infos)
        self._n_untrained += 1
        if self.train_interval and self._n_untrained * self.n_envs >= self.train_interval:
            self._train()

    def _end_what_was_left(self, obs: Array) -> None:
        """Truncate episodes before that this step does not go on with: no span goes over a gap."""
        if not self.size():
            return
        newest = (self.pos - 1) % self.buffer_size
        obs = np.asarray(obs, self.observations.dtype)  # as it is held
        before = self._next_observations(np.full(self.n_envs, newest), np.arange(self.n_envs))
        is_left = (before != obs).reshape(self.n_envs, -1).any(axis=1) & (self.dones[newest] == 0)
        self.dones[newest, is_left] = 1.0
        if not self.optimize_memory_usage:  # whose last observation is overwritten now
            self.timeouts[newest, is_left] = 1.0

    def _train(self) -> None:
        """Train the bonus with what came since the last time, and see what it says of that."""
        n, self._n_untrained = self._n_untrained, 0
        with single_torch_thread():
            rows, envs = self._newest(n)
            for some in self._parts(len(rows)):
                seen = self._seen(self.observations[rows[some], envs[some]])
                self.bonus.observe(th.from_numpy(seen))
            draw = self.sample_transitions
            losses = train(self.bonus, draw, n_updates=self.n_updates, batch_size=self.batch_size)
            bonus = self._score(rows, envs)
        self._has_trained = True
        if self._scale is not None:
            steps = bonus.astype(np.float64).reshape(-1, self.n_envs)
            bonus = np.stack([self._scale.scaled(step, is_learning=True) for step in steps])
        mean, largest = self.weight * bonus.mean(), self.weight * bonus.max()
        self.metrics = {**losses, "intrinsic/mean": float(mean), "intrinsic/max": float(largest)}

    # -- what is learned from -------------------------------------------------------------------

    def sample(self, batch_size: int, env: VecNormalize | None = None) -> ReplayBufferSamples:
        """Transitions drawn uniformly with replacement; the bonus sees raw observations."""
        drawn, bonus = next(self._ahead, None) or next(self._drawn(1, batch_size))
        rows, envs = self._places(drawn)
        rewards = self.weight * bonus
        if self.extrinsic:
            rewards = rewards + self._normalize_reward(self.rewards[rows, envs], env)
        ended = self.dones[rows, envs] * (1.0 - self.timeouts[rows, envs])
        values: tuple[Any, ...] = (
            self._normalize_obs(self.observations[rows, envs], env),
            self.actions[rows, envs],
            self._normalize_obs(self._next_observations(rows, envs), env),
            ended[:, None],
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

    def _drawn(self, n_batches: int, batch_size: int) -> Iterator[tuple[IntArray, Array]]:
        """Transitions (n,) of each batch and their bonus (n,), computed when it is needed."""
        n_together = max(1, self._n_scored // batch_size)
        for begin in range(0, n_batches, n_together):
            n = min(n_together, n_batches - begin)
            drawn = self._draw(n * batch_size)
            bonus = self._bonus_of(drawn)
            yield from zip(drawn.reshape(n, -1), bonus.reshape(n, -1), strict=True)

    @property
    def _n_scored(self) -> int:
        """Transitions whose bonus is computed in one call; of images a batch is more than these."""
        return 1 if len(self.observation_space.shape or ()) > 1 else N_SCORED

    def _bonus_of(self, drawn: IntArray) -> Array:
        """Bonus (n,) of transitions, scaled, before it is weighted."""
        if not self._has_trained:
            return np.zeros(len(drawn), dtype=np.float32)
        with single_torch_thread():
            bonus = self._score(*self._places(drawn))
        return bonus if self._scale is None else self._scale.scaled(bonus, is_learning=False)

    def _score(self, rows: IntArray, envs: IntArray) -> Array:
        """Bonus (n,) of the transitions of these places, as the module gives it."""
        parts = self._parts(len(rows))
        scores = [self.bonus.score(*self._transitions(rows[i], envs[i])) for i in parts]
        bonus = np.concatenate(scores)
        if not np.isfinite(bonus).all():
            raise ValueError("`bonus` must give finite scores, it gave others.")
        return bonus

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

    def _steps_left(self, windows: IntArray, envs: IntArray) -> IntArray:
        """Steps (n,) of each window (n, H) until its episode ends, or the newest transition."""
        newest = (self.pos - 1) % self.buffer_size
        is_last = (self.dones[windows, envs[:, None]] > 0) | (windows == newest)
        is_last[:, -1] = True
        steps: IntArray = is_last.argmax(axis=1) + 1
        return steps

    def newest(self, n: int) -> tuple[Array, ...]:
        """The last n steps of every environment, (n * n_envs, ...); fewer where fewer are held.

        In the order of their steps, and in each of their environments.
        """
        return self._transitions(*self._newest(n))

    def _newest(self, n: int) -> tuple[IntArray, IntArray]:
        """Rows and environments of these."""
        n = min(n, self._n_held)
        rows = (self.pos - n + np.arange(n)) % self.buffer_size
        return np.repeat(rows, self.n_envs), np.tile(np.arange(self.n_envs), n)

    # -- places ---------------------------------------------------------------------------------

    @property
    def _n_held(self) -> int:
        """Steps of every environment whose next observation is held, too."""
        return self.size() - (self.optimize_memory_usage and self.full)

    def _draw(self, n: int) -> IntArray:
        """Numbers of transitions that are held, drawn uniformly."""
        if not self._n_held:
            raise ValueError("`sample` must come after `add`: no transition is held yet.")
        return self._rng.integers(self._n_held * self.n_envs, size=n)

    def _places(self, drawn: IntArray) -> tuple[IntArray, IntArray]:
        """Row and environment of each transition of such a number."""
        rows, envs = np.divmod(drawn, self.n_envs)
        if self._n_held < self.size():  # the newest next observation is in the oldest's place
            rows = (self.pos + 1 + rows) % self.buffer_size
        return rows, envs

    def _transitions(self, rows: IntArray, envs: IntArray) -> tuple[Array, ...]:
        """Observations, actions and next observations, as a bonus takes them."""
        return (
            self._seen(self.observations[rows, envs]),
            self._taken(self.actions[rows, envs]),
            self._seen(self._next_observations(rows, envs)),
        )

    def _next_observations(self, rows: IntArray, envs: IntArray) -> Array:
        if not self.optimize_memory_usage:
            held: Array = self.next_observations[rows, envs]
            return held
        goes_on = self.dones[rows, envs] == 0  # where not, the next row begins another episode
        after: Array = self.observations[(rows + goes_on) % self.buffer_size, envs]
        return after

    def _seen(self, observations: Array) -> Array:
        is_image = ImageInputs.of(self.observation_space) is not None
        return observations if is_image else observations.astype(np.float32, copy=False)

    def _taken(self, actions: Array) -> Array:
        """Actions as the environment takes them: (n, A) of a Box, (n,) of a Discrete."""
        if not isinstance(self.action_space, spaces.Box):
            return actions[:, 0]
        center, half_range = action_scale(self.action_space)
        taken: Array = center + half_range * actions
        return taken

    # -- save and load --------------------------------------------------------------------------

    def state_dict(self) -> dict[str, Any]:
        """Transitions held, oldest first, the bonus with its scale, and the state of the draws."""
        rows = (self.pos - self._n_held + np.arange(self._n_held)) % self.buffer_size
        held = {name: getattr(self, name)[rows] for name in COLUMNS}
        every = np.broadcast_to(np.arange(self.n_envs), (len(rows), self.n_envs))
        held["next_observations"] = self._next_observations(rows[:, None], every)
        buffer = {name: th.from_numpy(column) for name, column in held.items()}
        return {
            "buffer": {**buffer, "pos": self.pos, "full": self.full},
            "rng": generator_state(self._rng),
        }

    def load_state_dict(self, state: Mapping[str, Any], strict: bool = True) -> None:
        """Take over what `state_dict` gave; transitions left out of the file are none."""
        load_generator_state(self._rng, state["rng"])
        if "buffer" not in state:
            return
        held = {**state["buffer"]}
        position, full = held.pop("pos"), held.pop("full")
        n, most = len(held["actions"]), self.buffer_size - self.optimize_memory_usage
        kept = min(n, most)
        if not (n == most if full else n == position < self.buffer_size):  # of another capacity
            position, full = kept % self.buffer_size, kept == most
        self.pos, self.full = position, full
        rows = (position - kept + np.arange(kept)) % self.buffer_size
        columns = {name: column.cpu().numpy()[n - kept :] for name, column in held.items()}
        after = columns.pop("next_observations")
        for name, column in columns.items():
            getattr(self, name)[rows] = column
        if not self.optimize_memory_usage:
            self.next_observations[rows] = after
        elif kept:
            self.observations[position] = after[-1]

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write transitions and bonus to a file that `restore` reads without running code.

        Raises:
            OSError: If it cannot be written; an older file is then as it was.
            ValueError: If the state of a bonus of your own holds what no file of torch may.
        """
        state = self.bonus.state_dict()
        check_plain(state, "bonus")
        scale = None if self._scale is None else self._scale.state_dict()
        counters = {name: getattr(self, name) for name in COUNTERS}
        parts = {"made": self._made, "bonus": state, "scale": scale, "counters": counters}
        write_plain(path, {**self.state_dict(), **parts}, FORMAT)

    def restore(self, path: str | os.PathLike[str]) -> None:
        """Take over what `save` of a buffer with the same settings wrote.

        Raises:
            FileNotFoundError: If there is no such file.
            ValueError: If it is damaged, or another's, or its bonus was made with other keywords;
                this buffer is then as it was.
        """
        saved = read_plain(path, FORMAT, what=type(self).__name__)
        if saved.get("made") != self._made:
            raise ValueError(
                f"`path` must be saved of a buffer with the bonus {self._made}, {path} has "
                f"{saved.get('made')}."
            )
        before = self.bonus.state_dict()
        try:
            self._check(saved)
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
        vars(self).update(saved["counters"])

    def _check(self, saved: Mapping[str, Any]) -> None:
        """Raise ValueError unless transitions and counters are such as this buffer has."""
        n = len(saved["buffer"]["actions"])
        for name in (*COLUMNS, "next_observations"):
            column = saved["buffer"][name].numpy()
            own = getattr(self, name, self.observations)
            is_alike = column.dtype == own.dtype and column.shape == (n, *own.shape[1:])
            if not is_alike or not np.isfinite(column).all():
                raise ValueError(f"`{name}` must be {n} rows of {own.shape[1:]}, finite.")
        load_generator_state(np.random.default_rng(0), saved["rng"])
        types = {name: type(getattr(self, name)) for name in COUNTERS}
        if {name: type(value) for name, value in saved["counters"].items()} != types:
            raise ValueError(f"`counters` must be {types}.")


def _check_schedule(
    gamma: float | None, train_interval: int | None, n_updates: int, batch_size: int
) -> None:
    if gamma is not None:
        check_discount(gamma)
    if train_interval is not None:
        check_at_least_one(train_interval=train_interval)
    elif gamma is not None:
        raise ValueError("`gamma` must be None where `train_interval` is: nothing is scaled.")
    check_at_least_one(n_updates=n_updates, batch_size=batch_size)


def _check_size(buffer_size: int, n_envs: int, optimize_memory_usage: bool) -> None:
    check_at_least_one(buffer_size=buffer_size, n_envs=n_envs)
    if optimize_memory_usage and buffer_size < 2 * n_envs:
        raise ValueError(
            f"`buffer_size` must be at least {2 * n_envs} with `optimize_memory_usage`, two of "
            f"each environment, got {buffer_size}."
        )


def _sequence(seed: int | np.random.SeedSequence | None) -> np.random.SeedSequence:
    if isinstance(seed, np.random.SeedSequence):
        return seed
    check_seed(seed)
    # The global generator is what SB3's algorithms seed.
    return np.random.SeedSequence(np.random.randint(2**31) if seed is None else seed)  # noqa: NPY002
