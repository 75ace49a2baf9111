"""Episodes that begin along demonstrations, from near their ends to their starts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv, VecEnvWrapper, VecMonitor
from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs, VecEnvStepReturn

from curiosity_algos.common.arrays import Array, Float64Array, Int64Array
from curiosity_algos.evaluation.found import is_success
from curiosity_algos.evaluation.vector import most_steps
from curiosity_algos.robust.demonstrations import Demonstration, Start
from curiosity_algos.sb3.gymnasium_vec_env import put, take
from curiosity_gym.episodic_vector_env import EpisodicVectorEnv
from curiosity_gym.validation import check_seed, check_share

N_STRETCHES = 40
"""Of a demonstration at most, of the same number of steps each but the last."""
GOOD = 0.35
"""Share of episodes from a stretch that succeed, if the front may be there."""
PRIOR = 0.2
"""What is taken for that share before there are episodes; 0 of fresh ones."""
MEMORY = 20
"""Episodes that the share is an average of, the last ones most."""
AHEAD = 3
"""Stretches ahead of the front that half of the starts are drawn from, and the front itself."""
LEAST = 0.02
"""Of the weight of a stretch: one that always fails or succeeds is tried now and then."""
LATE, SLACK = 2, 100
"""Times the steps of the demonstration that are left, and more steps, which end an episode."""
FRESH = -1
"""The step of a start that is along no demonstration."""
IS_FRESH = "is_fresh"
"""Of the last info of an episode, whether it began where the environment's own do."""


class DemonstrationStarts(VecEnvWrapper):
    """Begins episodes along demonstrations: near their ends first, further back as they succeed.

    The backward algorithm of Salimans & Chen 2018 (arXiv:1812.03381), with starts where there is
    most to learn (Florensa et al. 2017, arXiv:1707.05300). A demonstration has up to 40
    stretches. Of each, and of fresh starts, the share of the last episodes from there that
    succeeded is known. The front is the first from which a third do, of fresh starts and the
    stretches. As large a share of starts as that of fresh episodes that succeed is fresh. Of the
    others half are from the front and the three stretches ahead of it; half from there, fresh, or
    from behind the front, mostly where episodes succeed as often as they fail. An episode along a
    demonstration is truncated after twice the steps that are left of it, and 100: then those that
    fail do not fill the rollouts.

    Args:
        venv: A `GymnasiumVecEnv` of this package's own environments, or a DummyVecEnv of seeded
            ones, each in a `RecordEpisode`.
        demonstrations: At least one, of the same environment.
        fresh: Share of starts that are the environment's own, at least.
        seed: Of the draws; None: fresh entropy.

    Attributes:
        rates: (n, 41) of fresh starts and of the stretches of each demonstration, the share of
            episodes from there that succeeded.
        last_reward: What the last steps of the demonstrations paid, on average.
        idle_steps: Steps since a front last moved further back, or all were at fresh starts.
        good_steps: What `robustify` counts: steps in which enough fresh episodes succeeded.

    The last info of an episode says `is_fresh`.

    Raises:
        ValueError: If there is no demonstration, or one does not come to the same here.
    """

    def __init__(
        self,
        venv: VecEnv,
        demonstrations: Sequence[Demonstration],
        *,
        fresh: float = 0.05,
        seed: int | None = None,
    ) -> None:
        check_share(fresh=fresh)
        check_seed(seed)
        if not demonstrations:
            raise ValueError("`demonstrations` must hold at least one episode.")
        for each in demonstrations:
            _check_actions(each, venv.action_space)
        super().__init__(venv)
        self.demonstrations = list(demonstrations)
        self.fresh = fresh
        self._places = _places(venv, self.demonstrations)
        self.last_reward = float(np.mean(self._places.last_rewards))
        self._rng = np.random.default_rng(seed)
        self._lengths = np.array([len(each) for each in demonstrations])
        self._strides = -(-self._lengths // N_STRETCHES)
        self._n_stretches = -(-self._lengths // self._strides)
        self.rates = np.full((len(demonstrations), 1 + N_STRETCHES), PRIOR)
        self.rates[:, 0] = 0.0
        self._furthest = self._front_columns()
        self._begun = np.full((self.num_envs, 2), FRESH)
        self._totals = np.zeros(self.num_envs)
        self._left = np.zeros(self.num_envs, dtype=np.int64)
        self._most = most_steps(venv)  # without a time limit one that fails might never end
        self.good_steps, self.idle_steps = 0, 0

    @property
    def fresh_rate(self) -> float:
        """The share of fresh episodes that succeeded."""
        return float(self.rates[0, 0])

    @property
    def fronts(self) -> Int64Array:
        """(n,) of each demonstration how many of its steps are ahead of its front."""
        steps: Int64Array = np.maximum(self._front_columns() - 1, 0) * self._strides
        return steps

    @property
    def near(self) -> Float64Array:
        """(n,) the share of episodes from each front that succeeded."""
        return np.take_along_axis(self.rates, self._front_columns()[:, None], axis=1)[:, 0]

    def _front_columns(self) -> Int64Array:
        """The column of each front in `rates`; the last stretch, if no other is good enough."""
        is_last = np.arange(1 + N_STRETCHES) == self._n_stretches[:, None]
        columns: Int64Array = ((self.rates >= GOOD) | is_last).argmax(axis=1)
        return columns

    def reset(self) -> VecEnvObs:
        """Begin all episodes."""
        observations = self.venv.reset()
        self._begin(range(self.num_envs), observations)
        return observations

    def step_wait(self) -> VecEnvStepReturn:
        """End a step; where an episode ends another begins, along a demonstration or fresh."""
        observations, rewards, dones, infos = self.venv.step_wait()
        self._totals += rewards
        self._left -= 1
        self.idle_steps += self.num_envs
        is_late = (self._left <= 0) & ~dones
        for i in np.flatnonzero(is_late).tolist():
            infos[i]["terminal_observation"] = take(observations, i)
            infos[i]["TimeLimit.truncated"] = True
        dones = dones | is_late
        ended = np.flatnonzero(dones).tolist()
        for i in ended:
            self._note(i, is_success(infos[i], 0.0 if is_late[i] else self._totals[i]))
            infos[i][IS_FRESH] = bool(self._begun[i, 1] == FRESH)
        self._move()
        if ended:
            self._begin(ended, observations)
        return observations, rewards, dones, infos

    def _note(self, i: int, success: bool) -> None:
        which, step = self._begun[i].tolist()
        if step == FRESH:
            rates = self.rates[:, :1]
        else:
            column = 1 + step // self._strides[which]
            rates = self.rates[which, column : column + 1]
        rates += (success - rates) / MEMORY

    def _move(self) -> None:
        fronts = self._front_columns()
        if (fronts < self._furthest).any() or not fronts.any():
            self.idle_steps = 0
        # A front that was there by luck is forgotten.
        self._furthest = np.minimum(fronts, np.maximum(self._furthest, fronts - AHEAD))

    def _begin(self, ids: Sequence[int], observations: VecEnvObs) -> None:
        """Draw the starts of episodes, go there, and write what is observed there."""
        starts = {i: self._draw() for i in ids}
        for i, (which, step) in starts.items():
            self._begun[i], self._totals[i] = (which, step), 0.0
            along = LATE * (self._lengths[which] - step) + SLACK
            self._left[i] = self._most if step == FRESH else along
        for i, observation in self._places.go(starts, self._rng).items():
            put(observations, i, observation)

    def _draw(self) -> tuple[int, int]:
        """A demonstration and a step of it, or `FRESH` both."""
        which = int(self._rng.integers(len(self.demonstrations)))
        column = int(self._rng.choice(1 + self._n_stretches[which], p=self._shares(which)))
        if column == 0:
            return FRESH, FRESH
        stride, length = int(self._strides[which]), int(self._lengths[which])
        first = (column - 1) * stride
        return which, int(self._rng.integers(first, min(first + stride, length)))

    def _shares(self, which: int) -> Float64Array:
        """(1 + stretches,) of starts: fresh ones, and from the stretches of a demonstration."""
        front = self._front_columns()[which]
        first = max(0, front - AHEAD)
        rates = self.rates[which, : 1 + self._n_stretches[which]]
        weights = rates * (1.0 - rates) + LEAST
        weights[1:first] = 0.0
        shares: Float64Array = weights / weights.sum()
        shares[first : front + 1] += 1.0 / (front + 1 - first)
        fresh = max(self.fresh, self.fresh_rate)
        shares *= (1.0 - fresh) / 2.0
        shares[0] += fresh
        return shares

    def state_dict(self) -> dict[str, Any]:
        """Everything that a resumed run needs, but the environments below."""
        return {
            "rates": self.rates.copy(),
            "furthest": self._furthest.copy(),
            "begun": self._begun.copy(),
            "totals": self._totals.copy(),
            "left": self._left.copy(),
            "steps": [self.good_steps, self.idle_steps],
            "rng": self._rng.bit_generator.state,
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave."""
        self.rates[:] = state["rates"]
        self._furthest[:], self._begun[:] = state["furthest"], state["begun"]
        self._totals[:], self._left[:] = state["totals"], state["left"]
        self.good_steps, self.idle_steps = state["steps"]
        self._rng.bit_generator.state = state["rng"]


class FreshMonitor(VecMonitor):
    """Rewards a learner by success, and records the fresh episodes of `DemonstrationStarts`.

    A task that rewards speed would have the learner trade successes for it. So the last step of a
    success pays at least what the last steps of the demonstrations did. A fresh episode that runs
    out of time without success counts as ended. Of episodes along a demonstration the beginning is
    missing: their infos name no return and no success.

    Args:
        venv: The `DemonstrationStarts`.
        last_reward: What the last steps of the demonstrations paid, on average.
        scale: What the learner's rewards are multiplied by; records are of the rewards themselves.
    """

    def __init__(self, venv: VecEnv, last_reward: float, *, scale: float = 1.0) -> None:
        super().__init__(venv)
        self.last_reward, self.scale = last_reward, scale

    def step_wait(self) -> VecEnvStepReturn:
        """End a step."""
        observations, rewards, dones, infos = super().step_wait()
        rewards = rewards.copy()
        for i in np.flatnonzero(dones).tolist():
            info, is_fresh = infos[i], infos[i].get(IS_FRESH, True)
            success = is_success(info, info["episode"]["r"])
            if success and not info.get("TimeLimit.truncated", False):
                rewards[i] = max(rewards[i], self.last_reward)
            elif is_fresh and not success:
                info["TimeLimit.truncated"] = False
            if not is_fresh:
                info.pop("episode")
                info.pop("is_success", None)
        return observations, self.scale * rewards, dones, infos


# -- how to get there -----------------------------------------------------------------------------


def _places(venv: VecEnv, demonstrations: list[Demonstration]) -> _Restored | _Replayed:
    """What brings environments to steps of demonstrations, or fresh starts, by `go`."""
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
        self.last_rewards: list[float] = []
        self._states = [self._follow(demonstration) for demonstration in demonstrations]

    def _follow(self, demonstration: Demonstration) -> list[dict[str, Array]]:
        """The state before each action: rows of what `state_dict` gives."""
        n = self._batch.num_envs
        self._reset(demonstration.start)
        states, total = [], 0.0
        for action in demonstration.actions:
            state = self._batch.state_dict()
            names = "steps", "observations", "physics"
            # Copied: a view would keep the whole batch.
            states.append({name: np.array(state[name][0]) for name in names})
            _, rewards, *_ = self._batch.step(np.repeat(action[None], n, axis=0))
            total += float(rewards[0])
        _check(demonstration, total)
        self.last_rewards.append(float(rewards[0]))
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
        along = {i: start for i, start in starts.items() if start[1] != FRESH}
        fresh = [i for i in starts if i not in along]
        seen: dict[int, Any] = {}
        if fresh:  # a late episode was still open
            mask = np.isin(np.arange(self._batch.num_envs), fresh)
            begun, _ = self._batch.reset(options={"reset_mask": mask})
            seen.update((i, begun[i]) for i in fresh)
        if along:
            state = self._batch.state_dict()
            for i, (which, step) in along.items():
                for name, value in self._states[which][step].items():
                    state[name][i] = value
            self._batch.load_state_dict(state)
            seen.update((i, state["observations"][i]) for i in along)
        return seen


class _Replayed:
    """By seeded resets, and the demonstrations' actions taken again."""

    def __init__(self, venv: DummyVecEnv, demonstrations: list[Demonstration]) -> None:
        self._venv, self._demonstrations = venv, demonstrations
        self.last_rewards = []
        for demonstration in demonstrations:
            *others, last = demonstration.actions
            _, before = self._replay(0, demonstration.start, others)
            _, reward, *_, info = self._venv.env_method("step", last, indices=0)[0]
            _check(demonstration, before + float(reward))
            if "is_success" not in info and reward <= 0.0:
                raise ValueError(
                    "`env` must end an episode where it pays for the success, or say `is_success` "
                    "in its infos: a demonstration goes on after its last reward, and what begins "
                    "there would count as failed."
                )
            self.last_rewards.append(float(reward))

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


def _check_actions(demonstration: Demonstration, space: spaces.Space[Any]) -> None:
    first = demonstration.actions[0]
    is_number = isinstance(space, spaces.Discrete)
    if not (space.contains(first) if is_number else first.shape == space.shape):
        raise ValueError(f"`demonstrations` must have actions of {space}, one has {first!r}.")


def _check(demonstration: Demonstration, total: float) -> None:
    if not np.isclose(total, demonstration.total, rtol=1e-6, atol=1e-9):
        raise ValueError(
            "`demonstrations` must come to the same in the environment: one of return "
            f"{demonstration.total:.6g} came to {total:.6g}. It draws from elsewhere than its "
            "`np_random`, or is another."
        )
