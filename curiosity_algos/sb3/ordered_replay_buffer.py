"""A replay buffer of Stable-Baselines3 that knows which transitions follow which."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium import spaces
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.preprocessing import get_obs_shape

from curiosity_algos.common.arrays import Array, Int64Array
from curiosity_algos.common.randomness import generator_state, load_generator_state
from curiosity_algos.sb3.held_observations import HeldObservations, as_tensors

COLUMNS = ("observations", "actions", "rewards", "dones", "timeouts", "scores", "scored_at")


class OrderedReplayBuffer(ReplayBuffer):
    """SB3's `ReplayBuffer`, which also knows what follows what, and takes Dict observations.

    A place is a row and an environment. Draws are those of a generator of its own. What
    `_columns` names is saved and loaded with the transitions.

    Args:
        buffer_size: As in SB3.
        observation_space: Of a single environment.
        *args: As in SB3, all up to `handle_timeout_termination`.
        rng: Of the draws.

    Raises:
        ValueError: If SB3's policies do not take the observations.
    """

    _columns: tuple[str, ...] = COLUMNS

    def __init__(
        self,
        buffer_size: int,
        observation_space: spaces.Space[Any],
        *args: Any,
        rng: np.random.Generator,
    ) -> None:
        self._held = held = HeldObservations(observation_space)
        super().__init__(buffer_size, held.array_space, *args)
        self.observation_space = observation_space
        self.obs_shape = get_obs_shape(observation_space)  # type: ignore[assignment]  # SB3's of a Dict
        self._rng = rng
        if held.array_space is not observation_space:
            self.observations = self.observations.view(held.dtype)[..., 0]
            if not self.optimize_memory_usage:
                self.next_observations = self.next_observations.view(held.dtype)[..., 0]

    def __repr__(self) -> str:
        size, most = (n * self.n_envs for n in (self.size(), self.buffer_size))
        return f"<{type(self).__name__}: {size:,} of {most:,} transitions>"

    # -- what is collected ----------------------------------------------------------------------

    def add(self, obs: Any, next_obs: Any, *args: Any, **kwargs: Any) -> None:
        """Add as SB3 does; an episode that this step does not go on with is truncated before."""
        obs, next_obs = (self._held.hold(each, self.n_envs) for each in (obs, next_obs))
        self._end_what_was_left(obs)
        super().add(obs, next_obs, *args, **kwargs)

    def _end_what_was_left(self, obs: Array) -> None:
        """Truncate episodes before that this step does not go on with: no span goes over a gap."""
        if not self.size():
            return
        newest = (self.pos - 1) % self.buffer_size
        before = self._next_observations(np.full(self.n_envs, newest), np.arange(self.n_envs))
        is_left = (before != obs).reshape(self.n_envs, -1).any(axis=1) & (self.dones[newest] == 0)
        self.dones[newest, is_left] = 1.0
        if not self.optimize_memory_usage:  # whose last observation is overwritten now
            self.timeouts[newest, is_left] = 1.0

    # -- places ---------------------------------------------------------------------------------

    @property
    def _n_held(self) -> int:
        """Steps of every environment whose next observation is held, too."""
        return self.size() - (self.optimize_memory_usage and self.full)

    def _draw(self, n: int) -> Int64Array:
        """Numbers of transitions that are held, drawn uniformly."""
        if not self._n_held:
            raise ValueError("`sample` must come after `add`: no transition is held yet.")
        return self._rng.integers(self._n_held * self.n_envs, size=n)

    def _places(self, drawn: Int64Array) -> tuple[Int64Array, Int64Array]:
        """Row and environment of each transition of such a number."""
        rows, envs = np.divmod(drawn, self.n_envs)
        if self._n_held < self.size():  # the newest next observation is in the oldest's place
            rows = (self.pos + 1 + rows) % self.buffer_size
        return rows, envs

    def _newest(self, n: int) -> tuple[Int64Array, Int64Array]:
        """Rows and environments of the last n steps of every environment, in their order."""
        n = min(n, self._n_held)
        rows = (self.pos - n + np.arange(n)) % self.buffer_size
        return np.repeat(rows, self.n_envs), np.tile(np.arange(self.n_envs), n)

    def _steps_left(self, windows: Int64Array, envs: Int64Array) -> Int64Array:
        """Steps (n,) of each window (n, H) until its episode ends, or the newest transition."""
        newest = (self.pos - 1) % self.buffer_size
        is_last = (self.dones[windows, envs[:, None]] > 0) | (windows == newest)
        is_last[:, -1] = True
        steps: Int64Array = is_last.argmax(axis=1) + 1
        return steps

    def _next_observations(self, rows: Int64Array, envs: Int64Array) -> Array:
        if not self.optimize_memory_usage:
            held: Array = self.next_observations[rows, envs]
            return held
        goes_on = self.dones[rows, envs] == 0  # where not, the next row begins another episode
        after: Array = self.observations[(rows + goes_on) % self.buffer_size, envs]
        return after

    # -- save and load --------------------------------------------------------------------------

    def state_dict(self, *, transitions: bool = True) -> dict[str, Any]:
        """The transitions, oldest first, or none, and the state of the draws."""
        n, pos, full = (self._n_held, self.pos, self.full) if transitions else (0, 0, False)
        rows = (pos - n + np.arange(n)) % self.buffer_size
        held = {name: getattr(self, name)[rows] for name in self._columns}
        every = np.broadcast_to(np.arange(self.n_envs), (len(rows), self.n_envs))
        held["next_observations"] = self._next_observations(rows[:, None], every)
        buffer = {name: as_tensors(column) for name, column in held.items()}
        return {
            "buffer": {**buffer, "pos": pos, "full": full},
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
        columns = {
            name: self._held.from_tensors(column)[n - kept :] for name, column in held.items()
        }
        after = columns.pop("next_observations")
        for name, column in columns.items():
            getattr(self, name)[rows] = column
        if not self.optimize_memory_usage:
            self.next_observations[rows] = after
        elif kept:
            self.observations[position] = after[-1]
