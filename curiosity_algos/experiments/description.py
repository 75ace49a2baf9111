"""Descriptions of runs: algorithm, environment, every setting, and where it ran; are two alike?"""

from __future__ import annotations

import inspect
import json
import platform
import subprocess
from collections.abc import Mapping
from dataclasses import replace
from enum import Enum
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.envs.registration import EnvSpec
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.noise import ActionNoise, VectorizedActionNoise
from stable_baselines3.common.utils import ConstantSchedule, FloatSchedule
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper, VecMonitor

from curiosity_algos.algorithms.td3_icm import TD3ICM
from curiosity_algos.evaluation.coverage import behavior_space
from curiosity_algos.evaluation.environments import VECTOR_KEYWORDS, GymnasiumView, env_attribute
from curiosity_algos.experiments.env_spec import encode_spec
from curiosity_algos.loops.evolutionary_algorithm import EvolutionaryAlgorithm
from curiosity_algos.sb3.bonus_wrapper import BonusVecEnvWrapper
from curiosity_algos.sb3.callbacks import bonus_wrapper
from curiosity_algos.sb3.replay_buffer import BonusReplayBuffer
from curiosity_gym.core import entry_names
from curiosity_gym.layouts import MazeLayout
from curiosity_gym.processors import available_cpus

MAY_DIFFER = {"device", "n_threads", "tensorboard_log", "verbose"}
"""Settings that results do not depend on."""
_FIELDS = (
    *("algorithm", "env", "env_class", "env_kwargs", "wrappers", "vec_env", "seed"),
    *("settings", "num_timesteps"),
)
PACKAGES = (
    *("curiosity-search", "numpy", "numba", "torch", "gymnasium", "stable-baselines3"),
    *("ribs", "mujoco", "dm-control", "gymnasium-robotics"),
)


def describe_run(model: BaseAlgorithm) -> dict[str, Any]:
    """What distinguishes a run from others, and where it runs, in terms of JSON."""
    env = model.get_env()
    assert env is not None
    return {
        "algorithm": algorithm_name(model),
        **describe_env(env),
        "behavior_names": behavior_names(env),
        **describe_settings(model),
        "seed": model.seed,
        "archive": describe_archive(model),
        "versions": versions(),
        "git_revision": git_revision(Path.cwd()),
        "machine": {
            "processor": cpu_model(),
            "cpus": available_cpus(),
            "system": platform.platform(),
        },
    }


def algorithm_name(model: BaseAlgorithm) -> str:
    """The name of its class, and of what was added to it: `SAC + APT`, `PPO + demonstrations`."""
    buffer, name = getattr(model, "replay_buffer", None), type(model).__name__
    if hasattr(model.get_env(), "demonstrations"):  # of DemonstrationStarts, slow to import
        return f"{name} + demonstrations"
    is_added = isinstance(buffer, BonusReplayBuffer) and not isinstance(model, TD3ICM)
    owner = bonus_wrapper(model) or (buffer if is_added else None)
    return name if owner is None else f"{name} + {type(owner.bonus).__name__}"


def describe_env(env: VecEnv) -> dict[str, Any]:
    """The id of an environment, or else its class, and its arguments.

    `env_spec` says how to make it; where that is None, `env_unknown` says why.
    """
    spec = spec_of(env)
    if spec is None:
        name = type(env.get_attr("unwrapped", indices=0)[0]).__name__
        unknown = {"env_spec": None, "env_unknown": f"{name} was not made by gymnasium.make"}
        return {"env": None, "env_class": name, "env_kwargs": {}, "wrappers": {}, **unknown}
    try:
        made: dict[str, Any] = {"env_spec": encode_spec(spec)}
    except ValueError as error:
        made = {"env_spec": None, "env_unknown": str(error).rstrip(".")}
    wrappers = {wrapper.name: {**(wrapper.kwargs or {})} for wrapper in spec.additional_wrappers}
    for kwargs in wrappers.values():
        kwargs.pop("behavior_names", None)  # names make no other environment
    return {
        "env": spec.id,
        "env_class": str(getattr(spec.entry_point, "__qualname__", spec.entry_point)),
        "env_kwargs": _as_json({**spec.kwargs, "max_episode_steps": spec.max_episode_steps}),
        "wrappers": _as_json(wrappers),
        **made,
    }


def spec_of(env: VecEnv) -> EnvSpec | None:
    """The spec of the first single environment, without SB3's Monitor and how to render."""
    view = env if isinstance(env, GymnasiumView) else None
    spec = view.vector_env.spec if view else env_attribute(env, "spec")
    if spec is None:
        return None
    left_out = {*VECTOR_KEYWORDS, "render_mode"}
    kwargs = {name: value for name, value in spec.kwargs.items() if name not in left_out}
    kwargs |= _layouts(env, kwargs)
    limit = spec.max_episode_steps
    # A vector environment has it among its keywords, a single one not.
    if view or "num_envs" in spec.kwargs:
        limit = kwargs.pop("max_episode_steps", limit)
    wrappers = tuple(w for w in spec.additional_wrappers if w.name != "Monitor")
    found: EnvSpec = replace(
        spec, additional_wrappers=wrappers, kwargs=kwargs, max_episode_steps=limit
    )
    return found


def _layouts(env: VecEnv, kwargs: Mapping[str, Any]) -> dict[str, MazeLayout]:
    """The layout that was read from a keyword's file, which may change later."""
    files = [name for name in ("layout", "world") if str(kwargs.get(name)).endswith(".json")]
    layout = env_attribute(env, "layout") if files else None
    return dict.fromkeys(files, layout) if isinstance(layout, MazeLayout) else {}


def behavior_names(env: VecEnv) -> list[str] | None:
    """The name of each entry of an environment's behavior; None where it names none.

    A wrapper with a behavior of its own may hide the names of another number of entries.
    """
    names, space = env_attribute(env, "behavior_names"), behavior_space(env)
    if names is None or space is None or len(names) != space.shape[0]:
        return None
    return list(entry_names(names, space.shape[0]))


def describe_settings(model: BaseAlgorithm) -> dict[str, Any]:
    """What a callback may change: `settings`, and the `vec_env` of algorithms that step one."""
    settings = {"settings": settings_of(model)}
    env, wrappers = model.get_env(), {}
    if hasattr(env, "demonstrations"):
        del settings["settings"]["gamma"]  # follows from their lengths
    if env is None or isinstance(model, EvolutionaryAlgorithm):  # results do not depend on it
        return settings
    n_envs = env.num_envs
    while isinstance(env, VecEnvWrapper):
        # It changes nothing, and that of demonstrations nothing but what follows from them.
        if not isinstance(env, VecMonitor):
            has_bonus = isinstance(env, BonusVecEnvWrapper)
            arguments = _as_json(env.settings) if has_bonus else _arguments(env, vars(env))
            wrappers[type(env).__name__] = arguments
        env = env.venv
    return {"vec_env": {"n_envs": n_envs, "wrappers": wrappers}, **settings}


def settings_of(model: BaseAlgorithm) -> dict[str, Any]:
    """Every keyword of the constructor that a model keeps, defaults included; objects by class."""
    own: dict[str, Any] = {"device": str(model.device), "policy": model.policy_class}
    local = getattr(getattr(model, "evaluator", None), "local", None)
    if local is not None:  # that of a cluster gives the same results
        own["evaluator"] = local
    archive = getattr(model, "_own_archive", None)
    if archive is not None:
        own["archive"] = {type(archive).__name__: archive.settings}
    settings = _arguments(model, vars(model) | own)
    buffer = getattr(model, "replay_buffer", None)
    if isinstance(buffer, BonusReplayBuffer):  # callbacks may have changed its settings
        in_force = vars(model)["replay_buffer_kwargs"] | buffer.settings
        settings["replay_buffer_kwargs"] = _as_json(in_force)
    beside = ("preset", "settle")  # no keywords: of `from_preset`, and of a SettleCallback
    return settings | {name: getattr(model, name) for name in beside if hasattr(model, name)}


def describe_archive(model: BaseAlgorithm) -> dict[str, Any] | None:
    """The archive that keeps a model's elites, by its class; None of an algorithm without one."""
    archive = getattr(model, "archive", None)
    return None if archive is None else {type(archive).__name__: archive.settings}


def _arguments(thing: object, attributes: Mapping[str, Any]) -> dict[str, Any]:
    """The constructor's arguments that are attributes of their name, or with a `_`."""
    names = inspect.signature(type(thing)).parameters.keys() - {"env", "venv", "seed"}
    kept = {
        name: attributes.get(name, attributes.get(f"_{name}"))
        for name in sorted(names)
        if attributes.keys() & {name, f"_{name}"} and not name.startswith("_")
    }
    as_json: dict[str, Any] = _as_json(kept)
    return as_json


def _as_json(value: Any) -> Any:
    return json.loads(json.dumps(value, default=_name))


def _name(value: Any) -> Any:
    """A number of numpy's as Python's, an array as a list, most others by their class."""
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, MazeLayout):
        return f"{value.name} {value.digest}"
    if isinstance(value, FloatSchedule):  # SB3's, of a number or of a function
        if isinstance(value.value_schedule, ConstantSchedule):
            return value.value_schedule.val
        return [value(left) for left in (1.0, 0.5, 0.0)]
    if isinstance(value, VectorizedActionNoise):  # what SB3 makes of one for several environments
        value = value.base_noise
    if isinstance(value, ActionNoise):
        numbers = int | float | np.ndarray
        settings = {k: v for k, v in vars(value).items() if k[0] == "_" and isinstance(v, numbers)}
        return {type(value).__name__: settings}
    return getattr(value, "__qualname__", type(value).__qualname__)


def versions() -> dict[str, str]:
    """Versions of Python and of the packages that results depend on, where they are installed."""
    installed = {each: number for each in PACKAGES if (number := version(each)) is not None}
    return {"python": platform.python_version(), **installed}


def version(package: str) -> str | None:
    """The version of a package, or None where it is not installed."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def git_revision(folder: Path) -> str | None:
    """The commit that a folder is at, with "+" where files differ; None outside of git."""
    described = ["git", "-C", str(folder), "describe", "--always", "--abbrev=40", "--exclude=*"]
    try:
        ran = subprocess.run([*described, "--dirty=+"], capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return ran.stdout.strip()


def cpu_model() -> str:
    """The processor's name as the system gives it."""
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text().splitlines() if cpuinfo.exists() else []
    models = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return models[0] if models else platform.processor() or platform.machine()


def check_same(folder: Path, there: Mapping[str, Any], here: Mapping[str, Any]) -> None:
    """Raise a ValueError that names the first field in which the run in a folder is another."""
    if found := differing(there, here):
        raise ValueError(f"`folder` must be empty or that of this run: in {folder} {found}.")


def differing(there: Mapping[str, Any], here: Mapping[str, Any]) -> str | None:
    """The first field in which two runs differ, as `difference` says it, or None."""
    one, other = ({name: run.get(name) for name in _FIELDS} for run in (there, here))
    return difference(one, other)


def difference(there: Any, here: Any, name: str = "") -> str | None:
    """The first value that differs, such as `settings.sigma is 0.3, not 0.5`, or None."""
    if not (isinstance(there, Mapping) and isinstance(here, Mapping)):
        return None if there == here else f"{name} is {json.dumps(there)}, not {json.dumps(here)}"
    for key in dict.fromkeys([*there, *here]):
        path = f"{name}.{key}" if name else key
        found = key not in MAY_DIFFER and difference(there.get(key), here.get(key), path)
        if found:
            return found
    return None
