"""Episodes that begin along demonstrations, from near their ends to their starts."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv, VecEnvWrapper, VecMonitor
from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs, VecEnvStepReturn

from curiosity_algos.common.arrays import Array
from curiosity_algos.evaluation.found import is_success
from curiosity_algos.robust.demonstrations import Demonstration, Start
from curiosity_algos.sb3.gymnasium_vec_env import put
from curiosity_gym.episodic_vector_env import EpisodicVectorEnv
from curiosity_gym.validation import check_seed, check_share

N_RESULTS, N_SUCCESSES = 60, 21
"""A front moves back once so many of the last episodes from near it have succeeded."""
N_STRIDES = 40
"""Moves from the end of a demonstration to its start."""
BEHIND = 0.3
"""Share of starts along a demonstration that are anywhere between the front and its end."""
FRESH = -1
"""The step of a start that is along no demonstration."""
IS_FRESH = "is_fresh"
"""Of the last info of an episode, whether it began where the environment's own do."""


class DemonstrationStarts(VecEnvWrapper):
    """Begins episodes along demonstrations: near their ends first, further back as they succeed.

    The backward algorithm of Salimans & Chen 2018 (arXiv:1812.03381). Each demonstration has a
    front, a step of it. Starts are drawn up to a stride and a half before it, three in ten from
    anywhere behind it, and some are those of the environment itself. When 21 of the last 60
    episodes from near the front have succeeded it moves back, in 40 strides to the start; once
    21 of the last 60 from fresh starts have, it is there.

    Args:
        venv: A `GymnasiumVecEnv` of this package's own environments, or a DummyVecEnv of seeded
            ones, each in a `RecordEpisode`.
        demonstrations: At least one, of the same environment.
        fresh: Share of starts that are the environment's own; all are once the fronts are at 0.
        seed: Of the draws; None: fresh entropy.

    Attributes:
        fronts: (n,) of each demonstration how many of its steps are ahead of its front.
        near: Whether the last episodes from near the front succeeded, of each demonstration.
        fresh_results: Whether the last 60 episodes from fresh starts did.
        free_steps: Steps since all fronts have been at 0.
        good_steps: Those of them while half of the last fresh episodes had succeeded.
        idle_steps: Steps since a front last moved.

    The last info of an episode says `is_fresh`.

    Raises:
        ValueError: If there is no demonstration, or one does not come to the same here.
    """

    def __init__(
        self,
        venv: VecEnv,
        demonstrations: Sequence[Demonstration],
        *,
        fresh: float = 0.1,
        seed: int | None = None,
    ) -> None:
        check_share(fresh=fresh)
        check_seed(seed)
        if not demonstrations:
            raise ValueError("`demonstrations` must hold at least one episode.")
        super().__init__(venv)
        self.demonstrations = list(demonstrations)
        self.fresh = fresh
        self._places = _places(venv, self.demonstrations)
        self._rng = np.random.default_rng(seed)
        lengths = np.array([len(each) for each in demonstrations])
        self._strides = np.ceil(lengths / N_STRIDES).astype(np.int64)
        self.fronts = lengths - 1
        self.near = [deque[bool](maxlen=N_RESULTS) for _ in demonstrations]
        self.fresh_results = deque[bool](maxlen=N_RESULTS)
        self._begun = np.full((self.num_envs, 2), FRESH)
        self._totals = np.zeros(self.num_envs)
        self.free_steps, self.good_steps, self.idle_steps = 0, 0, 0

    @property
    def is_free(self) -> bool:
        """Whether every start is the environment's own by now."""
        return not self.fronts.any()

    def reset(self) -> VecEnvObs:
        """Begin all episodes."""
        observations = self.venv.reset()
        self._begin(range(self.num_envs), observations)
        return observations

    def step_wait(self) -> VecEnvStepReturn:
        """End a step; where an episode ends another begins, along a demonstration or fresh."""
        observations, rewards, dones, infos = self.venv.step_wait()
        self._totals += rewards
        self.idle_steps += self.num_envs
        if self.is_free:
            self.free_steps += self.num_envs
            self.good_steps += self.num_envs * (2 * sum(self.fresh_results) >= N_RESULTS)
        ended = np.flatnonzero(dones).tolist()
        for i in ended:
            self._note(i, is_success(infos[i], self._totals[i]))
            infos[i][IS_FRESH] = bool(self._begun[i, 1] == FRESH)
        self._move()
        self._begin(ended, observations)
        return observations, rewards, dones, infos

    def _note(self, i: int, success: bool) -> None:
        which, step = self._begun[i].tolist()
        if step == FRESH:
            self.fresh_results.append(success)
        elif abs(step - self.fronts[which]) <= 1.5 * self._strides[which]:
            self.near[which].append(success)

    def _move(self) -> None:
        if sum(self.fresh_results) >= N_SUCCESSES:
            self.fronts[:] = 0
        for which, results in enumerate(self.near):
            if sum(results) >= N_SUCCESSES:
                self.fronts[which] = max(0, self.fronts[which] - self._strides[which])
                results.clear()
                self.idle_steps = 0

    def _begin(self, ids: Sequence[int], observations: VecEnvObs) -> None:
        """Draw the starts of episodes, go there, and write what is observed there."""
        starts = {i: self._draw() for i in ids}
        for i, start in starts.items():
            self._begun[i], self._totals[i] = start, 0.0
        for i, observation in self._places.go(starts, self._rng).items():
            put(observations, i, observation)

    def _draw(self) -> tuple[int, int]:
        """A demonstration and a step of it, or `FRESH` both."""
        which = int(self._rng.integers(len(self.demonstrations)))
        front = int(self.fronts[which])
        if front == 0 or self._rng.random() < self.fresh:
            return FRESH, FRESH
        if self._rng.random() < BEHIND:
            return which, int(self._rng.integers(front, len(self.demonstrations[which])))
        before = int(self._rng.integers(1.5 * self._strides[which]))
        return which, max(0, front - before)

    def state_dict(self) -> dict[str, Any]:
        """Everything that a resumed run needs, but the environments below."""
        return {
            "fronts": self.fronts.copy(),
            "near": [list(results) for results in self.near],
            "fresh_results": list(self.fresh_results),
            "begun": self._begun.copy(),
            "totals": self._totals.copy(),
            "steps": [self.free_steps, self.good_steps, self.idle_steps],
            "rng": self._rng.bit_generator.state,
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave."""
        self.fronts[:], self._begun[:] = state["fronts"], state["begun"]
        for results, saved in zip(self.near, state["near"], strict=True):
            results.clear()
            results.extend(saved)
        self.fresh_results.clear()
        self.fresh_results.extend(state["fresh_results"])
        self._totals[:] = state["totals"]
        self.free_steps, self.good_steps, self.idle_steps = state["steps"]
        self._rng.bit_generator.state = state["rng"]


class FreshMonitor(VecMonitor):
    """Records the fresh episodes of `DemonstrationStarts`: of others the beginning is missing.

    Args:
        venv: The `DemonstrationStarts`.
        scale: What the learner's rewards are multiplied by; records are of the rewards themselves.
    """

    def __init__(self, venv: VecEnv, *, scale: float = 1.0) -> None:
        super().__init__(venv)
        self.scale = scale

    def step_wait(self) -> VecEnvStepReturn:
        """End a step; infos name returns and successes of fresh episodes alone."""
        observations, rewards, dones, infos = super().step_wait()
        for info in infos:
            if not info.get(IS_FRESH, True):
                info.pop("episode", None)
                info.pop("is_success", None)
        return observations, self.scale * rewards, dones, infos


# -- how to get there -----------------------------------------------------------------------------


def _places(venv: VecEnv, demonstrations: list[Demonstration]) -> _Restored | _Replayed:
    """What brings environments to steps of demonstrations, or fresh starts."""
    batch = getattr(venv, "vector_env", None)
    if isinstance(batch, EpisodicVectorEnv):
        return _Restored(batch, demonstrations)
    if isinstance(venv, DummyVecEnv) and venv.has_attr("replay"):
        return _Replayed(venv, demonstrations)
    raise ValueError(
        "`venv` must be a GymnasiumVecEnv of environments of curiosity_gym, or a DummyVecEnv of "
        "environments in a RecordEpisode: others cannot take up an episode."
    )


class _Restored:
    """By the states of a batch of simulations, which are restored in one call."""

    def __init__(self, batch: EpisodicVectorEnv, demonstrations: list[Demonstration]) -> None:
        self._batch = batch
        self._states = [self._follow(demonstration) for demonstration in demonstrations]

    def _follow(self, demonstration: Demonstration) -> list[dict[str, Array]]:
        """The state before each action: rows of what `state_dict` gives."""
        n = self._batch.num_envs
        self._reset(demonstration.start)
        states, total = [], 0.0
        for action in demonstration.actions:
            state = self._batch.state_dict()
            states.append({name: state[name][0] for name in ("steps", "observations", "physics")})
            _, rewards, *_ = self._batch.step(np.repeat(action[None], n, axis=0))
            total += float(rewards[0])
        _check(demonstration, total)
        return states

    def _reset(self, start: Start) -> None:
        if not isinstance(start, Mapping):
            self._batch.reset(seed=[start] * self._batch.num_envs)
            return
        self._batch.reset()
        state = self._batch.state_dict()
        state["generators"] = [start] * len(state["generators"])
        self._batch.load_state_dict(state)
        self._batch.reset()

    def go(self, starts: Mapping[int, tuple[int, int]], rng: np.random.Generator) -> dict[int, Any]:
        placed = {i: start for i, start in starts.items() if start[1] != FRESH}
        if not placed:
            return {}
        state = self._batch.state_dict()
        for i, (which, step) in placed.items():
            for name, value in self._states[which][step].items():
                state[name][i] = value
        self._batch.load_state_dict(state)
        return {i: state["observations"][i] for i in placed}


class _Replayed:
    """By seeded resets, and the demonstrations' actions taken again."""

    def __init__(self, venv: DummyVecEnv, demonstrations: list[Demonstration]) -> None:
        self._venv, self._demonstrations = venv, demonstrations
        for demonstration in demonstrations:
            _, total = self._replay(0, demonstration.start, demonstration.actions)
            _check(demonstration, total)

    def _replay(self, i: int, start: Start, actions: Any) -> tuple[Any, float]:
        found: tuple[Any, float] = self._venv.env_method("replay", start, actions, indices=i)[0]
        return found

    def go(self, starts: Mapping[int, tuple[int, int]], rng: np.random.Generator) -> dict[int, Any]:
        return {i: self._go_one(i, *start, rng) for i, start in starts.items()}

    def _go_one(self, i: int, which: int, step: int, rng: np.random.Generator) -> Any:
        if step == FRESH:
            return self._replay(i, int(rng.integers(2**31)), [])[0]
        demonstration = self._demonstrations[which]
        return self._replay(i, demonstration.start, demonstration.actions[:step])[0]


def _check(demonstration: Demonstration, total: float) -> None:
    if not np.isclose(total, demonstration.total, rtol=1e-6, atol=1e-9):
        raise ValueError(
            "`demonstrations` must come to the same in the environment: one of return "
            f"{demonstration.total:.6g} came to {total:.6g}. It draws from elsewhere than its "
            "`np_random`, or is another."
        )
