"""A policy with a search around it: its environment, its seed, and the file that holds it."""

from __future__ import annotations

import inspect
import io
import os
from abc import abstractmethod
from collections.abc import Iterable, Mapping
from typing import Any, ClassVar, Self

import numpy as np
import torch as th
from gymnasium import spaces
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.type_aliases import TensorDict
from stable_baselines3.common.utils import get_system_info
from stable_baselines3.common.vec_env import VecEnv

from curiosity_algos.common.presets import preset_settings
from curiosity_algos.common.randomness import reseed
from curiosity_algos.evaluation.arguments import check_keywords_known
from curiosity_algos.evaluation.base import Evaluator, Player
from curiosity_algos.evaluation.coverage import (
    BestPolicy,
    Coverage,
    Firsts,
    behavior_space,
    coverage_grid,
)
from curiosity_algos.evaluation.environments import (
    EnvObject,
    FactoryVecEnv,
    env_id,
    env_name,
    open_env,
)
from curiosity_algos.evaluation.evaluator import AnyEnv, as_played, known_task, make_evaluator
from curiosity_algos.evaluation.policies import MlpPolicy
from curiosity_algos.loops.declared import Setting, name_in_presets, take_declared, whole_signature
from curiosity_algos.loops.model_file import (
    NO_SETTINGS,
    OF_DAMAGE,
    load_state,
    make_model,
    model_path,
    read_settings,
    settings_for_file,
    state_of,
)
from curiosity_algos.state.check import check_keys, check_like
from curiosity_algos.state.file import read, save
from curiosity_algos.state.settings import HasSettings
from curiosity_algos.state.tree import State
from curiosity_gym.core import CoverageGrid
from curiosity_gym.validation import check_choice, check_seed

TRANSITIONS = {"buffer", "replay_buffer"}
"""Names to exclude what a motivation has collected, ours and Stable-Baselines3's."""


class PopulationModel(HasSettings, BaseAlgorithm):
    """What population algorithms have beside their loop.

    Classes declare their settings, see `curiosity_algos.loops.declared`; a constructor of its own
    passes all others on as `**kwargs`.

    Attributes:
        preset: Name of the preset that the model was made from, or None.
    """

    preset: str | None
    policy: MlpPolicy
    evaluator: Player | None
    _evaluator_choice: Evaluator | str
    n_threads: int | None
    __signature__: ClassVar[inspect.Signature]
    _declared: ClassVar[dict[str, Setting]]
    """The settings that a class and those that it extends declare."""
    _own_settings: ClassVar[dict[str, Setting]]
    """Those that it declares itself."""
    _attributes: ClassVar[dict[str, str]] = {
        **{"policy": "policy_class", "evaluator": "_evaluator_choice", "archive": "_own_archive"},
    }
    """By argument of the constructor, the attribute of another name that it is kept in."""
    _progress: ClassVar[tuple[str, ...]] = (
        *("num_timesteps", "_total_timesteps", "_num_timesteps_at_start", "generation"),
        *("_current_progress_remaining", "_lacks_transitions", "_episode_seed"),
    )
    """Attributes of plain values that a run goes on from."""
    _arguments: dict[str, Any]
    """What the constructor was called with."""
    _coverage_grid: CoverageGrid | None
    _behavior_space: spaces.Box[Any] | None
    _lacks_transitions = False
    """Whether the file that the model was read from has left them out."""
    _coverage: Coverage
    _firsts: Firsts
    _best: BestPolicy
    _episode_seeds: np.random.Generator
    """Draws the seed of each generation's episodes, which all individuals share."""

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        cls._declared = take_declared(cls)
        cls._checks = {name: one.check for name, one in cls._declared.items() if one.check}
        cls.__signature__ = whole_signature(cls, PopulationModel)

    def __new__(cls, *args: Any, **kwargs: Any) -> Self:
        """Remember what the constructor is called with, which `load` calls it with again."""
        model = super().__new__(cls)
        arguments = dict(zip(inspect.signature(cls).parameters, args, strict=False)) | kwargs
        named = {name: value for name, value in arguments.items() if name not in NO_SETTINGS}
        vars(model)["_arguments"] = named
        return model

    def __repr__(self) -> str:
        place = "without an environment" if self.env is None else f"on {env_name(self.env)}"
        best = getattr(self, "best_return", -np.inf)  # before the parts are made there is none
        with_best = f", best return {best:.3f}" if np.isfinite(best) else ""
        return f"<{type(self).__name__} {place}: {self.num_timesteps:,} timesteps{with_best}>"

    @classmethod
    def from_preset(cls, preset: str, env: AnyEnv, **overrides: Any) -> Self:
        """Make a model with the settings of a preset: `CuriosityES.from_preset("paper", env)`.

        Args:
            preset: "paper" or "tuned", see `load_preset`.
            env: As in the constructor, made by an id that the preset knows.
            **overrides: Keywords of the constructor that count more than the preset's, entry by
                entry of a dictionary. With another `bonus` go the preset's `bonus_kwargs`.

        Raises:
            ValueError: If there is no such preset, or it has no settings of the algorithm for the
                environment.
        """
        settings = preset_settings(preset, name_in_presets(cls), env_id(env), overrides)
        model = cls(env, **settings)
        vars(model)["preset"] = preset
        return model

    def _parts(self) -> dict[str, Any]:
        """What has a state, by name: objects with `state_dict`, and numpy's generators."""
        return {
            "policy": self.policy,
            "coverage": self._coverage,
            "episodes": self._episode_seeds,
            "firsts": self._firsts,
            "best": self._best,
        }

    @classmethod
    def _fixed(cls) -> set[str]:
        """Settings that the state in a file was made with, which `load` cannot replace."""
        return {"policy_kwargs"} | {name for name, one in cls._declared.items() if one.fixed}

    def _check_behaviors(self, space: spaces.Box[Any] | None) -> None:
        """Raise ValueError where the algorithm has no use for such behaviors of an env."""

    def _forget_behaviors(self) -> None:
        """Drop archives and the like that hold behaviors of another environment."""

    @abstractmethod
    def _show_best(self) -> None:
        """Let `predict` act with the best policy."""

    def _choose_evaluator(self, choice: Evaluator | str, env: EnvObject) -> Player:
        """The evaluator that an argument `evaluator` asks for; ValueError if it does not fit."""
        if isinstance(choice, str):
            check_choice(("auto", "ray"), evaluator=choice)
            if choice == "auto":
                return make_evaluator(env, self.policy_kwargs, self.n_threads)
            # Not above: few have it installed.
            from curiosity_algos.evaluation.ray import RayEvaluator

            return RayEvaluator(env, self.policy_kwargs)
        wanted = self.policy.mlp.n_parameters
        own = choice.n_parameters if isinstance(choice, Evaluator) else None
        if own != wanted:
            raise ValueError(
                f'`evaluator` must be "auto", "ray" or an Evaluator ({Evaluator.__module__}) of '
                f"the policy's {wanted} parameters, got {choice!r} of {own}."
            )
        if isinstance(env, FactoryVecEnv):  # whose environment it has never seen
            env.others_play = True
        return choice

    def _follow_env(self) -> None:
        """Take a new evaluator if the maze, task or robot has changed since it was made."""
        env, evaluator = self.env, self.evaluator
        assert env is not None
        assert evaluator is not None
        if not isinstance(self._evaluator_choice, str):
            return
        known = (evaluator.local or evaluator).known
        now = known_task(as_played(env))
        if now is None if known is None else known.is_same(now):
            return
        # It plays alone: others of its id or function lack the change.
        played = as_played(env) if now is None else env
        self.evaluator = self._choose_evaluator(self._evaluator_choice, played)

    def _see_env(self, env: VecEnv | None) -> None:
        """Remember the behaviors of an env, and the cells that coverage counts there."""
        self._coverage_grid = None if env is None else coverage_grid(env)
        self._behavior_space = None if env is None else behavior_space(env)

    def _counts_others(self, env: VecEnv) -> bool:
        """Whether behaviors in `env`, or the cells that coverage counts, are others than here."""
        grid, space = coverage_grid(env), behavior_space(env)
        return grid != self._coverage_grid or space != self._behavior_space

    def _match_env(self, env: VecEnv) -> None:
        """Count in the grid of `env`; in another one, forget what was found before."""
        self._check_behaviors(behavior_space(env))
        if self._counts_others(env):
            self._see_env(env)
            self._begin_anew()

    def _begin_anew(self) -> None:
        """Forget what was found in the environment before."""
        self._begin_records()
        self._forget_behaviors()
        self._show_best()

    def _begin_records(self) -> None:
        """Begin coverage, the best policy and the first reward and success anew."""
        self._coverage = Coverage(self._coverage_grid)
        self._firsts = Firsts()
        self._best = BestPolicy(self.policy.mlp.n_parameters)

    @property
    def coverage(self) -> float | None:
        """Share of the reachable cells in which episodes ended; None where there are no cells.

        `coverage_shares["visited"]` is that of the cells in which any step ended.
        """
        return self._coverage.reachable

    @property
    def coverage_shares(self) -> dict[str, float]:
        """Every share that is logged under `coverage/`, by its name there."""
        return self._coverage.shares

    @property
    def first_reward_timesteps(self) -> int | None:
        """Timesteps when an individual first had a return above 0, or None."""
        return self._firsts.reward

    @property
    def first_success_timesteps(self) -> int | None:
        """Timesteps when an individual first succeeded, or None."""
        return self._firsts.success

    def set_random_seed(self, seed: int | None = None) -> None:
        """Begin every random draw of the run anew: those of its parts, of env and actions.

        The process' global generators stay as they are. None seeds nothing.
        """
        check_seed(seed)
        if seed is None:
            return
        reseed(self._parts().values(), np.random.SeedSequence(seed))
        self.action_space.seed(int(seed))
        if self.env is not None:
            self.env.seed(int(seed))

    def get_parameters(self) -> dict[str, dict[str, Any]]:
        """The states of all parts, by the names of these."""
        return {name: state_of(part) for name, part in self._parts().items()}

    def set_parameters(
        self,
        load_path_or_dict: str | TensorDict,
        exact_match: bool = True,
        device: th.device | str = "auto",
    ) -> None:
        """Take over the states of parts.

        Args:
            load_path_or_dict: A model's file, or what `get_parameters` gave, or a part of it.
            exact_match: Whether all parts must be there.
            device: Unused.

        Raises:
            ValueError: If parts are missing, unknown or of another model; if there is a policy
                without the search's state.
        """
        parts = self._parts()
        parameters: Any = load_path_or_dict
        if not isinstance(load_path_or_dict, Mapping):
            _, parameters = read(model_path(load_path_or_dict), type(self).__name__)
            del parameters["progress"]
        check_keys(parameters, parts if exact_match else parts.keys() & parameters, "parameters")
        searches = parts.keys() & {"search", "archive"}
        if "policy" in parameters and searches and not searches & parameters.keys():
            raise ValueError(f"`policy` must come with `{searches.pop()}`, which makes the next.")
        for name, part in parts.items():
            if name in parameters:
                load_state(part, parameters[name])

    def _settings(self) -> dict[str, Any]:
        """The keywords of the constructor with their values in force."""
        names = {**dict.fromkeys(inspect.signature(type(self)).parameters), **self._arguments}
        kept = {name: self._attributes.get(name, name) for name in names if name not in NO_SETTINGS}
        settings = {
            name: vars(self).get(attribute, self._arguments.get(name))
            for name, attribute in kept.items()
            if attribute in vars(self) or name in self._arguments
        }
        aliases: dict[Any, str] = {policy: name for name, policy in self.policy_aliases.items()}
        policy = settings["policy"]
        return settings | {"policy": aliases.get(policy, policy), "preset": self.preset}

    def save(
        self,
        path: str | os.PathLike[str] | io.BufferedIOBase,
        exclude: Iterable[str] | None = None,
        include: Iterable[str] | None = None,
    ) -> None:
        """Save everything that a run needs to go on bit for bit.

        Objects that the constructor was given, such as a `bonus`, `search`, `archive` or class of
        policies, are given to `load` again.

        Args:
            path: Of the file; `.zip` is added where it has no suffix.
            exclude: "buffer" leaves out the transitions that were collected; a run that goes on
                without them is another one, and `learn` warns.
            include: Unused.

        Raises:
            OSError: If it cannot be written; an older file is then as it was.
            ValueError: If a part has a state that no file can hold.
        """
        progress = {name: getattr(self, name) for name in self._progress}
        state: State = {**self.get_parameters(), "progress": progress}
        if TRANSITIONS & set(exclude or ()):
            holders = [k for k in self._parts() if isinstance(state[k].get("buffer"), Mapping)]
            for name in holders:
                state[name] = {k: value for k, value in state[name].items() if k != "buffer"}
            progress["_lacks_transitions"] |= bool(holders)
        kind, settings = type(self).__name__, settings_for_file(self)
        save(model_path(path, is_read=False), kind, settings, state)

    @classmethod
    def load(
        cls,
        path: str | os.PathLike[str] | io.BufferedIOBase,
        env: AnyEnv | None = None,
        device: th.device | str = "auto",
        custom_objects: dict[str, Any] | None = None,
        print_system_info: bool = False,
        force_reset: bool = True,
        **kwargs: Any,
    ) -> Self:
        """Load a model: make it with the settings in its file, and bring it to the state there.

        No code in a file runs.

        Args:
            path: Of the file; `.zip` may be left out.
            env: As in the constructor; None: the model can predict, and learn after `set_env`.
            device: As in the constructor.
            custom_objects: Further `kwargs`, of which `learning_rate` and unknown ones are left
                out: rl-zoo3 passes stand-ins.
            print_system_info: As in SB3.
            force_reset: Unused.
            **kwargs: Keywords of the constructor that count more than those in the file, and the
                objects that it was given; an `archive` gets the elites in the file. `seed` begins
                every random draw anew.

        Raises:
            FileNotFoundError: If there is no such file.
            ValueError: If the file is no whole model of this class, an object is missing, or a
                keyword would replace a setting that the state was made with.
            TypeError: If a keyword is not the constructor's.
        """
        if print_system_info:
            get_system_info()
        file = model_path(path)
        content, state = read(file, cls.__name__)
        settings = read_settings(content, file, cls)
        known = inspect.signature(cls).parameters.keys() - NO_SETTINGS
        custom = {k: v for k, v in (custom_objects or {}).items() if k in known - {"learning_rate"}}
        overrides = custom | kwargs
        check_keywords_known(cls, sorted(overrides.keys() - known))
        check_seed(overrides.get("seed"))
        env = None if env is None else open_env(env)
        model: Self = make_model(cls, settings, env, device, overrides)
        own = {name: getattr(model, name) for name in cls._progress}
        try:
            check_keys(state, [*model._parts(), "progress"])
            check_like(progress := state.pop("progress"), own, "progress")
            model.set_parameters(state)
            vars(model).update(progress)
        except OF_DAMAGE as error:
            message = f"`path` must be a saved {cls.__name__}, {file}: {error}"
            raise ValueError(message) from error
        if model.env is not None:
            model._match_env(model.env)
        model._show_best()
        model.set_random_seed(overrides.get("seed"))
        return model
