"""A wrapper that adds an exploration bonus to the reward of any Stable-Baselines3 algorithm."""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import nullcontext
from functools import partial
from typing import Any, ClassVar, Self

import numpy as np
import torch as th
from gymnasium import spaces
from stable_baselines3.common.preprocessing import get_action_dim
from stable_baselines3.common.vec_env import (
    VecEnv,
    VecEnvWrapper,
    unwrap_vec_normalize,
    unwrap_vec_wrapper,
)
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvObs, VecEnvStepReturn

from curiosity_algos.bonuses.base import Bonus, check_rewards, check_scores, show, train
from curiosity_algos.bonuses.buffer import TransitionBuffer, usual_capacity
from curiosity_algos.bonuses.encoders import ImageInputs
from curiosity_algos.bonuses.episodes import episodes_of
from curiosity_algos.bonuses.make import check_bonus_choice, for_one_policy, make_bonus
from curiosity_algos.bonuses.spans import RecentSteps, horizon_of
from curiosity_algos.bonuses.views import View
from curiosity_algos.checkpoints.plain_files import fitting, plain
from curiosity_algos.common.arrays import Array, Float64Array, Mask
from curiosity_algos.common.networks import single_torch_thread, torch_device
from curiosity_algos.evaluation.batches import check_last_observations, terminations
from curiosity_algos.evaluation.environments import env_name
from curiosity_algos.evaluation.flat_spaces import FlatActions
from curiosity_algos.evaluation.rollouts import check_observations
from curiosity_algos.sb3.scale import BonusScale, check_discount
from curiosity_algos.sb3.wrapper_file import (
    SETTINGS,
    check_actions,
    check_counters,
    check_fits,
    read_wrapper,
    sound,
    write_wrapper,
)
from curiosity_algos.state.episodes import load_episode_states, record_episodes
from curiosity_algos.state.settings import HasSettings
from curiosity_gym.validation import (
    check_at_least_one,
    check_bool,
    check_not_negative,
    check_seed,
)


class BonusVecEnvWrapper(HasSettings, VecEnvWrapper):
    """Rewards transitions by how curious a bonus finds them, and trains the bonus.

    The reward becomes `extrinsic reward + weight * bonus`, before the algorithm sees it, so that it
    carries credit through time. The bonus is divided by the running standard deviation of its
    discounted sum (Burda et al. 2018), so that a `weight` means much the same whatever its scale.
    At the end of an episode it is that of the true last observation, never of the one after the
    reset. Before its first training the module knows no scale: until then the bonus is 0.

    The replay buffer of an off-policy algorithm keeps rewards as they were when collected; the
    bonus of an old transition is then that of long ago.

    Put a VecMonitor or Monitor below this wrapper, and it records the rewards of the task; put a
    VecNormalize above it.

    Args:
        venv: A VecEnv of any spaces that SB3's policies take; the bonus sees images as they are,
            and others as vectors.
        bonus: "apt", "disagreement", "e3b", "icm", "ngu", "noveld", "ramp", "rnd", or a `Bonus`
            made for the spaces of `venv`, which this then trains.
        bonus_kwargs: Of a bonus that is named, see that. Here the `learning_rate` of an ICM is
            1e-4, and APT's `power` is 3 and its `horizon` 10.
        observation_key: The entry of a Dict that the bonus sees; None: all, as one vector.
        weight: Of the bonus, at least 0.
        extrinsic: Whether the reward of the task counts; False: curiosity alone.
        gamma: Discount of the sum that the bonus is scaled by, from 0 to below 1.
        train_interval: Transitions of all environments between two trainings.
        n_updates: Gradient steps a training.
        batch_size: Transitions a gradient step.
        buffer_size: Transitions kept to train on, the newest; None: 100,000, of large observations
            as many as a GiB holds.
        seed: Of the networks and the draws; None: fresh entropy.
        device: Where the networks are, as in SB3.

    Attributes:
        metrics: Mean losses of the last training, which `ExplorationCallback` logs.
        is_new: Whether it was neither stepped nor loaded, and no callback has warned of that yet.
        training: Whether it learns; False, as in SB3's VecNormalize: it only adds the bonus.

    Each info has `reward_extrinsic`, the reward from below, and `reward_intrinsic`, `weight` times
    the bonus.

    Raises:
        ValueError: If an argument is out of its range, or the spaces are of another kind.
    """

    _checks: ClassVar = {
        "weight": check_not_negative,
        "extrinsic": check_bool,
        **dict.fromkeys(("train_interval", "n_updates", "batch_size"), check_at_least_one),
    }

    def __init__(
        self,
        venv: VecEnv,
        *,
        bonus: str | Bonus = "apt",
        bonus_kwargs: dict[str, Any] | None = None,
        observation_key: str | None = None,
        weight: float = 1.0,
        extrinsic: bool = True,
        gamma: float = 0.99,
        train_interval: int = 2048,
        n_updates: int = 64,
        batch_size: int = 256,
        buffer_size: int | None = None,
        seed: int | None = None,
        device: th.device | str = "auto",
    ) -> None:
        _check_venv(venv)
        check_bonus_choice(bonus, {} if bonus_kwargs is None else bonus_kwargs)
        check_discount(gamma)
        if buffer_size is not None:
            check_at_least_one(buffer_size=buffer_size)
        check_seed(seed)
        self._view = View(venv.observation_space, observation_key)
        self._acted = FlatActions(venv.action_space)
        if np.any(np.asarray(getattr(venv.action_space, "start", 0))):
            raise ValueError(
                f"`venv` must take actions from 0 on, got {venv.action_space}: Stable-Baselines3's "
                "algorithms give no others."
            )
        super().__init__(venv)
        record_episodes(venv)
        self.observation_key = observation_key
        self.weight = weight
        self.extrinsic = extrinsic
        self.train_interval = train_interval
        self.n_updates = n_updates
        self.batch_size = batch_size
        self.buffer_size = int(buffer_size or usual_capacity(self._view.space))
        self.bonus_kwargs = {name: plain(value) for name, value in (bonus_kwargs or {}).items()}
        self.training = True
        self.is_new = True
        self._name = bonus if isinstance(bonus, str) else None
        self._make_parts(bonus, np.random.SeedSequence(seed), device)
        self.metrics: dict[str, float] = {}
        self._observations: Array = np.empty(0, self._dtype)
        self._actions: Array = np.empty(0)
        self._scale = BonusScale(self.num_envs, gamma=float(gamma))
        self._n_untrained = 0
        self._has_trained = False
        self._must_reset = False
        self._settled = {"bonus", "bonus_kwargs", "buffer_size", "observation_key"}
        self._settled |= {"seed", "device"}

    @property
    def gamma(self) -> float:
        """Discount of the sum that the bonus is scaled by."""
        return self._scale.gamma

    @gamma.setter
    def gamma(self, gamma: float) -> None:
        check_discount(gamma)
        self._scale.gamma = plain(gamma)

    def __repr__(self) -> str:
        bonus = f"{self.weight:g} times {type(self.bonus).__name__}"
        return f"<{type(self).__name__}: {bonus} around {self.num_envs} of {env_name(self.venv)}>"

    def _make_parts(
        self, bonus: str | Bonus, seed: np.random.SeedSequence, device: th.device | str
    ) -> None:
        networks_seed, buffer_seed, steps_seed = seed.spawn(3)
        space, action_space = self._view.space, self._acted.space
        kwargs = for_one_policy(bonus, self.bonus_kwargs)
        self.bonus = make_bonus(
            bonus, kwargs, space, action_space, seed=networks_seed, device=device
        )
        self._episodes = episodes_of(self.bonus, self.num_envs)
        assert isinstance(space, spaces.Box)
        # As the networks take them: images stay bytes.
        self._dtype = np.dtype(np.float32 if ImageInputs.of(space) is None else np.uint8)
        n_stored = get_action_dim(action_space)
        self.buffer = TransitionBuffer(self.buffer_size, space, n_stored, seed=buffer_seed)
        self._recent = RecentSteps(
            self.num_envs,
            horizon_of(self.bonus),
            space.shape,
            self._dtype,
            n_stored,
            seed=steps_seed,
        )

    # -- stepping -------------------------------------------------------------------------------

    def reset(self) -> VecEnvObs:
        """Begin episodes in every environment."""
        self._must_reset = False
        observations = self.venv.reset()
        self._observations = self._stored(observations)
        self._scale.reset()
        every = np.ones(self.num_envs, dtype=np.bool_)
        self._recent.end(every)
        if self._episodes is not None:
            self._episodes.end(every)
        return observations

    def step_async(self, actions: Array) -> None:
        """Begin a step."""
        if self._must_reset:
            self.reset()
        self._actions = self._acted.seen(actions)
        self.venv.step_async(actions)

    def step_wait(self) -> VecEnvStepReturn:
        """End a step; the rewards are those that the algorithm is to learn from.

        Raises:
            ValueError: If observations or rewards are not finite, or an info is no dictionary.
        """
        observations, rewards, dones, infos = self.venv.step_wait()
        dones = np.asarray(dones, dtype=np.bool_)
        self.is_new = False
        check_rewards(rewards)
        _check_infos(infos, dones)
        infos = [dict(info) for info in infos]  # a VecEnv may give one for all
        before, after = self._observations, self._stored(observations)
        self._observations = after
        terminated = terminations(dones, infos)
        bonus = self._visit(before, self._last_observations(after, dones, infos), terminated)
        self._recent.end(dones | (not self.training))  # steps that are not learned from are gaps
        if self._episodes is not None:
            self._episodes.end(dones)
        intrinsic = self.weight * bonus
        for info, outer, inner in zip(infos, rewards, intrinsic, strict=True):
            info["reward_extrinsic"], info["reward_intrinsic"] = float(outer), float(inner)
        total = intrinsic + rewards if self.extrinsic else intrinsic
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
        """A copy, of what the bonus sees."""
        stored = np.array(self._view(observations), dtype=self._dtype)
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
            if self._has_trained or self._episodes is not None:
                scorer = self._episodes or self.bonus
                score = scorer.score(before, self._actions, after)
                check_scores(score, before, after)
            if self._has_trained:
                bonus = self._scale.scaled(score.astype(np.float64), is_learning=self.training)
            if self.training:
                self._learn(before, after, terminated)
        return bonus

    def _learn(self, before: Array, after: Array, terminated: Mask) -> None:
        self._recent.add(before, self._actions)
        observations, actions = map(th.from_numpy, self._recent.draw())
        show(self.bonus, before, after[terminated])
        self.buffer.add(observations, actions, th.from_numpy(after))
        self._n_untrained += len(before)
        if self._n_untrained >= self.train_interval:
            self._n_untrained = 0
            self._has_trained = True
            draw, n_updates = self.buffer.sample, self.n_updates
            self.metrics = train(self.bonus, draw, n_updates=n_updates, batch_size=self.batch_size)

    # -- save and load --------------------------------------------------------------------------

    def state_dict(self) -> dict[str, Any]:
        """Everything that a resumed run needs, but the environments below."""
        return {
            "bonus": self.bonus.state_dict(),
            "buffer": self.buffer.state_dict(),
            "scale": self._scale.state_dict(),
            "recent": self._recent.state_dict(),
            "episodes": None if self._episodes is None else self._episodes.state_dict(),
            "observations": th.from_numpy(self._observations.copy()),
            "n_untrained": self._n_untrained,
            "has_trained": self._has_trained,
            "metrics": dict(self.metrics),
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` of a wrapper with the same settings gave.

        Raises:
            ValueError: If it is another's.
        """
        before = self.state_dict()
        try:
            self._load_all_but_the_bonus(state)
            self._load_bonus(state["bonus"])
        except Exception:
            self._load_all_but_the_bonus(before)
            raise

    def _load_all_but_the_bonus(self, state: Mapping[str, Any]) -> None:
        check_counters(state)
        check_actions(state["buffer"]["actions"], self._acted.space)
        held = state["observations"]
        shape = (self.num_envs, *(self._view.space.shape or ())) if held.numel() else (0,)
        observations = fitting("observations", held, shape, self._dtype).copy()
        self._scale.load_state_dict(state["scale"])
        self.buffer.load_state_dict(state["buffer"])
        self._recent.load_state_dict(state["recent"])
        if self._episodes is not None:
            self._episodes.load_state_dict(state["episodes"])
        elif state["episodes"] is not None:
            raise ValueError("`episodes` must be None.")
        self._observations = observations
        self._n_untrained = state["n_untrained"]
        self._has_trained = state["has_trained"]
        self.is_new = False
        self.metrics = dict(state["metrics"])

    def _load_bonus(self, state: Mapping[str, Any]) -> None:
        before = self.bonus.state_dict()
        try:
            self.bonus.load_state_dict(state)
        except Exception as error:  # a bonus of one's own may raise any
            self.bonus.load_state_dict(before)
            raise ValueError("`bonus` must be made as the one that was saved.") from error

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write what `load` needs, beside the model's own file.

        Where episodes stand is part of it if the environments below can tell it in arrays, tensors
        and plain values, as those of `curiosity_gym` do. The file takes the place of an older one
        only once it is wholly on disk.

        Raises:
            OSError: If it cannot be written; an older file is then as it was.
            ValueError: If the state of a bonus of your own holds what no file of torch may.
        """
        settings = {name: getattr(self, name) for name in SETTINGS} | {"bonus": self._name}
        write_wrapper(path, venv=self.venv, settings=settings, state=self.state_dict())

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
        saved = read_wrapper(path)
        check_fits(saved, path, venv, bonus)
        settings = saved["settings"] | ({} if bonus is None else {"bonus": bonus})
        # What fails with a bonus of the user's own is not the file's fault.
        blamed = partial(sound, path) if bonus is None else nullcontext
        with blamed():
            wrapper = cls(venv, **settings, device=device)
        with sound(path):
            wrapper._load_all_but_the_bonus(saved["state"])
        with blamed():
            wrapper._load_bonus(saved["state"]["bonus"])
        with sound(path):
            is_resumed = load_episode_states(venv, saved["environments"])
        # Not yet, as a model's own reset would take another start then.
        wrapper._must_reset = not is_resumed
        return wrapper


class ICMVecEnvWrapper(BonusVecEnvWrapper):
    """A `BonusVecEnvWrapper`, with the same keywords, whose bonus is ICM unless it is named."""

    def __init__(self, venv: VecEnv, *, bonus: str | Bonus = "icm", **settings: Any) -> None:
        super().__init__(venv, bonus=bonus, **settings)


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


def _check_infos(infos: list[dict[str, Any]], dones: Array) -> None:
    # SB3's own VecEnvs fail of such an info themselves; one of the user's may pass it on.
    if not all(isinstance(info, dict) for info in infos):
        raise ValueError("`env` must give a dictionary as info with each step, it gave none.")
    check_last_observations(infos[i] for i in np.flatnonzero(dones))
