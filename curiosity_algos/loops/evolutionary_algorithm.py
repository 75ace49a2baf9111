"""The loop that every population algorithm shares, behind Stable-Baselines3's API."""

from __future__ import annotations

import io
import os
import time
from abc import abstractmethod
from collections.abc import Iterable, Mapping
from typing import Any, ClassVar, Self

import numpy as np
import numpy.typing as npt
import torch as th
from gymnasium import spaces
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback, CallbackList
from stable_baselines3.common.policies import BasePolicy
from stable_baselines3.common.type_aliases import GymEnv, MaybeCallback, TensorDict
from stable_baselines3.common.utils import check_for_correct_spaces
from stable_baselines3.common.vec_env import VecEnv

from curiosity_algos.checkpoints.model_file import (
    check_is_checkpoint,
    pickled_attributes,
    read_attributes,
    read_model,
    save_model,
)
from curiosity_algos.checkpoints.parts import stateful_parts
from curiosity_algos.checkpoints.rebuild import build_model, check_names, read_parameters
from curiosity_algos.common.interrupt import deferred_interrupt
from curiosity_algos.common.randomness import AnyGenerator, EpisodeSeeds, reseed
from curiosity_algos.evaluation.arguments import check_learning, check_order, wrap_env
from curiosity_algos.evaluation.blocks import play
from curiosity_algos.evaluation.constructors import AlgorithmType, name_of_applied
from curiosity_algos.evaluation.coverage import Coverage, behavior_space, coverage_grid
from curiosity_algos.evaluation.environments import describe, open_env
from curiosity_algos.evaluation.evaluator import (
    AnyEnv,
    Evaluator,
    check_policy_kwargs,
    make_evaluator,
)
from curiosity_algos.evaluation.policies import Float32Array, MlpPolicy, build_mlp
from curiosity_algos.evaluation.rollouts import MakeReads, Rollouts
from curiosity_algos.loops.generation import as_step
from curiosity_algos.loops.progress_bar import ProgressBar
from curiosity_gym.validation import check_at_least_one, check_choice, check_seed

_BESIDE_THE_SEARCH = {"policy", "_coverage", "_episodes", "_fitness", "_motivation"}
"""Names of parts that do not say where a search stands."""


class EvolutionaryAlgorithm(BaseAlgorithm, metaclass=AlgorithmType):
    """Asks for parameters, evaluates them and learns from the rollouts, until the budget is spent.

    A subclass holds its search and says `_make_search`, `_ask`, `_tell` and `_center`; the rest is
    here: the budget, callbacks, logging, coverage, the best policy, save and load.

    A timestep is one environment step of one individual. Callbacks are called once a generation, so
    their frequencies count generations; in their `locals` it is the last step of as many episodes
    as there are individuals (`rewards`, `dones`, `infos`), beside the `rollouts` themselves, the
    `parameters` (P, n_parameters) that were evaluated, the `episode_seed` that all of them shared,
    and the `intrinsic` fitness (P,) of algorithms that have one, else None.

    Args:
        env: An environment id, a function that makes an environment, a Gymnasium env or VectorEnv,
            or an SB3 VecEnv. Observations must be a 1-D Box, actions a bounded 1-D Box or Discrete.
        policy: "MlpPolicy", or a subclass of it.
        policy_kwargs: `net_arch`, widths of the hidden layers; None: 32 and 16, as in the paper.
        preset: "paper" or "tuned": settings that replace the defaults of what is not given here,
            see `load_preset`; None: none.
        evaluator: What evaluates populations: "auto", the fastest that fits `env`; "ray", the same
            on every processor of a Ray cluster, see `RayEvaluator`; or an `Evaluator` for as many
            parameters as the policy has. `set_env` keeps one that was given, where it fits; `load`
            takes it again.
        n_threads: Threads of the compiled parts; None: as many as there are processors. Of an
            environment that has none, and that an id or a function makes: processes; None: this one
            alone. Results do not depend on it.
        seed: Seed of everything random; None: fresh entropy.
        device: Where the bonus' networks are, as in SB3; policies are evaluated on the CPU.
        verbose: 0: silent, 1: a table at each log, 2: SB3's debug messages too.
        tensorboard_log: Folder of TensorBoard's files; None: none.

    Attributes:
        generation: Generations finished.
        best_return: Highest return of an individual so far, rounded to 6 digits as SB3's Monitor
            does; -inf before the first generation.
        first_success_timesteps: Timesteps when an individual first succeeded, or None.

    Raises:
        ValueError: If an argument is out of its range, or the env's spaces are not supported.
    """

    policy_aliases: ClassVar[dict[str, type[BasePolicy]]] = {"MlpPolicy": MlpPolicy}
    policy: MlpPolicy
    evaluator: Evaluator | None

    def __init__(
        self,
        env: AnyEnv | None,
        policy: str | type[MlpPolicy] = "MlpPolicy",
        *,
        preset: str | None = None,
        evaluator: Evaluator | str = "auto",
        policy_kwargs: dict[str, Any] | None = None,
        n_threads: int | None = None,
        seed: int | None = None,
        device: th.device | str = "auto",
        verbose: int = 0,
        tensorboard_log: str | None = None,
        _learning_rate: float = 0.0,  # what SB3 keeps under that name
        _init_setup_model: bool = True,  # as in SB3: `load` builds the model later
    ) -> None:
        check_order(self, env, policy)
        preset = name_of_applied(preset)
        check_seed(seed)
        net_arch = check_policy_kwargs(policy_kwargs)
        env = open_env(env)
        if env is not None or _init_setup_model:
            build_mlp(*describe(env), net_arch)
        super().__init__(
            policy,
            env,  # type: ignore[arg-type]  # `_wrap_env` takes a VectorEnv too
            learning_rate=_learning_rate,
            policy_kwargs={"net_arch": net_arch},
            tensorboard_log=tensorboard_log,
            verbose=verbose,
            device=device,
            support_multi_env=True,
            seed=seed,
        )
        self.preset = preset
        self._evaluator_choice = evaluator
        self._given: dict[str, list[str]] = {}
        self.n_threads = n_threads
        self.generation = 0
        self._best_return: float
        self.first_success_timesteps: int | None
        self._best_parameters: Float32Array | None
        self._forget_best()
        self._coverage_grid = None if self.env is None else coverage_grid(self.env)
        self._behavior_space = None if self.env is None else behavior_space(self.env)
        if _init_setup_model:
            self._setup_model()

    # -- what an algorithm writes ---------------------------------------------------------------

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

    def _reads(self) -> MakeReads | None:
        """What `_tell` needs of trajectories; None: all of them.

        Where it is said, large populations are played in blocks, and rollouts hold excerpts alone.
        """
        return None

    def _begin_at(self, parameters: Float32Array) -> None:
        """Search on from these parameters, shape (n_parameters,), where an algorithm can.

        Raises:
            ValueError: If it cannot; nothing has changed then.
        """
        raise ValueError(f"`policy` cannot be set alone: {type(self).__name__} begins nowhere.")

    # -- the model ------------------------------------------------------------------------------

    def _check_settings(self) -> None:
        """Check what the constructor was given, and what `load` may have replaced."""
        if self.n_threads is not None:
            check_at_least_one(n_threads=self.n_threads)

    def _setup_model(self) -> None:
        self._check_settings()
        # SB3 knows the class as that of any policy.
        self.policy = self.policy_class(
            self.observation_space, self.action_space, **self.policy_kwargs
        )  # type: ignore[assignment]
        self._coverage = Coverage(self._coverage_grid)
        self._generation_values: dict[str, Any] = {}
        self._intrinsic: npt.NDArray[np.float64] | None = None
        search_seed, episode_seed = np.random.SeedSequence(self.seed).spawn(2)
        self._episodes = EpisodeSeeds(episode_seed)
        self._make_search(search_seed)
        self.evaluator = None
        if self.env is not None:
            self.evaluator = self._choose_evaluator(self.env, self._evaluator_choice)
        self._show_best()

    def _check_given(self, name: str, kinds: list[str]) -> None:
        """Check parts of the user's own, which no file holds: `load` is to be given them again.

        Args:
            name: Of the argument.
            kinds: What tells such parts apart; empty: none was given.

        Raises:
            ValueError: If the model that was saved had others.
        """
        expected = self._given.setdefault(name, kinds)
        if kinds != expected:
            raise ValueError(
                f"`{name}` must be passed to `load` as it was to the saved model: "
                f"{', '.join(expected) or 'none'}, got {', '.join(kinds) or 'none'}."
            )

    def _choose_evaluator(self, env: VecEnv, choice: Evaluator | str) -> Evaluator:
        """What evaluates populations on `env`: what the user gave, or the fastest that fits."""
        if isinstance(choice, str):
            check_choice(("auto", "ray"), evaluator=choice)
            self._given["evaluator"] = []
            if choice == "ray":
                from curiosity_algos.evaluation.ray import RayEvaluator  # few have it

                return RayEvaluator(env, self.policy_kwargs)
            return make_evaluator(env, self.policy_kwargs, self.n_threads)
        wanted, own = self.policy.mlp.n_parameters, getattr(choice, "n_parameters", None)
        if own != wanted or not hasattr(choice, "evaluate"):
            raise ValueError(
                '`evaluator` must be "auto", "ray" or an Evaluator of the policy\'s '
                f"{wanted} parameters, got {choice!r} of {own}."
            )
        self._given["evaluator"] = [type(choice).__name__]
        return choice

    def set_random_seed(self, seed: int | None = None) -> None:
        """Begin every random draw of the run anew: search, motivation, archive and episodes.

        Unlike in SB3 the global generators of the process stay as they are.

        Args:
            seed: None: nothing is seeded.

        Raises:
            ValueError: If it is no whole number of at least 0.
        """
        check_seed(seed)
        if seed is None:
            return
        parts = [getattr(self, name) for name in self._get_torch_save_params()[0]]
        parts += [each for each in vars(self).values() if isinstance(each, AnyGenerator)]
        reseed(parts, np.random.SeedSequence(seed))
        self.action_space.seed(int(seed))
        if self.env is not None:
            self.env.seed(int(seed))

    @staticmethod
    def _wrap_env(env: Any, verbose: int = 0, monitor_wrapper: bool = True) -> VecEnv:
        return wrap_env(env, verbose, monitor_wrapper)

    def set_env(
        self, env: GymEnv, force_reset: bool = True, *, evaluator: Evaluator | str | None = None
    ) -> None:
        """Train on another environment with the same spaces.

        Where coverage counts other cells than before, as in another maze, coverage, the best policy
        and archives of behaviors start anew, and so does a search whose parents are an archive's
        elites; networks that have learned go on.

        Args:
            env: As in the constructor.
            force_reset: As in SB3.
            evaluator: As in the constructor; None: as before. One that was given fits another
                environment if its behaviors and what coverage counts are the same.

        Raises:
            ValueError: If the spaces are others, or the env is not supported; if the evaluator that
                was given does not fit.
        """
        env = open_env(env)
        wrapped = self._wrap_env(env, self.verbose)
        check_for_correct_spaces(wrapped, self.observation_space, self.action_space)
        self._check_behaviors(behavior_space(wrapped))
        choice = self._evaluator_choice if evaluator is None else evaluator
        if evaluator is None and not isinstance(choice, str) and self._counts_others(wrapped):
            raise ValueError('`evaluator` must be given, or "auto", as `env` is another one.')
        chosen = self._choose_evaluator(wrapped, choice)
        self.n_envs = wrapped.num_envs  # populations do not depend on the number of envs
        super().set_env(wrapped, force_reset)
        self._evaluator_choice, self.evaluator = choice, chosen
        self._match_env(wrapped)

    def _counts_others(self, env: VecEnv) -> bool:
        """Whether behaviors in `env`, or the cells that coverage counts, are others than here."""
        grid, space = coverage_grid(env), behavior_space(env)
        return grid != self._coverage_grid or space != self._behavior_space

    def _match_env(self, env: VecEnv) -> None:
        """Count in the grid of `env`; in another one, forget what was found before."""
        self._check_behaviors(behavior_space(env))
        if self._counts_others(env):
            self._coverage_grid, self._behavior_space = coverage_grid(env), behavior_space(env)
            self._coverage = Coverage(self._coverage_grid)
            self._forget_best()
            self._forget_behaviors()
            self._show_best()

    def _check_behaviors(self, space: spaces.Box[Any] | None) -> None:
        """Raise ValueError where the algorithm has no use for such behaviors of an env."""

    def _forget_behaviors(self) -> None:
        """Drop archives and the like that hold behaviors of another environment."""

    def _forget_best(self) -> None:
        self._best_return = -np.inf
        self.first_success_timesteps = None
        self._best_parameters = None
        self._has_reward = False

    @property
    def coverage(self) -> float | None:
        """Share of the reachable cells in which episodes ended; None: nothing to count.

        `coverage_shares["visited"]` is that of the cells in which any step ended.
        """
        return self._coverage.reachable

    @property
    def coverage_shares(self) -> dict[str, float]:
        """Every share that is logged under `coverage/`, by its name there."""
        return self._coverage.shares

    @property
    def best_return(self) -> float:
        """Highest return of an individual so far; -inf before the first generation.

        Rounded to 6 digits, as SB3's Monitor rounds: `evaluate_policy` of a monitored env says it.
        """
        return round(self._best_return, 6)

    @property
    def n_workers(self) -> int | None:
        """Workers of a Ray cluster that evaluate at present; None: the evaluator has none."""
        n_live: int | None = getattr(self.evaluator, "n_live", None)
        return n_live

    # -- the loop -------------------------------------------------------------------------------

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

        Ctrl-C takes effect at the end of the running generation, so that the model can be saved; a
        second one at once.

        Args:
            total_timesteps: Budget in environment steps, at least 0; floats such as 1e6 are fine.
            callback: SB3 callbacks; called once a generation.
            log_interval: Generations between two logs; None: none.
            tb_log_name: Name of the run for TensorBoard; None: the algorithm's.
            reset_num_timesteps: Count timesteps from 0 again; False: go on, as after `load`. The
                search, coverage, `generation` and what was found go on either way.
            progress_bar: Show a bar of timesteps.

        Raises:
            ValueError: If the budget is negative or not finite, `log_interval` is below 1, or no
                env is set.
        """
        check_learning(self.env, total_timesteps, log_interval)
        name = tb_log_name or type(self).__name__
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
        """What callbacks find in their `locals`, see `as_step`."""
        assert self.evaluator is not None
        parameters = self._ask()
        rollouts = play(self.evaluator, parameters, self._episodes.draw(), self._reads())
        if len(rollouts) != len(parameters):
            raise ValueError(
                f"`evaluator` must give one episode of each of {len(parameters)} policies, got "
                f"{len(rollouts)}."
            )
        self._check_rollouts(rollouts)
        metrics = self._tell(rollouts)
        self._record(parameters, rollouts)
        self._generation_values = {
            "rollout/ep_rew_mean": rollouts.returns.mean(),
            "rollout/ep_rew_max": rollouts.returns.max(),
            "rollout/ep_len_mean": rollouts.lengths.mean(),
            "rollout/success_rate": rollouts.success.mean(),
            **metrics,
        }
        return {
            **as_step(rollouts, self._seconds()),
            "parameters": parameters,
            "episode_seed": self._episodes.current,
            "intrinsic": self._intrinsic,
        }

    def _check_rollouts(self, rollouts: Rollouts) -> None:
        """Raise ValueError where the env gave what nothing can be learned from."""
        if not np.isfinite(rollouts.returns).all():
            raise ValueError("`env` must give finite rewards, an episode's return was not finite.")
        if not np.isfinite(rollouts.behaviors).all():
            raise ValueError("`env` must give finite behaviors, an episode's was not.")
        space = self._behavior_space
        if space is not None and rollouts.behaviors.shape[1:] != space.shape:
            raise ValueError('`env` must give an info["behavior"] of its `behavior_space`.')
        self._coverage.check(rollouts.visited)

    def _record(self, parameters: Float32Array, rollouts: Rollouts) -> None:
        """Update timesteps, first success, coverage and the best policy."""
        if self.first_success_timesteps is None and rollouts.success.any():
            steps = np.cumsum(rollouts.lengths)[np.argmax(rollouts.success)]
            self.first_success_timesteps = self.num_timesteps + int(steps)
        self.num_timesteps += rollouts.timesteps
        self.generation += 1
        self._coverage.add(rollouts.behaviors, rollouts.visited)
        highest = np.flatnonzero(rollouts.returns == rollouts.returns.max())
        best = int(highest[np.argmax(rollouts.success[highest])])
        # A success in the last step pays nothing, and is found all the same.
        is_found = bool(rollouts.success[best]) and not self._has_reward
        self._has_reward |= is_found or bool(np.any(rollouts.returns))
        if rollouts.returns[best] > self._best_return or is_found:
            self._best_return = float(rollouts.returns[best])
            self._best_parameters = parameters[best].copy()
        self._show_best()

    def _show_best(self) -> None:
        """Let `predict` act with the best policy, or the center while no reward was found."""
        found = self._best_parameters if self._has_reward else None
        self.policy.vector[:] = self._center() if found is None else found

    def _seconds(self) -> float:
        """Since `learn` began."""
        return max((time.time_ns() - self.start_time) / 1e9, 1e-9)

    def dump_logs(self) -> None:
        """Write the log of the last generation."""
        fps = int((self.num_timesteps - self._num_timesteps_at_start) / self._seconds())
        values: dict[str, Any] = {
            **self._generation_values,
            "time/fps": fps,
            "time/generations": self.generation,
            "time/total_timesteps": self.num_timesteps,
        }
        values |= {f"coverage/{name}": share for name, share in self.coverage_shares.items()}
        if self.n_workers is not None:
            values["time/workers"] = self.n_workers
        for key, value in values.items():
            self.logger.record(key, value)
        self.logger.dump(self.num_timesteps)

    def set_parameters(
        self,
        load_path_or_dict: str | TensorDict,
        exact_match: bool = True,
        device: th.device | str = "auto",
    ) -> None:
        """Take over parameters, the state of the search with them.

        Given a policy without the state of a search, with `exact_match=False`, the search goes on
        from that policy: an evolution strategy's center moves there, an archive that is still empty
        is filled from there. The best policy found so far is kept.

        Args:
            load_path_or_dict: A model's file, or what `get_parameters` gave, or a part of it.
            exact_match: Whether all parts must be there.
            device: As in SB3.

        Raises:
            ValueError: If parts are missing, or unknown; if the policy has another number of
                parameters, or they are not finite; if it is given without a search that has no use
                for it: archives have parents of their own once they hold elites. Nothing has
                changed then.
        """
        parameters = read_parameters(load_path_or_dict, device)
        check_names(parameters, self._get_torch_save_params()[0], exact_match=exact_match)
        if "policy" in parameters:
            flat = self._checked(parameters["policy"])
            if parameters.keys() <= _BESIDE_THE_SEARCH and not exact_match:
                self._begin_at(flat)
        super().set_parameters(parameters, exact_match, device)

    def _checked(self, state: Any) -> Float32Array:
        """The parameters in the state of a policy, shape (n_parameters,).

        Raises:
            ValueError: If there are others, or they are NaN or infinite.
        """
        flat, n_parameters = state.get("flat"), self.policy.mlp.n_parameters
        if np.shape(flat) != (n_parameters,):  # None has a shape, ()
            raise ValueError(f"`policy` must have `flat`, its {n_parameters} parameters.")
        checked = th.as_tensor(flat).cpu().numpy().astype(np.float32)  # a copy
        if not np.isfinite(checked).all():
            raise ValueError("`policy` must have finite parameters.")
        return checked

    # -- save and load --------------------------------------------------------------------------

    def _get_torch_save_params(self) -> tuple[list[str], list[str]]:
        # What is not named here, `load` would leave as it was made anew.
        return ["policy", *stateful_parts(self)], []

    def _excluded_save_params(self) -> list[str]:
        # A generation begins episodes and log anew: what was seen last is of no use.
        seen = ["_last_obs", "_last_original_obs", "_last_episode_starts"]
        seen += ["_generation_values", "_intrinsic"]
        return [*super()._excluded_save_params(), "evaluator", "_evaluator_choice", *seen]

    def save(
        self,
        path: str | os.PathLike[str] | io.BufferedIOBase,
        exclude: Iterable[str] | None = None,
        include: Iterable[str] | None = None,
    ) -> None:
        """Save everything that a run needs to go on bit for bit.

        The file takes the place of an older one only once it is wholly on disk. Settings are JSON
        and arrays; objects of your own, such as a policy's class, are written with cloudpickle.

        Args:
            path: Of the file; `.zip` is added where it has no suffix.
            exclude: Names to leave out; "buffer" leaves out the bonus' transitions.
            include: Names to save although they are left out by default.

        Raises:
            OSError: If it cannot be written; an older file is then as it was.
        """
        aliases = {policy: name for name, policy in self.policy_aliases.items()}
        policy = aliases.get(self.policy_class, self.policy_class)
        save_model(self, path, exclude, include, plain=True, policy_class=policy)

    @classmethod
    def load(
        cls,
        path: str | os.PathLike[str] | io.BufferedIOBase,
        env: AnyEnv | None = None,
        device: th.device | str = "auto",
        custom_objects: dict[str, Any] | None = None,
        print_system_info: bool = False,
        force_reset: bool = True,
        *,
        allow_pickle: bool = False,
        **kwargs: Any,
    ) -> Self:
        """Load a model, without running code that the file holds.

        Args:
            path: Of the file; `.zip` may be left out.
            env: As in the constructor; None: the model can predict, and learn after `set_env`.
            device: As in the constructor.
            custom_objects: By name, what to take in place of the attributes in the file.
            print_system_info: As in SB3.
            force_reset: As in SB3.
            allow_pickle: Also read objects of classes that are not of this package, which can run
                any code: only for files that you trust.
            **kwargs: Other names replace the model's attributes, objects that the file could only
                hold with cloudpickle among them (`policy=MyPolicy`, `bonus=my_bonus`), and
                `evaluator`, which no file holds. `seed` begins every random draw anew, see
                `set_random_seed`; without it they go on.

        Raises:
            FileNotFoundError: If there is no such file.
            ValueError: If the file is truncated, or no model of this class; if it holds objects
                that are not given here; if a keyword would replace a setting that what is in the
                file was made with.
            RuntimeError: If a `bonus` given here is made in another way than the one saved.
        """
        name = cls.__name__
        file = check_is_checkpoint(path, name)
        env = open_env(env)
        # rl-zoo3 puts 0 for learning rates, as schedules may not be readable; ours are numbers.
        custom = {k: v for k, v in (custom_objects or {}).items() if k != "learning_rate"}
        if "policy" in kwargs:
            custom["policy_class"] = kwargs.pop("policy")
        if "evaluator" in kwargs:
            kwargs["_evaluator_choice"] = kwargs.pop("evaluator")
        given = custom | kwargs
        check_seed(given.get("seed"))
        for fixed in sorted(cls._fixed_settings() & given.keys() - pickled_attributes(file)):
            raise ValueError(f"`{fixed}` must be left as it was saved: make a new {name}.")
        attributes = read_attributes(file, name, given, allow_pickle=allow_pickle)
        if isinstance(attributes.get("policy_class"), str):
            attributes["policy_class"] = cls._policy_of(attributes["policy_class"])
        data, parameters = read_model(file, name, device, attributes, print_system_info)
        data |= kwargs
        given_parts = data.get("_given")
        if not isinstance(given_parts, dict):
            raise ValueError(f"`path` must be a saved {name}, {file} is damaged.")
        if env is not None and given_parts.get("evaluator") and "_evaluator_choice" not in data:
            raise ValueError(
                '`evaluator` must be given to `load`, or "auto": the saved model had one, '
                f"{given_parts['evaluator'][0]}."
            )
        model = build_model(cls, data, parameters, env, device, force_reset)
        model._go_on(data)
        model.set_random_seed(given.get("seed"))
        return model

    def _go_on(self, read: Mapping[str, Any]) -> None:
        """Take over from what a file said what `_setup_model` has begun anew."""
        self._put_back(read)
        best = self._best_parameters
        if best is not None and np.shape(best) != self.policy.vector.shape:
            raise ValueError(f"`path` must be a saved {type(self).__name__}, it is damaged.")
        if self.env is not None:
            self._match_env(self.env)
        self._show_best()

    def _put_back(self, read: Mapping[str, Any]) -> None:
        """Set the plain values that `_setup_model` has begun anew to those that were `read`."""
        parts = {name.partition(".")[0] for name in self._get_torch_save_params()[0]}
        for name in read.keys() - parts - set(self._excluded_save_params()):
            current, value = vars(self).get(name), read[name]
            if isinstance(current, np.random.Generator) and isinstance(value, np.random.Generator):
                current.bit_generator.state = value.bit_generator.state  # parts may draw from it
            else:
                vars(self)[name] = value

    @classmethod
    def _policy_of(cls, alias: str) -> type[BasePolicy]:
        check_choice(tuple(cls.policy_aliases), policy=alias)
        return cls.policy_aliases[alias]

    @classmethod
    def _fixed_settings(cls) -> set[str]:
        """Settings that `load` cannot replace."""
        return {"preset"}
