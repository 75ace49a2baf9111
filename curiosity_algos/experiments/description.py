"""Descriptions of runs: algorithm, environment, every setting, and where it ran."""

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
from types import FunctionType
from typing import Any

import numpy as np
from gymnasium.envs.registration import EnvSpec
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.noise import ActionNoise, VectorizedActionNoise
from stable_baselines3.common.utils import ConstantSchedule, FloatSchedule
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper, VecMonitor

from curiosity_algos.algorithms.td3_icm import TD3ICM
from curiosity_algos.evaluation.coverage import behavior_space
from curiosity_algos.evaluation.environments import (
    VECTOR_KEYWORDS,
    GymnasiumView,
    env_attribute,
)
from curiosity_algos.experiments.env_spec import encode_spec
from curiosity_algos.loops.evolutionary_algorithm import EvolutionaryAlgorithm
from curiosity_algos.sb3.bonus_wrapper import BonusVecEnvWrapper
from curiosity_algos.sb3.callbacks import bonus_wrapper
from curiosity_algos.sb3.replay_buffer import BonusReplayBuffer
from curiosity_gym.core import entry_names
from curiosity_gym.layouts import MazeLayout
from curiosity_gym.processors import available_cpus

PACKAGES = (
    *("curiosity-search", "numpy", "numba", "torch", "gymnasium", "stable-baselines3"),
    *("ribs", "mujoco", "dm-control", "gymnasium-robotics"),
)


def describe_run(model: BaseAlgorithm) -> dict[str, Any]:
    """All that tells a run from another, in terms of JSON; what a run comes to is not in it."""
    return {
        "algorithm": algorithm_name(model),
        **describe_env(model.get_env()),
        "behavior_names": behavior_names(model.get_env()),
        **describe_vec_env(model),
        "seed": model.seed,
        "settings": settings_of(model),
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
    """The name of its class, and of the bonus that was added to it: `PPO + ICM`, `SAC + APT`."""
    buffer = getattr(model, "replay_buffer", None)
    is_added = isinstance(buffer, BonusReplayBuffer) and not isinstance(model, TD3ICM)
    holder = bonus_wrapper(model) or (buffer if is_added else None)
    added = "" if holder is None else f" + {type(holder.bonus).__name__}"
    return f"{type(model).__name__}{added}"


def describe_env(env: VecEnv | None) -> dict[str, Any]:
    """`env`, its id or else its class, and all that it was made with, as far as it says so.

    `env_unknown` says why `env_spec` is None.
    """
    spec = spec_of(env)
    if spec is None:
        inner = None if env is None else env.get_attr("unwrapped", indices=0)[0]
        name = type(inner).__name__
        unknown = {"env": None, "env_class": name, "env_spec": None}
        unknown |= {"env_unknown": f"{name} was not made by gymnasium.make"}
        return {**unknown, "env_kwargs": {}, "wrappers": {}}
    wrappers = {each.name: _as_json(_telling(each.kwargs)) for each in spec.additional_wrappers}
    kwargs = {name: value for name, value in spec.kwargs.items() if name != "render_mode"}
    kwargs |= {"max_episode_steps": spec.max_episode_steps}
    return {
        "env": spec.id,
        "env_class": _entry_text(spec.entry_point),
        "env_kwargs": _as_json(kwargs),
        "wrappers": wrappers,
        **_encoded(spec),
    }


def _encoded(spec: EnvSpec) -> dict[str, Any]:
    """How to make the environment, or why no file can say it."""
    try:
        return {"env_spec": encode_spec(spec)}
    except ValueError as error:
        return {"env_spec": None, "env_unknown": str(error)}


def _entry_text(entry: object) -> str:
    """What makes an environment, in words that are the same in another process."""
    if isinstance(entry, FunctionType):  # whose own text has its address
        return f"<function {entry.__module__}.{entry.__qualname__}>"
    return str(entry)


def _telling(kwargs: Mapping[str, Any] | None) -> Mapping[str, Any] | None:
    """The keywords of a wrapper but for names, which make no other environment."""
    return kwargs and {name: value for name, value in kwargs.items() if name != "behavior_names"}


def behavior_names(env: VecEnv | None) -> list[str] | None:
    """The name of each entry of an environment's behavior; None where it names none.

    A wrapper with a behavior of its own hides the names of what is within if it has others, or
    another number of entries.
    """
    names = None if env is None else env_attribute(env, "behavior_names")
    space = None if env is None else behavior_space(env)
    if names is None or space is None or len(names) != space.shape[0]:
        return None
    return list(entry_names(names, space.shape[0]))


def describe_vec_env(model: BaseAlgorithm) -> dict[str, Any]:
    """The number of a model's environments, and the wrappers of the VecEnv with their settings.

    Empty for algorithms that evaluate whole populations, whose results do not depend on it.
    """
    env = model.get_env()
    if env is None or isinstance(model, EvolutionaryAlgorithm):
        return {}
    n_envs, wrappers = env.num_envs, {}
    while isinstance(env, VecEnvWrapper):
        if not isinstance(env, VecMonitor):  # which changes nothing
            now = env.settings if isinstance(env, BonusVecEnvWrapper) else {}
            wrappers[type(env).__name__] = _arguments(env, vars(env) | now)
        env = env.venv
    return {"vec_env": {"n_envs": n_envs, "wrappers": wrappers}}


def spec_of(env: VecEnv | None) -> EnvSpec | None:
    """The spec of the (first) single environment, but for SB3's Monitor, or None."""
    if isinstance(env, GymnasiumView):
        spec = env.vector_env.spec
    else:
        spec = None if env is None else env_attribute(env, "spec")
    if spec is None:
        return None
    wrappers = tuple(each for each in spec.additional_wrappers if each.name != "Monitor")
    kwargs = {name: value for name, value in spec.kwargs.items() if name not in VECTOR_KEYWORDS}
    kwargs |= _layouts(env, kwargs)
    limit = spec.max_episode_steps
    # A vector environment has it among its keywords, a single one not.
    if isinstance(env, GymnasiumView) or "num_envs" in spec.kwargs:
        limit = kwargs.pop("max_episode_steps", limit)
    made_by: EnvSpec = replace(
        spec, additional_wrappers=wrappers, kwargs=kwargs, max_episode_steps=limit
    )
    return made_by


def _layouts(env: VecEnv | None, kwargs: Mapping[str, Any]) -> dict[str, MazeLayout]:
    """The layout that an environment has of a keyword's file, which may be changed, or moved."""
    files = [name for name in ("layout", "world") if str(kwargs.get(name)).endswith(".json")]
    layout = env_attribute(env, "layout") if files and env is not None else None
    return dict.fromkeys(files, layout) if isinstance(layout, MazeLayout) else {}


def settings_of(model: BaseAlgorithm) -> dict[str, Any]:
    """Every keyword of the constructor that a model keeps, defaults included; objects by class."""
    own: dict[str, Any] = {"device": str(model.device), "policy": model.policy_class}
    local = getattr(getattr(model, "evaluator", None), "local", None)
    if local is not None:  # that of a cluster gives the same results
        own["evaluator"] = local
    archive = getattr(model, "_own_archive", None)
    if archive is not None:
        from curiosity_algos.archives.pyribs import archive_part  # as below

        own["archive"] = {type(archive).__name__: archive_part(archive).settings}
    settings = _arguments(model, vars(model) | own)
    buffer = getattr(model, "replay_buffer", None)
    if isinstance(buffer, BonusReplayBuffer):  # callbacks may have changed what it was made with
        in_force = vars(model)["replay_buffer_kwargs"] | buffer.settings
        settings["replay_buffer_kwargs"] = _as_json(in_force)
    return settings | ({"preset": model.preset} if hasattr(model, "preset") else {})


def with_newer_settings(described: Mapping[str, Any], model: BaseAlgorithm) -> dict[str, Any]:
    """A run's description, where it has not all settings with the defaults of those it lacks.

    A version that had not a setting yet did what its default does now.
    """
    parameters, kept = inspect.signature(type(model)).parameters, settings_of(model)
    defaults = {name: _as_json(p.default) for name, p in parameters.items() if name in kept}
    return {**described, "settings": defaults | described.get("settings", {})}


def describe_archive(model: BaseAlgorithm) -> dict[str, Any] | None:
    """The archive that keeps a model's elites, by its class; None of an algorithm without one."""
    archive = getattr(model, "archive", None)
    if archive is None:
        return None
    from curiosity_algos.archives.pyribs import archive_settings  # with pyribs, a second of imports

    return {type(archive).__name__: archive_settings(archive)}


def _arguments(thing: object, attributes: Mapping[str, Any]) -> dict[str, Any]:
    """The constructor's arguments that are kept in attributes of their name, or with a `_`."""
    names = inspect.signature(type(thing)).parameters.keys() - {"env", "venv", "seed"}
    kept = {
        name: attributes.get(name, attributes.get(f"_{name}"))
        for name in sorted(names)
        if attributes.keys() & {name, f"_{name}"} and not name.startswith("_")
    }
    return {name: _as_json(value) for name, value in kept.items()}


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
    named = value if hasattr(value, "__qualname__") else type(value)
    return named.__qualname__


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
