"""Stable-Baselines3's TD3 with the env first, coverage, and a resume that is exact."""

from __future__ import annotations

import copy
import math
from abc import abstractmethod
from collections.abc import Set
from contextlib import suppress
from typing import Any, ClassVar, Never, Self

import numpy as np
import torch as th
from stable_baselines3 import TD3
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.noise import ActionNoise
from stable_baselines3.common.preprocessing import get_action_dim
from stable_baselines3.common.type_aliases import (
    MaybeCallback,
    RolloutReturn,
    Schedule,
    TrainFreq,
    TrainFrequencyUnit,
)
from stable_baselines3.common.utils import should_collect_more_steps
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.td3.policies import TD3Policy

from curiosity_algos.checkpoints.environment_state import (
    environment_states,
    load_environment_states,
)
from curiosity_algos.checkpoints.model_file import TRANSITIONS
from curiosity_algos.common.interrupt import deferred_interrupt
from curiosity_algos.common.networks import single_torch_thread
from curiosity_algos.common.randomness import GlobalGenerators, SpaceGenerator
from curiosity_algos.evaluation.arguments import (
    check_common,
    check_keywords_known,
    check_learning,
    check_order,
    use_python_numbers,
)
from curiosity_algos.evaluation.coverage import Coverage
from curiosity_algos.evaluation.environments import open_env
from curiosity_algos.evaluation.episodes import EpisodeRecord
from curiosity_algos.evaluation.evaluator import AnyEnv
from curiosity_algos.evaluation.vector import most_steps
from curiosity_algos.sb3.resumable import Resumable
from curiosity_algos.sb3.td3_envs import (
    GaussianActionNoise,
    check_env,
    check_length,
    default_policy,
)
from curiosity_gym.validation import (
    LARGEST_COUNT,
    check_at_least_one,
    check_not_negative,
    check_share,
    check_whole,
)


class ResumableTD3(Resumable, TD3):
    """TD3 on one environment, whose checkpoints hold all that the run needs to go on bit for bit.

    A subclass makes its parts and the replay buffer (`_make_parts`), sees each rollout
    (`_see_rollout`), and trains its parts after it (`_train_parts`). Training goes on one torch
    thread, on which small batches are no slower and bits do not depend on the machine's number.

    Args:
        env: An environment id, a Gymnasium env, or an SB3 VecEnv or Gymnasium VectorEnv of one.
            Actions must be a bounded Box.
        policy: "MlpPolicy", "CnnPolicy", "MultiInputPolicy", or a subclass of one of these; None:
            the last where observations are a Dict, else the first.
        learning_rate: Adam's, of actor and critics, or a schedule as in SB3.
        buffer_size: Transitions kept.
        learning_starts: Steps of random actions before the first training.
        batch_size: Transitions a gradient step.
        tau: Share of the networks that moves into the target networks at each update, in [0, 1].
        gamma: Discount of future rewards, in [0, 1].
        train_freq: As in SB3: what a rollout is, in steps, or a pair such as (1, "episode").
        gradient_steps: After each rollout; -1: as many as it had steps.
        action_noise: As in SB3; None: normal with standard deviation .1, seeded.
        policy_delay: Gradient steps of the critics for each of the actor.
        target_policy_noise: Standard deviation of the noise on target actions, at least 0.
        target_noise_clip: Largest absolute value of that noise.
        policy_kwargs: As in SB3.
        seed: Seed of everything random; None: fresh entropy.
        device: Where the networks are, as in SB3.
        verbose: 0: silent, 1: a table at each log, 2: SB3's debug messages too.
        tensorboard_log: Folder of TensorBoard's files; None: none.
        stats_window_size: Episodes that logged means are over.

    Raises:
        ValueError: If an argument is out of its range, or the env's spaces are not supported.
    """

    _attributes: ClassVar = {**Resumable._attributes, "stats_window_size": "_stats_window_size"}

    def __init__(
        self,
        env: AnyEnv | None,
        policy: str | type[TD3Policy] | None = None,
        *,
        learning_rate: float | Schedule = 1e-3,
        buffer_size: int = 1_000_000,
        learning_starts: int = 100,
        batch_size: int = 256,
        tau: float = 0.005,
        gamma: float = 0.99,
        train_freq: int | tuple[int, str] = 1,
        gradient_steps: int = 1,
        action_noise: ActionNoise | None = None,
        policy_delay: int = 2,
        target_policy_noise: float = 0.2,
        target_noise_clip: float = 0.5,
        policy_kwargs: dict[str, Any] | None = None,
        seed: int | None = None,
        device: th.device | str = "auto",
        verbose: int = 0,
        tensorboard_log: str | None = None,
        stats_window_size: int = 100,
        _init_setup_model: bool = True,  # as in SB3: `load` builds the model later
        **unknown: Never,
    ) -> None:
        check_keywords_known(type(self), unknown)
        check_order(self, env, policy or "MlpPolicy")
        check_common(seed, device, verbose)
        env = open_env(env)
        if env is not None or _init_setup_model:
            check_env(env)
        super().__init__(
            policy or default_policy(env),
            env,  # type: ignore[arg-type]  # `_wrap_env` takes a VectorEnv too
            learning_rate=learning_rate,
            buffer_size=buffer_size,
            learning_starts=learning_starts,
            batch_size=batch_size,
            tau=tau,
            gamma=gamma,
            train_freq=train_freq,
            gradient_steps=gradient_steps,
            action_noise=action_noise,
            policy_delay=policy_delay,
            target_policy_noise=target_policy_noise,
            target_noise_clip=target_noise_clip,
            policy_kwargs=policy_kwargs,
            seed=seed,
            device=device,
            verbose=verbose,
            tensorboard_log=tensorboard_log,
            stats_window_size=stats_window_size,
            _init_setup_model=False,
        )
        self._n_steps = self._n_episodes = 0  # of the rollout under way
        self._is_seen = False
        self._interrupted: dict[str, Any] | None = None
        self._see_env(self.env)
        if _init_setup_model:
            self._setup_model()

    # -- what an algorithm writes ---------------------------------------------------------------

    @abstractmethod
    def _make_parts(self, seed: np.random.SeedSequence) -> ReplayBuffer:
        """Create what the algorithm holds, and give its replay buffer."""

    @abstractmethod
    def _see_rollout(self, n_steps: int) -> None:
        """Take in a rollout, the newest `n_steps` of the replay buffer, before training on it."""

    @abstractmethod
    def _train_parts(self, batch_size: int) -> None:
        """Train what the algorithm holds, before actor and critics."""

    # -- the model ------------------------------------------------------------------------------

    def _setup_model(self) -> None:
        self._check_settings()
        check_at_least_one(stats_window_size=self._stats_window_size)
        seeds = np.random.SeedSequence(self.seed).spawn(3)
        self._generators = GlobalGenerators(seeds[0], self.device)
        self._record = EpisodeRecord(self._coverage_grid)
        if self.action_noise is None:
            self.action_noise = GaussianActionNoise(get_action_dim(self.action_space), seeds[1])
        self.replay_buffer = self._make_parts(seeds[2])
        self._random_actions = SpaceGenerator(self.action_space)
        with self._generators.lent():
            super()._setup_model()
        assert isinstance(self.train_freq, TrainFreq)
        check_at_least_one(train_freq=self.train_freq.frequency)
        self._settled = self._settings_of_parts()

    def _check_settings(self) -> None:
        """Check what the constructor was given, and what `load` or a callback has replaced."""
        use_python_numbers(self)
        check_at_least_one(batch_size=self.batch_size, policy_delay=self.policy_delay)
        check_share(tau=self.tau, gamma=self.gamma)
        check_whole(0, LARGEST_COUNT, learning_starts=self.learning_starts)
        check_not_negative(target_policy_noise=self.target_policy_noise)
        check_not_negative(target_noise_clip=self.target_noise_clip)
        if self.gradient_steps not in (-1, 0):
            check_at_least_one(gradient_steps=self.gradient_steps)

    def _settings_of_parts(self) -> set[str]:
        of_parts = {"action_noise", "buffer_size", "train_freq", "stats_window_size"}
        return super()._settings_of_parts() | of_parts

    def set_random_seed(self, seed: int | None = None) -> None:
        """Begin every random draw of the run anew, see `Resumable.set_random_seed`."""
        super().set_random_seed(seed)
        if seed is not None:
            self._generators.seed(np.random.SeedSequence(seed))

    def _random_parts(self) -> list[object]:
        # SB3 seeds before it makes a policy: the parts are new then.
        return [self.action_noise, *super()._random_parts()] if hasattr(self, "policy") else []

    @classmethod
    def _open_env(cls, env: Any) -> Any:
        env = super()._open_env(env)
        check_env(env)
        return env

    def _counted(self) -> Coverage:
        return self._record.coverage

    def _forget_found(self) -> None:
        self._record = EpisodeRecord(self._coverage_grid)

    @property
    def best_return(self) -> float:
        """Highest return of an episode so far; -inf before the first, or if no Monitor sees any."""
        return self._record.best_return

    @property
    def first_reward_timesteps(self) -> int | None:
        """Timesteps when an episode that a Monitor saw first had a return above 0, or None."""
        return self._record.firsts.reward

    @property
    def first_success_timesteps(self) -> int | None:
        """Timesteps when an episode first succeeded, or None."""
        return self._record.firsts.success

    # -- the loop -------------------------------------------------------------------------------

    def learn(
        self,
        total_timesteps: float,
        callback: MaybeCallback = None,
        log_interval: int | None = 4,
        tb_log_name: str | None = None,
        reset_num_timesteps: bool = True,
        progress_bar: bool = False,
    ) -> Self:
        """Train until the rollout that reaches the budget has ended.

        Ctrl-C takes effect after a step or a training, so that the model can be saved; a second one
        at once.

        Arguments are SB3's. Callbacks are called after each step, and may save the model at any
        time; `log_interval` counts episodes, None: no log. `reset_num_timesteps=False` goes on, as
        after `load`, in the episode under way.

        Raises:
            ValueError: If the budget is negative or not finite, `log_interval` is below 1,
                `callback` is none, or no env is set.
            RuntimeError: If a model learns in another thread.
        """
        check_learning(self.env, total_timesteps, log_interval, callback)
        name = tb_log_name or type(self).__name__
        with self._learning(), self._generators.lent(), single_torch_thread():
            return super().learn(
                int(total_timesteps),
                callback,
                log_interval,  # type: ignore[arg-type]  # SB3's own loop takes None, its hint does not
                name,
                reset_num_timesteps,
                progress_bar,
            )

    def _setup_learn(
        self,
        total_timesteps: int,
        callback: MaybeCallback = None,
        reset_num_timesteps: bool = True,
        tb_log_name: str = "run",
        progress_bar: bool = False,
    ) -> tuple[int, BaseCallback]:
        is_resumed = self._last_obs is None and not reset_num_timesteps
        noise = copy.deepcopy(vars(self.action_noise))
        begun = super()._setup_learn(
            total_timesteps, callback, reset_num_timesteps, tb_log_name, progress_bar
        )
        if reset_num_timesteps:
            self._begin_rollout()
        else:
            vars(self.action_noise).update(noise)  # SB3 has reset it, as if an episode began
        if is_resumed and self._interrupted is not None:
            assert self.env is not None
            with suppress(ValueError):  # another environment, in which an episode has just begun
                load_environment_states(self.env, self._interrupted["states"])
                self._last_obs = self._interrupted["last_obs"]
        self._interrupted = None
        return begun

    def collect_rollouts(
        self,
        env: VecEnv,
        callback: BaseCallback,
        train_freq: TrainFreq,
        replay_buffer: ReplayBuffer,
        action_noise: ActionNoise | None = None,
        learning_starts: int = 0,
        log_interval: int | None = None,
    ) -> RolloutReturn:
        """Collect as SB3 does, but store a step wholly before callbacks see it: they may save.

        A rollout that was interrupted goes on, and counts as one.

        Raises:
            ValueError: If rollouts are episodes and one does not end, see `most_steps`.
        """
        self.policy.set_training_mode(False)
        callback.on_rollout_start()
        goes_on = True
        # Rollouts of a number of steps end whatever episodes do.
        limit = math.inf if train_freq.unit is TrainFrequencyUnit.STEP else most_steps(env)
        n_steps = 0  # of the episode, as far as seen here
        while goes_on and should_collect_more_steps(train_freq, self._n_steps, self._n_episodes):
            check_length(n_steps, limit)
            with deferred_interrupt("the step"):
                step = self._step(env, replay_buffer, action_noise, learning_starts)
                callback.update_locals({**step, "train_freq": train_freq})
                goes_on = callback.on_step()
                is_over = step["dones"][0]
                if is_over and log_interval is not None and self._episode_num % log_interval == 0:
                    self.dump_logs()
            n_steps = 0 if is_over else n_steps + 1
        rollout = RolloutReturn(self._n_steps, self._n_episodes, continue_training=goes_on)
        if goes_on:
            callback.on_rollout_end()
            with deferred_interrupt("the rollout"):
                self._end_rollout()
        return rollout

    def _step(
        self,
        env: VecEnv,
        replay_buffer: ReplayBuffer,
        action_noise: ActionNoise | None,
        learning_starts: int,
    ) -> dict[str, Any]:
        """Act once; what SB3's callbacks find in their `locals`."""
        actions, buffer_actions = self._sample_action(learning_starts, action_noise)
        new_obs, rewards, dones, infos = env.step(actions)
        # First of all, as it refuses what cannot be learned from. A VecEnv's hint allows for
        # tuples of observations, which SB3 has none of.
        self._store_transition(replay_buffer, buffer_actions, new_obs, rewards, dones, infos)  # type: ignore[arg-type]
        self.num_timesteps += 1
        self._n_steps += 1
        self._update_info_buffer(infos, dones)
        self._update_current_progress_remaining(self.num_timesteps, self._total_timesteps)
        self._record.add(infos, dones, self.num_timesteps)
        if dones[0]:
            self._n_episodes += 1
            self._episode_num += 1
            if action_noise is not None:
                action_noise.reset()
        return {
            "env": env,
            "replay_buffer": replay_buffer,
            "action_noise": action_noise,
            "learning_starts": learning_starts,
            "actions": actions,
            "buffer_actions": buffer_actions,
            "new_obs": new_obs,
            "rewards": rewards,
            "dones": dones,
            "infos": infos,
            "num_collected_steps": self._n_steps,
            "num_collected_episodes": self._n_episodes,
        }

    def _end_rollout(self) -> None:
        """Show the rollout to the algorithm, once; its counts stay until it has been trained on."""
        self._check_settings()
        self._setup_lr_schedule()  # of the learning rate as it is now
        if not self._is_seen:
            self._see_rollout(self._n_steps)
            self._is_seen = True
        if self.num_timesteps <= self.learning_starts or self.gradient_steps == 0:
            self._begin_rollout()

    def _begin_rollout(self) -> None:
        self._n_steps = self._n_episodes = 0
        self._is_seen = False

    def train(self, gradient_steps: int, batch_size: int = 100) -> None:
        """Train as SB3 does, but not to be interrupted in the midst of it."""
        with deferred_interrupt("the training"):
            self._train_parts(batch_size)
            super().train(gradient_steps, batch_size)
            self._begin_rollout()

    def dump_logs(self) -> None:
        """Write log data, with it coverage, and when the first reward and success came."""
        shares = {f"coverage/{name}": share for name, share in self.coverage_shares.items()}
        for name, value in (shares | self._record.firsts.metrics).items():
            self.logger.record(name, value)
        super().dump_logs()

    # -- save and load --------------------------------------------------------------------------

    def _saved_instead(self, exclude: Set[str]) -> dict[str, Any]:
        episode = self._interrupted  # where none has begun since
        if self.env is not None and self._last_obs is not None:
            states = environment_states(self.env)
            episode = None if states is None else {"states": states, "last_obs": self._last_obs}
        instead: dict[str, Any] = {"_interrupted": episode}
        if exclude & TRANSITIONS:  # none are left to train on
            instead |= {"_n_steps": 0, "_n_episodes": 0, "_is_seen": False}
        return instead
