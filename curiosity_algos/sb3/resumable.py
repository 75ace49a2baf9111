"""Every algorithm's own beside Stable-Baselines3's: any env, coverage, exact files."""

from __future__ import annotations

import inspect
import io
import os
import pathlib
import warnings
from abc import abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Set
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Any, ClassVar, Self

import numpy as np
import torch as th
from gymnasium import spaces
from gymnasium.vector import VectorEnv
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.type_aliases import GymEnv, TensorDict
from stable_baselines3.common.vec_env import VecEnv

from curiosity_algos.checkpoints.model_file import (
    check_is_checkpoint,
    check_left,
    read_model,
    save_model,
    saved_names,
)
from curiosity_algos.checkpoints.parts import build_model, load_parts, read_parts, stateful_parts
from curiosity_algos.checkpoints.settings import HasSettings
from curiosity_algos.common.presets import preset_settings
from curiosity_algos.common.randomness import AnyGenerator, reseed
from curiosity_algos.common.sole_learner import sole_learner
from curiosity_algos.evaluation.arguments import check_keywords_known
from curiosity_algos.evaluation.coverage import Coverage, behavior_space, coverage_grid
from curiosity_algos.evaluation.environments import (
    GymnasiumView,
    env_id,
    env_name,
    open_env,
)
from curiosity_algos.evaluation.evaluator import AnyEnv
from curiosity_gym.core import CoverageGrid
from curiosity_gym.validation import check_seed


class Resumable(HasSettings, BaseAlgorithm):
    """An algorithm whose environment, seed and files are handled alike, whatever it learns by.

    A subclass calls `_see_env` once it has its env, and says what it counts (`_counted`) and how it
    begins that anew (`_forget_found`). Constructors write their own keywords and pass the others on
    as `**kwargs`: a class' signature shows them all, each as the class nearest to it has it.

    A setting is an attribute of its keyword's name. Callbacks may set it: what is in force is what
    it says, and assigning one that parts were made with is an error.

    Attributes:
        preset: Name of the preset that the model was made from, or None.
    """

    preset: str | None = None
    _attributes: ClassVar[dict[str, str]] = {"policy": "policy_class"}
    """By argument of the constructor, the attribute of another name that it is kept in."""
    __signature__: ClassVar[inspect.Signature]
    _coverage_grid: CoverageGrid | None
    _behavior_space: spaces.Box[Any] | None
    _lacks_transitions = False
    """Whether the file that the model was read from has left them out."""

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        cls.__signature__ = inspect.Signature(_all_parameters(cls))

    def __repr__(self) -> str:
        place = "without an environment" if self.env is None else f"on {env_name(self.env)}"
        best = getattr(self, "best_return", -np.inf)  # a subclass', which may not be there yet
        found = f", best return {best:.3f}" if np.isfinite(best) else ""
        return f"<{type(self).__name__} {place}: {self.num_timesteps:,} timesteps{found}>"

    @classmethod
    def from_preset(cls, preset: str, env: AnyEnv, **overrides: Any) -> Self:
        """Make a model with the settings of a preset: `CuriosityES.from_preset("paper", env)`.

        Args:
            preset: "paper" (its table 1) or "tuned", see `load_preset`.
            env: As in the constructor, made by an id that the preset knows.
            **overrides: Keywords of the constructor that count more than the preset's. Of a
                dictionary each entry does; with another `bonus` the preset's `bonus_kwargs` do not
                count at all.

        Raises:
            ValueError: If there is no such preset, or it has no settings of the algorithm for the
                environment.
        """
        settings = preset_settings(preset, _known_name(cls), env_id(env), overrides)
        model = cls(env, **settings)  # type: ignore[arg-type]  # ours come first
        vars(model)["preset"] = preset
        return model

    # -- settings -------------------------------------------------------------------------------

    @classmethod
    def _fixed_settings(cls) -> set[str]:
        """Settings that the states in a file were made with, which `load` cannot replace."""
        return {"policy_kwargs", "preset"}

    def _settings_of_parts(self) -> set[str]:
        """Settings that parts were made with; where `load` takes others, it makes them anew."""
        return self._fixed_settings() | {"seed", "device"}

    def _way_on(self, name: str) -> str:
        way_on = super()._way_on(name)
        return way_on if name in self._fixed_settings() else f"give `load` another, or {way_on}"

    @abstractmethod
    def _counted(self) -> Coverage:
        """The coverage so far."""

    @abstractmethod
    def _forget_found(self) -> None:
        """Drop what was found in another environment, coverage first."""

    @contextmanager
    def _learning(self) -> Iterator[None]:
        """Learn alone in the process; say so if what was collected before is lost."""
        with sole_learner():
            if self._lacks_transitions:
                warnings.warn(
                    "The file of this model was saved without its buffer, which begins empty: what "
                    "is learned from here on is not what an uninterrupted run would have learned.",
                    stacklevel=4,
                )
                self._lacks_transitions = False
            yield

    # -- the environment ------------------------------------------------------------------------

    @classmethod
    def _open_env(cls, env: Any) -> Any:
        """The environment of an id, anything else as it is, if the algorithm has a use for it."""
        return open_env(env)

    @staticmethod
    def _wrap_env(env: Any, verbose: int = 0, monitor_wrapper: bool = True) -> VecEnv:
        if isinstance(env, VectorEnv):
            return GymnasiumView(env)
        return BaseAlgorithm._wrap_env(env, verbose, monitor_wrapper)

    def set_env(self, env: GymEnv, force_reset: bool = True) -> None:
        """Train on another environment with the same spaces.

        Where coverage counts other cells than before, as in another maze, coverage, the best return
        and the first success start anew; what has been learned goes on.

        Args:
            env: As in the constructor.
            force_reset: As in SB3.

        Raises:
            ValueError: If the spaces are others, or the env is not supported.
        """
        super().set_env(self._open_env(env), force_reset)
        assert self.env is not None
        self._match_env(self.env)

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
        if self._counts_others(env):
            self._see_env(env)
            self._forget_found()

    @property
    def coverage(self) -> float | None:
        """Share of the reachable cells in which episodes ended; None where there are no cells.

        `coverage_shares["visited"]` is that of the cells in which any step ended.
        """
        return self._counted().reachable

    @property
    def coverage_shares(self) -> dict[str, float]:
        """Every share that is logged under `coverage/`, by its name there."""
        return self._counted().shares

    # -- randomness -----------------------------------------------------------------------------

    def set_random_seed(self, seed: int | None = None) -> None:
        """Begin every random draw of the run anew: those of its parts, of env and actions.

        Unlike in SB3 the global generators of the process stay as they are.

        Args:
            seed: None: nothing is seeded.

        Raises:
            ValueError: If it is no whole number of at least 0.
        """
        check_seed(seed)
        if seed is None:
            return
        reseed(self._random_parts(), np.random.SeedSequence(seed))
        self.action_space.seed(int(seed))
        if self.env is not None:
            self.env.seed(int(seed))

    def _random_parts(self) -> list[object]:
        """The holders of the run's generators."""
        names = [name.partition(".")[0] for name in self._get_torch_save_params()[0]]
        parts = [getattr(self, name) for name in names]
        return parts + [each for each in vars(self).values() if isinstance(each, AnyGenerator)]

    # -- parameters and files -------------------------------------------------------------------

    def _excluded_save_params(self) -> list[str]:
        return [*super()._excluded_save_params(), "_settled"]

    def _get_torch_save_params(self) -> tuple[list[str], list[str]]:
        # What is not named here, `load` would leave as it was made anew.
        names, variables = super()._get_torch_save_params()
        return [*names, *stateful_parts(self)], variables

    def set_parameters(
        self,
        load_path_or_dict: str | TensorDict,
        exact_match: bool = True,
        device: th.device | str = "auto",
    ) -> None:
        """Take over parameters, the state of a search with them.

        Given a policy without the state of a search, with `exact_match=False`, a population's
        search goes on from that policy: an evolution strategy's center moves there, an archive that
        is still empty is filled from there. The best policy found so far is kept.

        Args:
            load_path_or_dict: A model's file, or what `get_parameters` gave, or a part of it.
            exact_match: Whether all parts must be there.
            device: Unused, states are copied to where the parts are.

        Raises:
            ValueError: If parts are missing, or unknown; of a population, if the policy has another
                number of parameters, or they are not finite; if it is given without a search that
                has no use for it: archives have parents of their own once they hold elites. Nothing
                has changed then.
        """
        parameters = read_parts(self, load_path_or_dict, exact_match)
        self._prepare_for(parameters, exact_match)
        load_parts(self, parameters, exact_match)

    def save(
        self,
        path: str | os.PathLike[str] | io.BufferedIOBase,
        exclude: Iterable[str] | None = None,
        include: Iterable[str] | None = None,
    ) -> None:
        """Save everything that a run needs to go on bit for bit, replay buffers too.

        The file takes the place of an older one only once it is wholly on disk. That of a
        population algorithm holds JSON and arrays; objects of your own in it, such as a policy's
        class, are written with cloudpickle. TD3's episode that has not ended goes on after `load`
        where the env can say where it stands, as those of `curiosity_gym` can; elsewhere a new one
        begins.

        Args:
            path: Of the file; `.zip` is added where it has no suffix.
            exclude: Names to leave out; "buffer" leaves out transitions, and a run that goes on
                without them is another one: `learn` warns.
            include: Names to save although they are left out by default.

        Raises:
            OSError: If it cannot be written; an older file is then as it was.
        """
        exclude = set(exclude or ())
        save_model(self, path, exclude, include, **self._saved_instead(exclude))

    @abstractmethod
    def _saved_instead(self, exclude: Set[str]) -> dict[str, Any]:
        """Attributes to save in place of the model's own, and how `save_model` writes them."""

    def _prepare_for(self, parameters: TensorDict, exact_match: bool) -> None:
        """Check what is about to be taken over; nothing has changed if that raises."""

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
        """Load a model.

        Files of population algorithms are read without running code. Those of TD3ICM are read with
        cloudpickle, as in SB3, which runs whatever code they hold: load what you trust.

        Args:
            path: Of the file; `.zip` may be left out.
            env: As in the constructor; None: the model can predict, and learn after `set_env`.
            device: As in the constructor.
            custom_objects: By name, what to take in place of the attributes in the file.
            print_system_info: As in SB3.
            force_reset: As in SB3.
            allow_pickle: Of a population algorithm, also read objects of classes that are not of
                this package, which can run any code: only for files that you trust.
            **kwargs: `evaluator`, `search`, `archive` and `emitters` that the constructor was
                given, which no file holds: the elites in the file take the place of the archive's
                own. Other names replace the model's attributes, objects that a file holds with
                cloudpickle alone among them (`policy=MyPolicy`, `bonus=my_bonus`). `seed` begins
                every random draw anew, see `set_random_seed`; without it they go on.

        Raises:
            FileNotFoundError: If there is no such file.
            ValueError: If the file is truncated, or no model of this class; if it needs what is not
                given here, or a keyword would replace a setting that what is in the file was made
                with. An archive given here is then as it was.
            RuntimeError: If a `bonus` given here is made in another way than the one saved.
            TypeError: If a keyword is neither the constructor's nor in the file.
        """
        file = check_is_checkpoint(path, cls.__name__)
        if others := kwargs.keys() - inspect.signature(cls).parameters:
            check_keywords_known(cls, sorted(others - saved_names(file)))
        env = None if env is None else cls._open_env(env)
        seed = ((custom_objects or {}) | kwargs).get("seed")
        check_seed(seed)
        given = {cls._attributes.get(name, name): value for name, value in kwargs.items()}
        given["allow_pickle"] = allow_pickle
        data, parameters = cls._read(file, env, custom_objects, print_system_info, given)
        with cls._unchanged_on_error(data):
            model = build_model(cls, data, parameters, env, device, force_reset)
            model._go_on(data)
        model.set_random_seed(seed)
        return model

    @classmethod
    def _unchanged_on_error(cls, data: Mapping[str, Any]) -> AbstractContextManager[None]:
        """Leave the user's own among a model's attributes as they were if the block raises."""
        return nullcontext()

    @classmethod
    def _read(
        cls,
        file: pathlib.Path | io.BufferedIOBase,
        env: Any,
        custom_objects: dict[str, Any] | None,
        print_system_info: bool,
        given: dict[str, Any],
    ) -> tuple[dict[str, Any], TensorDict]:
        """A model's attributes, those that were given among them, and the states of its parts."""
        del given["allow_pickle"]
        data, parameters = read_model(file, cls.__name__, custom_objects, print_system_info)
        check_left(given, data, cls._fixed_settings(), cls.__name__)
        return data | given, parameters

    def _go_on(self, read: Mapping[str, Any]) -> None:
        """Take over from what a file said what `_setup_model` has begun anew."""
        if self.env is not None:
            self._match_env(self.env)


def _all_parameters(cls: type) -> list[inspect.Parameter]:
    """Parameters of the constructor, and of those that it passes keywords on to."""
    passed_on = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
    found: dict[str, inspect.Parameter] = {}
    for each in cls.__mro__[: cls.__mro__.index(Resumable)]:
        if "__init__" not in vars(each):
            continue
        _, *own = inspect.signature(vars(each)["__init__"]).parameters.values()
        shown = [one for one in own if one.kind not in passed_on and one.name[0] != "_"]
        if found:  # the constructors before pass keywords on, and nothing else
            shown = [parameter.replace(kind=parameter.KEYWORD_ONLY) for parameter in shown]
        found |= {each.name: each for each in shown if each.name not in found}
        if not any(parameter.kind is parameter.VAR_KEYWORD for parameter in own):
            break
    return sorted(found.values(), key=lambda parameter: parameter.kind)


def _known_name(cls: type) -> str:
    """The name under which presets may know a class: its own, or of the algorithm it extends."""
    ours = "curiosity_algos.algorithms."
    return next((each for each in cls.__mro__ if each.__module__.startswith(ours)), cls).__name__
