"""Algorithms that Stable-Baselines3 trains as runs: their bonuses, models and policies."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import gymnasium as gym
from gymnasium import spaces
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm
from stable_baselines3.common.on_policy_algorithm import OnPolicyAlgorithm
from stable_baselines3.common.policies import BasePolicy
from stable_baselines3.common.preprocessing import is_image_space
from stable_baselines3.common.save_util import load_from_zip_file
from stable_baselines3.common.vec_env import VecEnv

from curiosity_algos.algorithms.td3_icm import TD3ICM
from curiosity_algos.bonuses.base import keyword_only
from curiosity_algos.bonuses.encoders import SMALLEST_NATURE
from curiosity_algos.bonuses.make import BONUSES, bonus_keywords
from curiosity_algos.common.names import find_known, plain_name
from curiosity_algos.common.networks import single_torch_thread
from curiosity_algos.curiosity.curiosity import CuriosityKeywords
from curiosity_algos.experiments.checkpoint_files import restore_under_way
from curiosity_algos.robust.imitation import Standardized
from curiosity_algos.sb3.bonus_wrapper import BonusVecEnvWrapper
from curiosity_algos.sb3.replay_buffer import BonusReplayBuffer


def is_baseline(cls: type[Any]) -> bool:
    """Whether Stable-Baselines3 trains an algorithm: its own, sb3-contrib's, and `TD3ICM`."""
    return issubclass(cls, OnPolicyAlgorithm | OffPolicyAlgorithm)


def is_foreign(cls: type[Any]) -> bool:
    """Whether an algorithm is of Stable-Baselines3 or sb3-contrib, and has no bonus by itself."""
    return is_baseline(cls) and not issubclass(cls, TD3ICM)


def find_bonus(name: str) -> str:
    """The known name of a bonus, in any spelling; ValueError if there is none."""
    return find_known("bonus", name, BONUSES, spelled=plain_name)


def _keywords(holder: type[Any], bonus: str, bonus_kwargs: Mapping[str, Any]) -> dict[str, Any]:
    """Keywords of what holds a bonus, among them the bonus and its own."""
    bonus = find_bonus(bonus)
    names = {*keyword_only(holder), *CuriosityKeywords.__optional_keys__}
    of_holder = names - {"bonus", "bonus_kwargs", "device", "seed"}
    for name in bonus_kwargs:
        find_known("bonus_kwargs", name, sorted(of_holder.union(bonus_keywords(bonus))))
    outer = {name: value for name, value in bonus_kwargs.items() if name in of_holder}
    own = {name: value for name, value in bonus_kwargs.items() if name not in of_holder}
    return {"bonus": bonus, "bonus_kwargs": own, **outer}


def make_baseline(
    cls: type[Any],
    venv: VecEnv,
    *,
    bonus: str | None,
    bonus_kwargs: Mapping[str, Any],
    seed: int,
    **settings: Any,
) -> BaseAlgorithm:
    """A model that has not trained; one that is off-policy adds its bonus when it samples."""
    settings = {"policy": _default_policy(venv.observation_space), "seed": seed, **settings}
    if bonus is None and bonus_kwargs:
        raise ValueError("`bonus_kwargs` must be left out where there is no `bonus`.")
    if bonus is not None and issubclass(cls, OffPolicyAlgorithm):
        for name in settings.keys() & {"replay_buffer_class", "replay_buffer_kwargs"}:
            raise ValueError(f"`{name}` must be left out with a `bonus`, which has its own buffer.")
        given = _keywords(BonusReplayBuffer, bonus, bonus_kwargs)
        settings |= {"replay_buffer_class": BonusReplayBuffer, "replay_buffer_kwargs": given}
    elif bonus is not None:
        given = _keywords(BonusVecEnvWrapper, bonus, bonus_kwargs)
        device = settings.get("device", "auto")
        venv = BonusVecEnvWrapper(venv, seed=seed, device=device, **given)
    with single_torch_thread():  # orthogonal weights differ in last bits with more
        model: BaseAlgorithm = cls(env=venv, **settings)
    return model


def _default_policy(space: spaces.Space[Any]) -> str:
    if isinstance(space, spaces.Dict):
        return "MultiInputPolicy"
    is_large = is_image_space(space) and sorted(space.shape or ())[-2] >= SMALLEST_NATURE
    return "CnnPolicy" if is_large else "MlpPolicy"


def load_baseline(
    cls: type[Any], checkpoint: Path, venv: VecEnv, *, device: Any = "auto", **replaced: Any
) -> BaseAlgorithm:
    """The model as it was at a checkpoint of `SaveRun`, to continue; only of a trusted folder.

    Args:
        cls: Class of the model.
        checkpoint: Folder of the checkpoint.
        venv: Environments like those of the run, without a bonus.
        device: Where the networks are, as in SB3.
        **replaced: Attributes of the model to replace, as of its `load`.
    """
    if (checkpoint / "bonus.npz").exists():
        venv = BonusVecEnvWrapper.load(checkpoint / "bonus.npz", venv, device=device)
    model: BaseAlgorithm = cls.load(
        checkpoint / "model", env=venv, device=device, force_reset=False, **replaced
    )
    restore_under_way(model, checkpoint)
    return model


def load_baseline_policy(
    cls: type[Any], checkpoint: Path, described: Mapping[str, Any], env: gym.Env[Any, Any]
) -> BasePolicy:
    """The policy of a checkpoint, read without running code: made as `run.json` says."""
    _, states, _ = load_from_zip_file(checkpoint / "model", load_data=False, device="cpu")
    seen = cls._wrap_env(env).observation_space  # of images with the channels first
    policies = {each.__qualname__: each for each in cls.policy_aliases.values()}
    try:
        settings = described["settings"]
        kwargs = {k: v for k, v in settings["policy_kwargs"].items() if "optimizer" not in k}
        if kwargs.get("features_extractor_class") == Standardized.__name__:
            kwargs["features_extractor_class"] = Standardized
        if issubclass(cls, OnPolicyAlgorithm):
            kwargs["use_sde"] = settings["use_sde"]
        made = policies[settings["policy"]](seen, env.action_space, lambda _: 0.0, **kwargs)
        made.load_state_dict(states["policy"])
    except (AssertionError, AttributeError, KeyError, RuntimeError, TypeError) as error:
        raise ValueError(
            "`trust` must be given if you know who made the run: its policy has more than a "
            "description can say, and its file may run any code."
        ) from error
    policy: BasePolicy = made
    return policy
