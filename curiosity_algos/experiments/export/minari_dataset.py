"""Episodes of a run's policies as a Minari dataset (https://minari.farama.org)."""

from __future__ import annotations

import os
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.envs.registration import EnvSpec

from curiosity_algos.common.arrays import Array, Float32Array
from curiosity_algos.evaluation.flat_spaces import FlatActions, FlatObservations, numeric
from curiosity_algos.evaluation.mlp import Mlp, act
from curiosity_algos.evaluation.vector import most_steps
from curiosity_algos.experiments.description import versions
from curiosity_algos.experiments.env_spec import given_or_made, make_env
from curiosity_algos.experiments.export.policies import (
    POLICIES,
    Policies,
    population_algorithm,
    read_policies,
)
from curiosity_algos.experiments.loading import Run
from curiosity_gym import __version__
from curiosity_gym.extras import import_extra
from curiosity_gym.layouts import MazeLayout
from curiosity_gym.validation import check_at_least_one, check_choice

DESCRIBED = ("algorithm", "env", "env_kwargs", "wrappers", "seed", "settings", "versions")
"""Fields of `run.json` in the metadata of the dataset."""


def export_minari(
    run: str | os.PathLike[str],
    dataset_id: str,
    *,
    policies: str = "rewarding",
    n_policies: int = 1000,
    trust: bool = False,
    env: gym.Env[Any, Any] | None = None,
) -> Any:
    """Play policies of a run again, and write their episodes as a Minari dataset.

    Each policy plays the episode that it played in the run, which begins with a reset with the seed
    in Minari's metadata. The dataset's `recover_environment` gives the same observations and
    rewards for the same actions, bit for bit, with the same versions of the libraries. A policy
    that the run stored twice is played once.

    The dataset appears in Minari's folder (`MINARI_DATASETS_PATH`) once it is whole.

    Args:
        run: Folder of the run, of a population algorithm.
        dataset_id: Name of the dataset for Minari: `curiosity/us-v0`.
        policies: "elites", of an algorithm with an archive; "rewarding", those that succeeded;
            "sample", of all that were evaluated. `SaveRun` says how many of them a run stores.
        n_policies: Most policies, which are drawn uniformly if there are more.
        trust: Also run code that the run's folder names or contains.
        env: Environment like the run's; None: the one that `run.json` describes.

    Returns:
        The `minari.MinariDataset`.

    Raises:
        gymnasium.error.DependencyNotInstalled: If the extra `minari` is not installed.
        FileNotFoundError: If there is no run.
        ValueError: If the run is of another algorithm, has no such policies, is damaged or needs
            trust; if the id is malformed, or the dataset exists.
    """
    minari, namespaces, _ = import_extra("minari", "minari", "minari.namespace", "h5py")
    check_choice(tuple(POLICIES), policies=policies)
    check_at_least_one(n_policies=n_policies)
    target = _new_path(dataset_id)
    opened = Run(run)
    population_algorithm(opened)  # before an environment is made
    make = partial(make_env, opened.description, trust=trust)
    with given_or_made(env, make) as env, TemporaryDirectory(prefix=".", dir=_root()) as folder:
        chosen = read_policies(opened, policies, env).select(n_policies)
        starts = opened.result.get("starts")
        about = _describe(opened.description, env.spec, policies, chosen, starts)
        _write(Path(folder, "dataset"), env, chosen, {"dataset_id": dataset_id, **about})
        namespace, _, _ = dataset_id.rpartition("/")
        if namespace and namespace not in namespaces.list_local_namespaces():
            namespaces.create_namespace(namespace)
        os.rename(Path(folder, "dataset"), target)
    return minari.load_dataset(dataset_id)


def _write(
    folder: Path, env: gym.Env[Any, Any], policies: Policies, metadata: dict[str, Any]
) -> None:
    from minari.dataset.minari_storage import MinariStorage

    folder.mkdir()
    storage = MinariStorage.new(
        folder / "data",
        numeric(env.observation_space),
        env.action_space,
        _as_json_spec(env.spec),
        jpeg_encoding=False,  # which would lose bits of images
    )
    storage.update_metadata(metadata)
    pairs = zip(policies.parameters, policies.seeds.tolist(), strict=True)
    # Minari takes the episodes one by one.
    storage.update_episodes(_episode(env, policies.mlp, *pair) for pair in pairs)


def _root() -> Path:
    """Minari's folder as an absolute path: Minari cannot write to another."""
    from minari.storage.datasets_root_dir import get_dataset_path

    return Path(get_dataset_path()).absolute()


def _new_path(dataset_id: str) -> Path:
    from minari.dataset.minari_dataset import parse_dataset_id

    try:
        parse_dataset_id(dataset_id)
    except (TypeError, ValueError) as error:  # TypeError without a version
        raise ValueError(
            "`out` must be the id of a Minari dataset, such as curiosity/us-v0, with names of two "
            f"letters or more, got {dataset_id!r}."
        ) from error
    target = _root() / dataset_id
    if target.exists():
        raise ValueError(f"`out` must be a new dataset, there is {target}.")
    return target


def _describe(
    described: dict[str, Any],
    spec: EnvSpec | None,
    kind: str,
    policies: Policies,
    starts: dict[str, int] | None,
) -> dict[str, Any]:
    from minari import __version__ as minari_version

    about = {name: described.get(name) for name in DESCRIBED}
    is_ours = spec is not None and str(spec.entry_point).startswith("curiosity_gym.")
    return {
        "minari_version": minari_version,
        "algorithm_name": described["algorithm"],
        "description": (
            f"Episodes of {len(policies.seeds)} policies ({kind}) of {described['algorithm']} on "
            f"{described['env']}, seed {described.get('seed')}, after {policies.timesteps} "
            "timesteps."
        ),
        "requirements": [f"curiosity-search>={__version__}"] if is_ours else [],
        "run": {**about, "timesteps": policies.timesteps, "policies": kind, "starts": starts},
        "played_with": versions(),
    }


def _as_json_spec(spec: EnvSpec | None) -> EnvSpec | None:
    """A spec that Minari can store, or None."""
    if spec is None:
        return None
    pairs = spec.kwargs.items()
    kwargs = {name: v.to_dict() if isinstance(v, MazeLayout) else v for name, v in pairs}
    try:
        return EnvSpec.from_json(replace(spec, kwargs=kwargs).to_json())
    except (TypeError, ValueError, gym.error.Error):  # JSON has no classes and no arrays
        return None


def _episode(env: gym.Env[Any, Any], mlp: Mlp, parameters: Float32Array, seed: int) -> Any:
    """One episode with the environment's own numbers: `Rollouts` are float32, without rewards."""
    from minari.data_collector.episode_buffer import EpisodeBuffer

    seen, acted = FlatObservations(env.observation_space), FlatActions(env.action_space)
    most = most_steps(env)
    observations, steps = [_vector(seen, env.reset(seed=seed)[0])], list[Any]()
    while not steps or not any(steps[-1][2:]):
        if len(steps) == most:
            raise ValueError(
                "`run` must be of an environment that ends its episodes: one had not ended after "
                f"{most} steps."
            )
        action = acted.taken(acted.choose(act(mlp, parameters[None], observations[-1][None])))[0]
        observation, *outcome, _ = env.step(action)
        observations.append(_vector(seen, observation))
        steps.append((action, *outcome))
    actions, rewards, *ends = zip(*steps, strict=True)
    terminations, truncations = np.array(ends, np.bool_)
    return EpisodeBuffer(
        seed=seed,
        observations=seen.own(np.array(observations)),
        actions=np.array(actions),
        rewards=np.array(rewards, np.float64),
        terminations=terminations,
        truncations=truncations,
        infos={},
    )


def _vector(seen: FlatObservations, observation: Any) -> Array:
    """An observation's vector, a copy in the type of their space."""
    return np.array(seen.one(observation), seen.space.dtype)
