"""A wrapper that adds an exploration bonus to the reward of any Stable-Baselines3 algorithm."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, nullcontext
from typing import Any, Self

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
from curiosity_algos.bonuses.buffer import TransitionBuffer, usual_capacity
from curiosity_algos.bonuses.encoders import ImageInputs
from curiosity_algos.bonuses.episodes import episodes_of
from curiosity_algos.bonuses.make import check_bonus_choice, for_one_policy
from curiosity_algos.bonuses.spans import RecentSteps
from curiosity_algos.bonuses.views import View
from curiosity_algos.common.arrays import Array, Float64Array, Mask
from curiosity_algos.common.networks import single_torch_thread, torch_device
from curiosity_algos.curiosity.curiosity import Curiosity, OfCuriosity
from curiosity_algos.evaluation.batches import check_last_observations, terminations
from curiosity_algos.evaluation.environments import env_name
from curiosity_algos.evaluation.flat_spaces import FlatActions
from curiosity_algos.evaluation.rollouts import check_observations
from curiosity_algos.state import file
from curiosity_algos.state.check import check_keys, check_like
from curiosity_algos.state.episodes import episode_states, load_episode_states, record_episodes
from curiosity_algos.state.settings import HasSettings, python_number
from curiosity_algos.state.spaces import decode_space, encode_space
from curiosity_gym.validation import check_at_least_one, check_seed

KIND = "BonusVecEnvWrapper"
OWN = ("bonus_kwargs", "observation_key", "buffer_size")
"""Settings that the curiosity does not keep."""


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

    bonus, metrics, gamma = OfCuriosity(), OfCuriosity(), OfCuriosity()
    weight, extrinsic, train_interval = OfCuriosity(), OfCuriosity(), OfCuriosity()
    n_updates, batch_size = OfCuriosity(), OfCuriosity()

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
        self.buffer_size = int(buffer_size or usual_capacity(self._view.space))
        self.bonus_kwargs = {
            name: python_number(value) for name, value in (bonus_kwargs or {}).items()
        }
        self.training = True
        self.is_new = True
        self._name = bonus if isinstance(bonus, str) else None
        networks_seed, buffer_seed, steps_seed = np.random.SeedSequence(seed).spawn(3)
        self.curiosity = Curiosity(
            self._view.space,
            self._acted.space,
            bonus=bonus,
            bonus_kwargs=for_one_policy(bonus, self.bonus_kwargs),
            weight=weight,
            extrinsic=extrinsic,
            gamma=gamma,
            train_interval=train_interval,
            n_updates=n_updates,
            batch_size=batch_size,
            n_envs=self.num_envs,
            seed=networks_seed,
            device=device,
        )
        self._make_memories(buffer_seed, steps_seed)
        self._must_reset = False
        self._settled = {"bonus_kwargs", "buffer_size", "observation_key", "seed", "device"}

    def __repr__(self) -> str:
        bonus = f"{self.weight:g} times {type(self.bonus).__name__}"
        return f"<{type(self).__name__}: {bonus} around {self.num_envs} of {env_name(self.venv)}>"

    def _make_memories(
        self, buffer_seed: np.random.SeedSequence, steps_seed: np.random.SeedSequence
    ) -> None:
        space, n_actions = self._view.space, get_action_dim(self._acted.space)
        shape = tuple(space.shape or ())
        # As the networks take them: images stay bytes.
        dtype = np.dtype(np.float32 if ImageInputs.of(space) is None else np.uint8)
        self._observations: Array = np.empty((0, *shape), dtype)
        self._actions: Array = np.empty(0)
        self._episodes = episodes_of(self.bonus, self.num_envs)
        self.buffer = TransitionBuffer(self.buffer_size, space, n_actions, seed=buffer_seed)
        horizon = self.curiosity.horizon
        self._recent = RecentSteps(self.num_envs, horizon, shape, dtype, n_actions, seed=steps_seed)

    @property
    def settings(self) -> dict[str, Any]:
        """Keywords of the constructor as they are now, of the bonus its name, or None."""
        kept = {name: getattr(self, name) for name in OWN}
        return {"bonus": self._name, **kept, **self.curiosity.settings}

    # -- stepping -------------------------------------------------------------------------------

    def reset(self) -> VecEnvObs:
        """Begin episodes in every environment."""
        self._must_reset = False
        observations = self.venv.reset()
        self._observations = self._stored(observations)
        assert self.curiosity.scale is not None
        self.curiosity.scale.reset()
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
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` of a wrapper with the same settings gave.

        Raises:
            ValueError: If it is another's; nothing has changed then.
        """
        before = self.state_dict()
        try:
            self._load(state)
        except Exception:
            self._load(before)
            raise

    def _load(self, state: Mapping[str, Any]) -> None:
        parts = ("curiosity", "buffer", "recent", "episodes", "observations")
        check_keys(state, parts, "wrapper")
        check_like(state["observations"], self._observations[:0], "observations")
        if len(state["observations"]) not in (0, self.num_envs):
            raise ValueError(f"`observations` must be of {self.num_envs} environments, or none.")
        self.buffer.load_state_dict(state["buffer"])
        self._recent.load_state_dict(state["recent"])
        if self._episodes is not None:
            self._episodes.load_state_dict(state["episodes"])
        self.curiosity.load_state_dict(state["curiosity"])
        self._observations = state["observations"].copy()
        self.is_new = False

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write what `load` needs, beside the model's own file.

        Where episodes stand is part of it if the environments below can tell it in arrays, tensors
        and plain values, as those of `curiosity_gym` do. The file takes the place of an older one
        only once it is wholly on disk.

        Raises:
            OSError: If it cannot be written; an older file is then as it was.
            ValueError: If the state of a bonus of your own holds more than arrays, tensors and
                plain values.
        """
        made_for = {"n_envs": self.num_envs, "spaces": _encoded_spaces(self.venv)}
        state = {"wrapper": self.state_dict(), "episodes": episode_states(self.venv)}
        file.save(path, KIND, {"made_for": made_for, "keywords": self.settings}, state)

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
        with _content_of(path):
            settings = _checked(settings, state)
        _check_made_for(settings["made_for"], venv)
        keywords = _with_bonus(settings["keywords"], bonus)
        # An object of the user's may raise errors of its own.
        with _content_of(path) if bonus is None else nullcontext():
            wrapper = cls(venv, **keywords, device=device)
            wrapper.load_state_dict(state["wrapper"])
        # Not yet, as a model's own reset would take another start then.
        wrapper._must_reset = not load_episode_states(venv, state["episodes"])
        return wrapper


class ICMVecEnvWrapper(BonusVecEnvWrapper):
    """A `BonusVecEnvWrapper`, with the same keywords, whose bonus is ICM unless it is named."""

    def __init__(self, venv: VecEnv, *, bonus: str | Bonus = "icm", **settings: Any) -> None:
        super().__init__(venv, bonus=bonus, **settings)


def _encoded_spaces(venv: VecEnv) -> list[Any]:
    return [encode_space(space) for space in (venv.observation_space, venv.action_space)]


@contextmanager
def _content_of(path: str | os.PathLike[str]) -> Iterator[None]:
    """Say which file is to blame for an error that its content leads to."""
    try:
        yield
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        why = f": {error}" if isinstance(error, ValueError) else "."
        raise ValueError(f"`path` must be a saved {KIND}, {path} is damaged{why}") from error


def _checked(settings: Mapping[str, Any], state: Mapping[str, Any]) -> dict[str, Any]:
    """The settings of a file, the spaces decoded."""
    check_keys(settings, ("made_for", "keywords"), "settings")
    check_keys(settings["made_for"], ("n_envs", "spaces"), "made_for")
    check_keys(settings["keywords"], ("bonus", *OWN, *Curiosity.SETTINGS), "keywords")
    check_keys(state, ("wrapper", "episodes"))
    if state["episodes"] is not None:
        check_keys(state["episodes"], ("episodes", "counts"), "episodes")
    made_for = settings["made_for"]
    spaces = [decode_space(space) for space in made_for["spaces"]]
    return {**settings, "made_for": {**made_for, "spaces": spaces}}


def _check_made_for(made_for: Mapping[str, Any], venv: VecEnv) -> None:
    """Raise ValueError unless a wrapper that was saved can have this `venv`."""
    spaces_here = [decode_space(space) for space in _encoded_spaces(venv)]
    if made_for["n_envs"] != venv.num_envs or made_for["spaces"] != spaces_here:
        raise ValueError(
            f"`venv` must have {made_for['n_envs']} environments with the spaces that were saved, "
            f"got {venv.num_envs} with {venv.observation_space} and {venv.action_space}. For "
            f"others make a new {KIND}, which has seen nothing yet."
        )


def _with_bonus(keywords: dict[str, Any], bonus: Bonus | None) -> dict[str, Any]:
    """The keywords that a wrapper was saved with, with the user's own bonus where it had one."""
    name = keywords["bonus"]
    if name is None and bonus is None:
        raise ValueError("`bonus` must be given, the wrapper was saved with an object.")
    if name is not None and bonus is not None:
        raise ValueError(f"`bonus` must be None, it was saved as {name!r}.")
    return keywords | {"bonus": bonus or name}


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
