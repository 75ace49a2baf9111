"""A wrapper that adds an exploration bonus to the reward of any Stable-Baselines3 algorithm."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any, Self, Unpack

import numpy as np
import torch as th
from stable_baselines3.common.preprocessing import get_action_dim
from stable_baselines3.common.vec_env import (
    VecEnv,
    VecEnvWrapper,
    unwrap_vec_normalize,
    unwrap_vec_wrapper,
)
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvObs, VecEnvStepReturn

from curiosity_algos.bonuses.base import Bonus, check_rewards
from curiosity_algos.bonuses.buffer import TransitionBuffer
from curiosity_algos.bonuses.transitions import RecentSteps
from curiosity_algos.bonuses.views import View
from curiosity_algos.common.arrays import Array, Float64Array, Mask
from curiosity_algos.common.networks import single_torch_thread, torch_device
from curiosity_algos.curiosity.curiosity import (
    Curiosity,
    CuriosityKeywords,
    OfCuriosity,
    check_keywords_of,
)
from curiosity_algos.evaluation.batches import terminations
from curiosity_algos.evaluation.environments import env_name
from curiosity_algos.evaluation.flat_spaces import FlatActions
from curiosity_algos.evaluation.rollouts import check_observations
from curiosity_algos.sb3.found_episodes import FoundEpisodes
from curiosity_algos.state import file
from curiosity_algos.state.check import check_keys, check_like
from curiosity_algos.state.episodes import episode_states, load_episode_states, record_episodes
from curiosity_algos.state.settings import HasSettings
from curiosity_gym.validation import check_at_least_one, check_seed

KIND = "BonusVecEnvWrapper"
PARTS = ("curiosity", "buffer", "recent", "episodes", "observations", "found")


class BonusVecEnvWrapper(HasSettings, VecEnvWrapper):
    """Rewards transitions by how curious a bonus finds them, and trains the bonus.

    The reward becomes `extrinsic reward + weight * bonus`, over its scale, before the algorithm
    sees it, so that it carries credit through time. The bonus is divided by the running standard
    deviation of its discounted sum (Burda et al. 2018), so that a `weight` means much the same
    whatever its scale. At the end of an episode it is that of the true last observation, never of
    the one after the reset. Before its first training the module knows no scale: until then the
    bonus is 0. The sum is divided by the running standard deviation of its own discounted sum, as
    SB3's VecNormalize does (`norm_reward`).

    The replay buffer of an off-policy algorithm keeps rewards as they were when collected; the
    bonus of an old transition is then that of long ago.

    Put a VecMonitor or Monitor below this wrapper, and it records the rewards of the task; put a
    VecNormalize above it, for observations.

    Further keywords are those of `Curiosity`: `bonus`, `bonus_kwargs`, `weight`, `extrinsic`,
    `norm_reward`, `gamma`, `train_interval`, `n_updates` and `batch_size`.

    Args:
        venv: A VecEnv of any spaces that SB3's policies take; the bonus sees images as they are,
            and others as vectors.
        observation_key: The entry of a Dict that the bonus sees; None: all, as one vector.
        buffer_size: Transitions kept to train on, the newest; None: 100,000, of large observations
            as many as a GiB holds.
        seed: Of the networks and the draws; None: fresh entropy.
        device: Where the networks are, as in SB3.

    Attributes:
        metrics: Mean losses of the last training, which `ExplorationCallback` logs.
        found: Episodes that succeeded, see `robustify`.
        training: Whether it learns; False, as in SB3's VecNormalize: it only adds and scales.

    Each info has `reward_extrinsic`, the reward from below, and `reward_intrinsic`, `weight` times
    the bonus.

    Raises:
        ValueError: If an argument is out of its range, or the spaces are of another kind.
    """

    bonus, bonus_kwargs, metrics = OfCuriosity(), OfCuriosity(), OfCuriosity()
    weight, extrinsic, norm_reward = OfCuriosity(), OfCuriosity(), OfCuriosity()
    gamma = OfCuriosity()
    train_interval, n_updates, batch_size = OfCuriosity(), OfCuriosity(), OfCuriosity()

    def __init__(
        self,
        venv: VecEnv,
        *,
        observation_key: str | None = None,
        buffer_size: int | None = None,
        seed: int | None = None,
        device: th.device | str = "auto",
        **curiosity: Unpack[CuriosityKeywords],
    ) -> None:
        check_keywords_of(type(self), curiosity)
        _check_venv(venv)
        if buffer_size is not None:
            check_at_least_one(buffer_size=buffer_size)
        check_seed(seed)
        self._view = View(venv.observation_space, observation_key)
        self._acted = FlatActions(venv.action_space)
        networks_seed, buffer_seed, steps_seed = np.random.SeedSequence(seed).spawn(3)
        both_spaces = self._view.space, self._acted.space
        n_envs = venv.num_envs
        self.curiosity = Curiosity(
            *both_spaces, n_envs=n_envs, seed=networks_seed, device=device, **curiosity
        )
        super().__init__(venv)
        record_episodes(venv)
        self.found = FoundEpisodes(venv)
        self.observation_key = observation_key
        self.training = True
        self._make_memories(buffer_size, buffer_seed, steps_seed)
        self.buffer_size = int(self.buffer.capacity)
        self._must_reset = False
        self._settled = {"buffer_size", "observation_key", "seed", "device"}

    def __repr__(self) -> str:
        bonus = f"{self.weight:g} times {type(self.bonus).__name__}"
        return f"<{type(self).__name__}: {bonus} around {self.num_envs} of {env_name(self.venv)}>"

    def _make_memories(
        self,
        buffer_size: int | None,
        buffer_seed: np.random.SeedSequence,
        steps_seed: np.random.SeedSequence,
    ) -> None:
        space, n_actions = self._view.space, get_action_dim(self._acted.space)
        shape = tuple(space.shape or ())
        self.buffer = TransitionBuffer(buffer_size, space, n_actions, seed=buffer_seed)
        dtype = self.buffer.dtype
        self._observations: Array = np.empty((0, *shape), dtype)
        self._actions: Array = np.empty(0)
        self._episodes = self.bonus.episodes(self.num_envs)
        horizon = self.curiosity.horizon
        self._recent = RecentSteps(self.num_envs, horizon, shape, dtype, n_actions, seed=steps_seed)

    @property
    def settings(self) -> dict[str, Any]:
        """Keywords of the constructor as they are now, of the bonus its name, or None."""
        own = {"observation_key": self.observation_key, "buffer_size": self.buffer_size}
        return {**self.curiosity.made_with, **own, **self.curiosity.settings}

    # -- stepping -------------------------------------------------------------------------------

    def reset(self) -> VecEnvObs:
        self._must_reset = False
        observations = self.venv.reset()
        self._observations = self._stored(observations)
        self.curiosity.scale.reset()
        self.curiosity.total_scale.reset()
        self.found.end()
        every = np.ones(self.num_envs, dtype=np.bool_)
        self._recent.end(every)
        if self._episodes is not None:
            self._episodes.end(every)
        return observations

    def step_async(self, actions: Array) -> None:
        if self._must_reset:
            self.reset()
        self._actions = self._acted.seen(actions)
        self.venv.step_async(actions)

    def step_wait(self) -> VecEnvStepReturn:
        """End a step; the rewards are those that the algorithm is to learn from.

        Raises:
            ValueError: If observations or rewards are not finite.
        """
        observations, rewards, dones, infos = self.venv.step_wait()
        dones = np.asarray(dones, dtype=np.bool_)
        check_rewards(rewards)
        self.found.see(rewards, dones, infos)
        infos = [dict(info) for info in infos]  # a VecEnv may give one for all
        before, after = self._observations, self._stored(observations)
        self._observations = after
        terminated = terminations(dones, infos)
        bonus = self._visit(before, self._last_observations(after, dones, infos), terminated)
        self._recent.end(dones | (not self.training))  # steps that are not learned from are gaps
        if self._episodes is not None:
            self._episodes.end(dones)
        for info, outer, inner in zip(infos, rewards, self.weight * bonus, strict=True):
            info["reward_extrinsic"], info["reward_intrinsic"] = float(outer), float(inner)
        total = self.curiosity.total(rewards, bonus, ended=dones, is_learning=self.training)
        return observations, total.astype(np.float32), dones, infos

    def env_method(
        self, method_name: str, *method_args: Any, indices: VecEnvIndices = None, **kwargs: Any
    ) -> list[Any]:
        """Call a method of the environments, but not what would give rewards without the bonus."""
        if method_name == "compute_reward":
            raise ValueError(
                "`replay_buffer_class` must not be HerReplayBuffer, which asks the task for "
                "rewards anew, past the bonus."
            )
        return super().env_method(method_name, *method_args, indices=indices, **kwargs)

    def _stored(self, observations: VecEnvObs) -> Array:
        stored = np.array(self._view(observations), dtype=self._observations.dtype)
        check_observations(stored)
        return stored

    def _last_observations(
        self, observations: Array, dones: Array, infos: list[dict[str, Any]]
    ) -> Array:
        """The next observations: of an ended episode its last one, not the next's first."""
        if not dones.any():
            return observations
        led_to = observations.copy()
        for i in np.flatnonzero(dones):
            led_to[i] = self._view.one(infos[i]["terminal_observation"])
        check_observations(led_to)
        return led_to

    def _visit(self, before: Array, after: Array, terminated: Mask) -> Float64Array:
        """Score the transitions, then learn from them; the scaled bonus of each environment."""
        with single_torch_thread():
            bonus = np.zeros(len(before))
            # Who remembers episodes sees them from their beginning, whether it counts yet or not.
            if self.curiosity.n_trainings or self._episodes is not None:
                scores = self.curiosity.score(before, self._actions, after, self._episodes)
            if self.curiosity.n_trainings:
                scores = scores.astype(np.float64)
                bonus = self.curiosity.scaled(scores, is_learning=self.training)
            if self.training:
                self._learn(before, after, terminated)
        return bonus

    def _learn(self, before: Array, after: Array, terminated: Mask) -> None:
        self._recent.add(before, self._actions)
        observations, actions = map(th.from_numpy, self._recent.draw())
        self.curiosity.observe(before, after[terminated])
        self.buffer.add(observations, actions, th.from_numpy(after))
        if self.curiosity.is_due(len(before)):
            self.curiosity.train(self.buffer.sample)

    # -- save and load --------------------------------------------------------------------------

    def state_dict(self) -> dict[str, Any]:
        """Everything that a resumed run needs, but the environments below."""
        return {
            "curiosity": self.curiosity.state_dict(),
            "buffer": self.buffer.state_dict(),
            "recent": self._recent.state_dict(),
            "episodes": None if self._episodes is None else self._episodes.state_dict(),
            "observations": self._observations.copy(),
            "found": self.found.state_dict(),
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` of a wrapper with the same settings gave.

        Raises:
            ValueError: If it is another's; parts may have changed then.
        """
        check_keys(state, PARTS, "wrapper")
        check_like(state["observations"], self._observations[:0], "observations")
        self.buffer.load_state_dict(state["buffer"])
        self._recent.load_state_dict(state["recent"])
        if self._episodes is not None:
            self._episodes.load_state_dict(state["episodes"])
        self.curiosity.load_state_dict(state["curiosity"])
        self._observations = state["observations"].copy()
        self.found.load_state_dict(state["found"])

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write what `load` needs, beside the model's own file.

        Open episodes are part of it if the environments below are recorded, see
        `RecordEpisode`, or stepped by a vector environment of `curiosity_gym`.

        Raises:
            OSError: If it cannot be written; an older file is then as it was.
            ValueError: If the state of a bonus of your own holds more than arrays, tensors and
                plain values.
        """
        state = {"wrapper": self.state_dict(), "episodes": episode_states(self.venv)}
        file.save(path, KIND, self.settings, state)

    @classmethod
    def load(
        cls,
        path: str | os.PathLike[str],
        venv: VecEnv,
        *,
        bonus: Bonus | None = None,
        device: th.device | str = "auto",
    ) -> Self:
        """Wrap `venv` as the wrapper that was saved had wrapped another.

        Episodes go on where they were, if the file knows: give the model `force_reset=False` then,
        or it begins new ones. If the file does not know, the first step begins new ones.

        Args:
            path: Of the file.
            venv: As many environments with the same spaces.
            bonus: An object made as the one that was saved; None where that had a name.
            device: As in the constructor.

        Raises:
            FileNotFoundError: If there is no such file.
            ValueError: If it is damaged, foreign, or does not fit `venv` or `bonus`.
        """
        _check_venv(venv)
        device = torch_device(device)
        settings, state = file.read(path, KIND)
        name = settings.get("bonus")
        if (name is None) is (bonus is None):
            must = "be given, it was an object" if name is None else f"be None, it was {name!r:.60}"
            raise ValueError(f"`bonus` must {must} when the wrapper was saved.")
        try:
            wrapper = cls(venv, **settings | {"bonus": bonus or name}, device=device)
            wrapper.load_state_dict(state["wrapper"])
        except Exception as error:  # a damaged file fails in more ways than can be named
            raise ValueError(
                f"`path` must be saved of a wrapper around {venv.num_envs} environments of the "
                f"same spaces, {path} is not: {error} For others make a new {cls.__name__}."
            ) from error
        # Not yet, as a model's own reset would take another start then.
        wrapper._must_reset = not load_episode_states(venv, state["episodes"])
        return wrapper


def found_episodes(path: str | os.PathLike[str]) -> list[dict[str, Any]]:
    """The `found.episodes` of a wrapper that was saved.

    Raises:
        FileNotFoundError: If there is no such file.
        ValueError: If it is damaged, or another.
    """
    episodes: list[dict[str, Any]] = file.read(path, KIND)[1]["wrapper"]["found"]["episodes"]
    return episodes


class ICMVecEnvWrapper(BonusVecEnvWrapper):
    """A `BonusVecEnvWrapper`, with the same keywords, whose bonus is ICM unless it is named."""

    def __init__(self, venv: VecEnv, **settings: Any) -> None:
        super().__init__(venv, **{"bonus": "icm", **settings})


def _check_venv(venv: object) -> None:
    if not isinstance(venv, VecEnv):
        raise ValueError(
            "`venv` must be a VecEnv of Stable-Baselines3, as make_vec_env gives one, and "
            f"GymnasiumVecEnv of what gym.make_vec gives, got {venv!r}."
        )
    if unwrap_vec_normalize(venv) is not None:
        # There the replay buffers of off-policy algorithms look for rewards, past the bonus.
        raise ValueError("`venv` must hold no VecNormalize, which goes around this wrapper.")
    if unwrap_vec_wrapper(venv, BonusVecEnvWrapper) is not None:
        raise ValueError("`venv` must hold no other BonusVecEnvWrapper: a file keeps one bonus.")
    if np.any(np.asarray(getattr(venv.action_space, "start", 0))):
        raise ValueError(
            f"`venv` must take actions from 0 on, got {venv.action_space}: Stable-Baselines3's "
            "algorithms give no others."
        )
