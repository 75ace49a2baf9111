"""The loop that every population algorithm shares, behind Stable-Baselines3's API."""

from __future__ import annotations

import time
from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, Self
from warnings import warn

import gymnasium as gym
import numpy as np
import torch as th
from gymnasium.vector import VectorEnv
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback, CallbackList
from stable_baselines3.common.policies import BasePolicy
from stable_baselines3.common.type_aliases import GymEnv, MaybeCallback
from stable_baselines3.common.utils import check_for_correct_spaces
from stable_baselines3.common.vec_env import VecEnv

from curiosity_algos.common.arrays import Float32Array, Float64Array
from curiosity_algos.common.interrupt import deferred_interrupt
from curiosity_algos.common.randomness import sole_learner
from curiosity_algos.evaluation.arguments import (
    check_common,
    check_keywords_known,
    check_learning,
    check_no_options,
    check_order,
    use_python_numbers,
)
from curiosity_algos.evaluation.base import Evaluator
from curiosity_algos.evaluation.coverage import behavior_space
from curiosity_algos.evaluation.environments import GymnasiumView, SingleVecEnv, describe, open_env
from curiosity_algos.evaluation.evaluator import AnyEnv, check_policy_kwargs
from curiosity_algos.evaluation.mlp import build_mlp
from curiosity_algos.evaluation.policies import MlpPolicy
from curiosity_algos.evaluation.rollouts import Rollouts, Summarizer
from curiosity_algos.loops.population_model import PopulationModel
from curiosity_algos.loops.progress_bar import ProgressBar
from curiosity_gym.validation import check_at_least_one

_SETTLED = ("policy_kwargs", "preset", "seed", "device", "n_threads")
"""Settings of every algorithm that parts were made with."""


class EvolutionaryAlgorithm(PopulationModel):
    """Asks for parameters, evaluates them and learns from the rollouts, until the budget is spent.

    A subclass holds its search and says `_make_search`, `_ask`, `_tell` and `_center`.

    A timestep is one environment step of one individual. Callbacks are called once a generation, so
    their frequencies count generations. Their `locals` have the last step of each individual's
    episode (`rewards`, `dones`, `infos`), the `rollouts`, the `parameters` (P, n_parameters), the
    `episode_seed` that all shared, and the `intrinsic` fitness (P,), None where there is none.

    Args:
        env: An environment id, a function that makes an environment, a Gymnasium env or VectorEnv,
            or an SB3 VecEnv. Observations are Box, Discrete, MultiBinary or MultiDiscrete, or a
            Dict or Tuple of such; actions are one of the four, a Box with bounds.
        policy: "MlpPolicy", or a subclass of it.
        policy_kwargs: `net_arch`, widths of the hidden layers; None: 32 and 16, as in the paper.
        evaluator: Evaluates populations: "auto", the fastest that fits `env`; "ray", the same
            on a Ray cluster, see `RayEvaluator`; or an `Evaluator` for as many parameters as the
            policy has, which `load` takes again.
        n_threads: Threads of the compiled parts; None: as many as there are processors. Results do
            not depend on it.
        seed: Seed of everything random; None: fresh entropy.
        device: Device of the bonus' networks, as in SB3; policies are evaluated on the CPU.
        verbose: 0: silent, 1: a table at each log, 2: SB3's debug messages too.
        tensorboard_log: Folder of TensorBoard's files; None: none.

    Attributes:
        generation: Generations finished.

    Raises:
        ValueError: If an argument is out of its range, or the env's spaces are not supported.
    """

    policy_aliases: ClassVar[dict[str, type[BasePolicy]]] = {"MlpPolicy": MlpPolicy}

    def __init__(
        self,
        env: AnyEnv | None,
        policy: str | type[MlpPolicy] = "MlpPolicy",
        *,
        evaluator: Evaluator | str = "auto",
        policy_kwargs: dict[str, Any] | None = None,
        n_threads: int | None = None,
        seed: int | None = None,
        device: th.device | str = "auto",
        verbose: int = 0,
        tensorboard_log: str | None = None,
        _init_setup_model: bool = True,  # as in SB3: `load` builds the model later
        **settings: Any,
    ) -> None:
        check_keywords_known(type(self), sorted(settings.keys() - self._declared.keys()))
        check_order(self, env, policy)
        check_common(seed, device, verbose)
        for name, one in self._declared.items():
            value = one.convert(settings.get(name, one.default))
            setattr(self, self._attributes.get(name, name), value)
        policy_kwargs = self._policy_kwargs(policy_kwargs)
        env = open_env(env)
        if env is not None or _init_setup_model:
            build_mlp(*describe(env), policy_kwargs.get("net_arch", ()))
        # Not by name: SB3 has one of its own for policies that observe a Dict.
        policy_class = self._get_policy_from_name(policy) if isinstance(policy, str) else policy
        super().__init__(
            policy_class,
            env,  # type: ignore[arg-type]  # `_wrap_env` takes a VectorEnv too
            learning_rate=getattr(self, "learning_rate", 0.0),
            policy_kwargs=policy_kwargs,
            tensorboard_log=tensorboard_log,
            verbose=verbose,
            device=device,
            support_multi_env=True,
            seed=seed,
        )
        self._evaluator_choice = evaluator
        self.preset = None
        self.n_threads = n_threads
        self.generation = 0
        self._see_env(self.env)
        if _init_setup_model:
            self._setup_model()

    def _policy_kwargs(self, policy_kwargs: dict[str, Any] | None) -> dict[str, Any]:
        """Those that policies are made with; ValueError for others."""
        return {"net_arch": check_policy_kwargs(policy_kwargs)}

    @abstractmethod
    def _make_search(self, seed: np.random.SeedSequence) -> None:
        """Create what the algorithm holds; everything random grows from `seed`."""

    @abstractmethod
    def _ask(self) -> Float32Array:
        """The parameters to evaluate next, shape (P, n_parameters)."""

    @abstractmethod
    def _tell(self, rollouts: Rollouts) -> Mapping[str, float]:
        """Learn from the population just evaluated; metrics to log."""

    @abstractmethod
    def _center(self) -> Float32Array:
        """The parameters that act while no individual has found a reward, shape (n_parameters,)."""

    def _put_in_force(self) -> None:
        """Give the parts the settings as they are now, before each generation."""
        for name, one in self._declared.items():
            if one.part is not None:
                setattr(getattr(self, one.part), name, getattr(self, name))

    def _summarizers(self, n_individuals: int) -> Mapping[str, Summarizer] | None:
        """What `_tell` reads of trajectories, as populations are played in blocks; None: all."""
        return None

    @staticmethod
    def _wrap_env(env: Any, verbose: int = 0, monitor_wrapper: bool = True) -> VecEnv:
        # SB3 would transpose images: policies see vectors, and `predict` what the env has itself.
        if isinstance(env, gym.Env):
            return SingleVecEnv(env)
        if isinstance(env, VectorEnv):
            return GymnasiumView(env)
        is_vec_env = isinstance(env, VecEnv)
        return env if is_vec_env else BaseAlgorithm._wrap_env(env, verbose, monitor_wrapper)

    def _check_settings(self) -> None:
        """Check what the constructor was given, and what `load` or a callback has replaced."""
        use_python_numbers(self)
        check_common(self.seed, self.device, self.verbose)
        if self.n_threads is not None:
            check_at_least_one(n_threads=self.n_threads)

    def _setup_model(self) -> None:
        self._check_settings()
        # SB3 knows the class as that of any policy.
        self.policy = self.policy_class(
            self.observation_space, self.action_space, **self.policy_kwargs
        )  # type: ignore[assignment]
        self._begin_records()
        self._generation_values: dict[str, Any] = {}
        self._intrinsic: Float64Array | None = None
        search_seed, episode_seed = np.random.SeedSequence(self.seed).spawn(2)
        self._episode_seeds, self._episode_seed = np.random.default_rng(episode_seed), 0
        self._make_search(search_seed)
        self.evaluator = None
        if self.env is not None:
            self.evaluator = self._choose_evaluator(self._evaluator_choice, self.env)
        self._show_best()
        arguments = self._settings()
        self._settled = {*_SETTLED} | {
            name
            for name, one in self._declared.items()
            if one.settled or one.fixed or arguments.get(one.idle_with or "") is not None
        }

    def set_env(self, env: GymEnv, force_reset: bool = True) -> None:
        """Train on another environment with the same spaces.

        Where coverage counts other cells than before, as in another maze, coverage, the best policy
        and archives of behaviors start anew; networks that have learned go on.

        Args:
            env: As in the constructor.
            force_reset: As in SB3.

        Raises:
            ValueError: If the spaces are others, or the env is not supported; if coverage counts
                other cells, and the constructor was given an evaluator.
        """
        env = open_env(env)
        wrapped = self._wrap_env(env, self.verbose)
        check_for_correct_spaces(wrapped, self.observation_space, self.action_space)
        self._check_behaviors(behavior_space(wrapped))
        choice = self._evaluator_choice
        if not isinstance(choice, str) and self._counts_others(wrapped):
            raise ValueError(
                "`env` must be like the one before, which `evaluator` was given for: save the "
                "model, and load it with this `env` and another `evaluator`."
            )
        evaluator = self._choose_evaluator(choice, wrapped)
        self.n_envs = wrapped.num_envs  # populations do not depend on the number of envs
        super().set_env(wrapped, force_reset)
        self._match_env(wrapped)
        self.evaluator = evaluator

    @property
    def best_return(self) -> float:
        """Highest return so far, to 6 digits as of SB3's Monitor; -inf before a generation."""
        return round(self._best.value, 6)

    @property
    def best_episode_seed(self) -> int | None:
        """Seed of the reset of the episode with the best return, or None."""
        return self._best.seed if self._best.has_reward else None

    @property
    def n_workers(self) -> int | None:
        """Workers of a Ray cluster that evaluate at present; None without a cluster."""
        return None if self.evaluator is None else self.evaluator.n_live

    def learn(
        self,
        total_timesteps: float,
        callback: MaybeCallback = None,
        log_interval: int | None = 1,
        tb_log_name: str | None = None,
        reset_num_timesteps: bool = True,
        progress_bar: bool = False,
    ) -> Self:
        """Search until the generation that reaches the budget has ended.

        Ctrl-C takes effect at the end of the running generation, a second one at once.

        Args:
            total_timesteps: Budget in environment steps, at least 0; floats such as 1e6 are fine.
            callback: SB3 callbacks; called once a generation.
            log_interval: Generations between two logs; None: none.
            tb_log_name: Name of the run for TensorBoard; None: the algorithm's.
            reset_num_timesteps: Count timesteps from 0 again; False: go on, as after `load`. All
                else goes on either way.
            progress_bar: Show a bar of timesteps.

        Raises:
            ValueError: If an argument is out of its range, no env is set, or it has options.
            RuntimeError: If a model learns in another thread.
        """
        check_learning(self.env, total_timesteps, log_interval)
        check_no_options(self.env)
        name = tb_log_name or type(self).__name__
        with sole_learner():
            self._warn_of_loss()
            total, callback = self._setup_learn(
                int(total_timesteps), callback, reset_num_timesteps, name, progress_bar=False
            )
            if progress_bar:
                callback = CallbackList([callback, ProgressBar()])
                callback.init_callback(self)
            arguments = {"log_interval": log_interval, "tb_log_name": name}
            callback.on_training_start({"self": self, "total_timesteps": total, **arguments}, {})
            goes_on = self.num_timesteps < total
            while goes_on:
                with deferred_interrupt("the generation"):
                    goes_on = self._learn_generation(callback, total, log_interval)
            callback.on_training_end()
        return self

    def _warn_of_loss(self) -> None:
        """Say so if the transitions that were collected before are lost."""
        if self._lacks_transitions:
            warn(
                "The file of this model was saved without its buffer, which begins empty: what is "
                "learned from here on is not what an uninterrupted run would have learned.",
                stacklevel=3,
            )
            self._lacks_transitions = False

    def _learn_generation(
        self, callback: BaseCallback, total_timesteps: int, log_interval: int | None
    ) -> bool:
        """Run a generation, show it to the callbacks and log it; whether there is another."""
        callback.on_rollout_start()
        step = self._run_generation()
        progress = min(self.num_timesteps, total_timesteps)
        self._update_current_progress_remaining(progress, total_timesteps)
        self._update_info_buffer(step["infos"], step["dones"])
        callback.update_locals(step)
        goes_on = callback.on_step()
        callback.on_rollout_end()
        if log_interval is not None and self.generation % log_interval == 0:
            self.dump_logs()
        goes_on = goes_on and self.num_timesteps < total_timesteps
        if goes_on:  # those of large populations are gigabytes: they make room before the next come
            callback.update_locals({"rollouts": step["rollouts"].without_trajectories()})
        return goes_on

    def _run_generation(self) -> dict[str, Any]:
        """Run a generation; the entries of callbacks' `locals`."""
        self._check_settings()
        self._follow_env()
        self._put_in_force()
        assert self.env is not None
        parameters, rollouts = self._play()
        if self.env.num_envs > 1:  # all had one seed: the next episodes there are to differ again
            self.env.seed(self._episode_seed + 1)
        rollouts.check(self._behavior_space)
        metrics = self._tell(rollouts)
        self._record(parameters, rollouts)
        seconds = self._seconds()
        self._generation_values = {
            "rollout/ep_rew_mean": rollouts.returns.mean(),
            "rollout/ep_rew_max": rollouts.returns.max(),
            "rollout/ep_len_mean": rollouts.lengths.mean(),
            "rollout/success_rate": rollouts.success.mean(),
            **metrics,
        }
        return {
            "rollouts": rollouts,
            "rewards": rollouts.returns,
            "dones": np.ones(len(rollouts), dtype=bool),
            "infos": rollouts.infos(seconds),
            "parameters": parameters,
            "episode_seed": self._episode_seed,
            "intrinsic": self._intrinsic,
        }

    def _play(self) -> tuple[Float32Array, Rollouts]:
        """A population (P, n_parameters), and an episode of each of its individuals."""
        assert isinstance(self.evaluator, Evaluator)
        parameters = self._ask()
        summarizers = self._summarizers(len(parameters))
        self._episode_seed = int(self._episode_seeds.integers(2**31))
        rollouts = self.evaluator.play(parameters, self._episode_seed, summarizers)
        if len(rollouts) != len(parameters):
            raise ValueError(
                f"`evaluator` must give one episode of each of {len(parameters)} policies, got "
                f"{len(rollouts)}."
            )
        return parameters, rollouts

    def _record(self, parameters: Float32Array, rollouts: Rollouts) -> None:
        """Update timesteps, the first reward and success, coverage and the best policy."""
        ends = self.num_timesteps + np.cumsum(rollouts.lengths)
        self._firsts.add(ends, rollouts.returns, rollouts.success)
        self.num_timesteps += rollouts.timesteps
        self.generation += 1
        self._coverage.add(rollouts.behaviors, rollouts.visited)
        self._best.add(parameters, rollouts, self._episode_seed)
        self._show_best()

    def _show_best(self) -> None:
        """Let `predict` act with the best policy, or the center while no reward was found."""
        best = self._best.parameters if self._best.has_reward else None
        self.policy.vector[:] = self._center() if best is None else best

    def _seconds(self) -> float:
        """Since `learn` began."""
        return max((time.time_ns() - self.start_time) / 1e9, 1e-9)

    def dump_logs(self) -> None:
        """Write the log of the last generation."""
        values: dict[str, Any] = {
            **self._generation_values,
            "time/fps": int((self.num_timesteps - self._num_timesteps_at_start) / self._seconds()),
            "time/generations": self.generation,
            "time/total_timesteps": self.num_timesteps,
            **self._firsts.metrics,
        }
        values |= {f"coverage/{name}": share for name, share in self.coverage_shares.items()}
        if self.n_workers is not None:
            values["time/workers"] = self.n_workers
        for key, value in values.items():
            self.logger.record(key, value)
        self.logger.dump(self.num_timesteps)
