"""Policies that come with the package: the best of an algorithm in an environment."""

from __future__ import annotations

from importlib.resources import files

import gymnasium as gym
import numpy as np
import torch as th
from stable_baselines3.common.policies import ActorCriticPolicy, BasePolicy

from curiosity_algos.common.arrays import Array
from curiosity_algos.common.names import find_algorithm, find_known
from curiosity_algos.evaluation.policies import MlpPolicy
from curiosity_algos.robust.robustify import POLICY_KWARGS
from curiosity_gym.registration import SPECS

# Resources, not paths: the package may lie in an archive.
_FILES = {
    file.name.removesuffix(".npz"): file
    for file in files("curiosity_algos").joinpath("pretrained").iterdir()
    if file.name.endswith(".npz")
}
PRETRAINED = tuple(sorted(tuple(name.split("_", 1)) for name in _FILES))
"""Pairs of algorithm and environment."""


def load_pretrained(algorithm: str, env_id: str) -> BasePolicy:
    """The policy of the algorithm's best run in the committed results; "ppo" is of `robustify`.

    It `predict`s as a trained model does, and `evaluate_policy` takes it for one.

    Args:
        algorithm: Name of the algorithm, in any spelling.
        env_id: Id of an environment of this package.

    Raises:
        ValueError: If the package has none of them.
    """
    saved = _read(algorithm, env_id)
    env = gym.make(env_id)
    spaces = env.observation_space, env.action_space
    env.close()
    if "net_arch" in saved:
        policy = MlpPolicy(*spaces, saved["net_arch"].tolist())
        policy.vector[:] = saved["parameters"]
        return policy
    robust = ActorCriticPolicy(*spaces, lambda _: 0.0, **POLICY_KWARGS)
    robust.load_state_dict({name: th.as_tensor(array) for name, array in saved.items()})
    return robust


def pretrained_seed(algorithm: str, env_id: str) -> int | None:
    """Seed of the reset of the policy's best episode; None: any."""
    seed = _read(algorithm, env_id).get("episode_seed")
    return None if seed is None else int(seed)


def _read(algorithm: str, env_id: str) -> dict[str, Array]:
    name = find_algorithm(algorithm).__name__
    find_known("env", env_id, SPECS)
    env_id = next(known for known, spec in SPECS.items() if spec == SPECS[env_id])  # of an alias
    if (name, env_id) not in PRETRAINED:
        envs = ", ".join(env for algorithm, env in PRETRAINED if algorithm == name)
        raise ValueError(
            f"`pretrained` {name} has policies for {envs or 'no environment'}, not for {env_id}."
        )
    with _FILES[f"{name}_{env_id}"].open("rb") as file, np.load(file) as saved:
        return dict(saved)
