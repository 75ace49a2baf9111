"""The policy of a population algorithm, the parts around it, and the file that holds them."""

from __future__ import annotations

import io
import pathlib
from abc import abstractmethod
from collections.abc import Mapping, Set
from typing import Any, ClassVar

import numpy as np
import torch as th
from stable_baselines3.common.type_aliases import TensorDict

from curiosity_algos.checkpoints.model_file import read_attributes, read_model
from curiosity_algos.common.arrays import Float32Array
from curiosity_algos.evaluation.base import Evaluator
from curiosity_algos.evaluation.episodes import Firsts
from curiosity_algos.evaluation.policies import MlpPolicy
from curiosity_algos.sb3.resumable import Resumable
from curiosity_gym.validation import check_choice

_BESIDE_THE_SEARCH = {"policy", "_coverage", "_episodes", "_firsts", "_fitness", "_motivation"}
"""Names of parts that do not say where a search stands."""


class PopulationModel(Resumable):
    """A policy with a search around it, in a file that is read without running code."""

    policy: MlpPolicy
    evaluator: Evaluator | None
    _evaluator_choice: Evaluator | str
    _best_parameters: Float32Array | None
    _firsts: Firsts
    _attributes: ClassVar = {
        "policy": "policy_class",
        "evaluator": "_evaluator_choice",
        "archive": "_own_archive",
    }
    _user_parts: dict[str, list[str]]
    """By argument, the kinds of parts that the user passed; no file holds them."""

    @property
    def first_reward_timesteps(self) -> int | None:
        """Timesteps when an individual first had a return above 0, or None."""
        return self._firsts.reward

    @property
    def first_success_timesteps(self) -> int | None:
        """Timesteps when an individual first succeeded, or None."""
        return self._firsts.success

    @abstractmethod
    def _show_best(self) -> None:
        """Let `predict` act with the best policy."""

    def _settings_of_parts(self) -> set[str]:
        return super()._settings_of_parts() | {"n_threads"}

    def _begin_at(self, parameters: Float32Array) -> None:
        """Search on from these parameters, shape (n_parameters,), where an algorithm can."""
        raise ValueError(f"`policy` cannot be set alone: {type(self).__name__} begins nowhere.")

    def _check_user_parts(self, name: str, kinds: list[str]) -> None:
        """Raise ValueError unless the user passes parts of the kinds that the saved model had."""
        expected = self._user_parts.setdefault(name, kinds)
        if kinds != expected:
            raise ValueError(
                f"`{name}` must be passed to `load` as it was to the saved model: "
                f"{', '.join(expected) or 'none'}, got {', '.join(kinds) or 'none'}."
            )

    def _prepare_for(self, parameters: TensorDict, exact_match: bool) -> None:
        if "policy" in parameters:
            flat = self._checked(parameters["policy"])
            if parameters.keys() <= _BESIDE_THE_SEARCH and not exact_match:
                self._begin_at(flat)

    def _checked(self, state: Any) -> Float32Array:
        """The parameters in the state of a policy, shape (n_parameters,), finite."""
        flat, n_parameters = state.get("flat"), self.policy.mlp.n_parameters
        if np.shape(flat) != (n_parameters,):  # None has a shape, ()
            raise ValueError(f"`policy` must have `flat`, its {n_parameters} parameters.")
        checked = th.as_tensor(flat).cpu().numpy().astype(np.float32)  # a copy
        if not np.isfinite(checked).all():
            raise ValueError("`policy` must have finite parameters.")
        return checked

    # -- save and load --------------------------------------------------------------------------

    def _excluded_save_params(self) -> list[str]:
        # A generation begins episodes and log anew: what was seen last is of no use.
        seen = ["_last_obs", "_last_original_obs", "_last_episode_starts"]
        seen += ["_generation_values", "_intrinsic"]
        return [*super()._excluded_save_params(), "evaluator", "_evaluator_choice", *seen]

    def _saved_instead(self, exclude: Set[str]) -> dict[str, Any]:
        aliases = {policy: name for name, policy in self.policy_aliases.items()}
        policy = aliases.get(self.policy_class, self.policy_class)
        return {"plain": True, "policy_class": policy}

    @classmethod
    def _read(
        cls,
        file: pathlib.Path | io.BufferedIOBase,
        env: Any,
        custom_objects: dict[str, Any] | None,
        print_system_info: bool,
        given: dict[str, Any],
    ) -> tuple[dict[str, Any], TensorDict]:
        name, allow_pickle = cls.__name__, given.pop("allow_pickle")
        # rl-zoo3 puts 0 for learning rates, as schedules may not be readable; ours are numbers.
        custom = {k: v for k, v in (custom_objects or {}).items() if k != "learning_rate"}
        attributes = read_attributes(
            file, name, custom | given, fixed=cls._fixed_settings(), allow_pickle=allow_pickle
        )
        if isinstance(policy := attributes.get("policy_class"), str):
            check_choice(tuple(cls.policy_aliases), policy=policy)
            attributes["policy_class"] = cls.policy_aliases[policy]
        data, parameters = read_model(file, name, attributes, print_system_info)
        had = data["_user_parts"].get("evaluator")
        if env is not None and had and "_evaluator_choice" not in given:
            raise ValueError(
                '`evaluator` must be given to `load`, or "auto": the saved model had one, '
                f"{had[0]}."
            )
        return given | data, parameters

    def _go_on(self, read: Mapping[str, Any]) -> None:
        self._put_back(read)
        best = self._best_parameters
        if best is not None and np.shape(best) != self.policy.vector.shape:
            raise ValueError(f"`path` must be a saved {type(self).__name__}, it is damaged.")
        super()._go_on(read)
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
