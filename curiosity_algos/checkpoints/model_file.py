"""Models in files: written whole, read without surprises, with clear errors for other files."""

from __future__ import annotations

import base64
import io
import json
import os
import pathlib
import pickle
import zipfile
from collections.abc import Iterable, Mapping, Set
from inspect import isroutine
from numbers import Integral, Real
from typing import Any

import cloudpickle
from gymnasium import spaces
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.save_util import load_from_zip_file, save_to_zip_file
from stable_baselines3.common.type_aliases import TensorDict
from stable_baselines3.common.utils import get_system_info
from stable_baselines3.common.vec_env import VecEnv

from curiosity_algos.checkpoints.plain_files import check_plain, is_plain, is_whole_zip
from curiosity_algos.checkpoints.plain_json import decode, encode
from curiosity_algos.state.atomic_file import atomic_file

TRANSITIONS = {"buffer", "replay_buffer"}
"""Names to exclude what parts have collected, ours and Stable-Baselines3's."""
_ALGORITHM = ":algorithm:"
"""Key of the class' name in a file, which no attribute can have."""
_PICKLED = ":serialized:"
"""Key of an attribute that Stable-Baselines3 writes with cloudpickle."""
_KINDS: dict[str, Any] = {
    "policy_class": type,
    "policy_kwargs": dict,
    "observation_space": spaces.Space,
    "action_space": spaces.Space,
    "verbose": Integral,
    "num_timesteps": Integral,
    "seed": Integral | None,
    "env": VecEnv | None,
}
"""Types that SB3 takes attributes for unchecked; only those of None may be missing."""
_PROGRESS: dict[str, Any] = {
    "generation": Integral,
    "_best_return": Real,
    "_best_seed": Integral | None,
    "_has_reward": bool,
    "_user_parts": dict,
    "_lacks_transitions": bool,
}
"""Variables that population algorithms go on from; TD3 has fewer."""


def checkpoint_path(path: str | os.PathLike[str]) -> pathlib.Path:
    """`path`, with SB3's suffix `.zip` where it has none."""
    path = pathlib.Path(path)
    return path if path.suffix else path.with_suffix(".zip")


def save_model(
    model: BaseAlgorithm,
    path: str | os.PathLike[str] | io.BufferedIOBase,
    exclude: Set[str],
    include: Iterable[str] | None,
    *,
    plain: bool = False,
    **extra: Any,
) -> None:
    """Save a model as Stable-Baselines3 does, but in a file that appears only once it is whole.

    `plain` writes attributes as `read_attributes` takes them, without cloudpickle where that is
    possible; those in `extra` take the place of the model's own. Raises ValueError where the state
    of a part could not be read back.
    """
    include = set(include or ())
    parameters = model.get_parameters()
    for name, state in parameters.items():
        check_plain(state, _owner(model, name, state))
    if exclude & TRANSITIONS and _drop_transitions(parameters):
        extra["_lacks_transitions"] = True
    parts = {name.partition(".")[0] for name in parameters}
    left_out = (exclude | set(model._excluded_save_params()) | parts) - include
    data = {key: value for key, value in model.__dict__.items() if key not in left_out}
    data |= extra
    data[_ALGORITHM] = type(model).__name__
    if plain:
        data = {name: _encoded(value) for name, value in data.items()}
    if isinstance(path, io.BufferedIOBase):
        save_to_zip_file(path, data=data, params=parameters)
        return
    with atomic_file(checkpoint_path(path)) as file:
        save_to_zip_file(file, data=data, params=parameters)


def _drop_transitions(parameters: Mapping[str, Any]) -> bool:
    """Leave out what parts have collected; whether there was any."""
    # A user's bonus may have a tensor of that name.
    holders = [each for each in parameters.values() if isinstance(each.get("buffer"), dict)]
    for state in holders:
        del state["buffer"]
    return bool(holders)


def _owner(model: BaseAlgorithm, name: str, state: Any) -> str:
    """The user's name of the part whose state, within that of the part `name`, is not plain."""
    nested = state.items() if isinstance(state, Mapping) else ()
    for key, value in nested:
        # A part within a part, as a bonus in a motivation, has the name of the user's argument.
        if isinstance(value, Mapping) and not is_plain(value) and hasattr(model, key):
            return str(key)
    return name.lstrip("_")


def _encoded(value: Any) -> Any:
    """`value` in terms of JSON, of cloudpickle's bytes where nothing else can write it."""
    try:
        return encode(value)
    except TypeError:
        # As SB3 does, but for its list of attributes, and for what JSON would change the type of.
        pickled = base64.b64encode(cloudpickle.dumps(value)).decode()
        return {":type:": str(type(value)), _PICKLED: pickled}


def read_attributes(
    file: pathlib.Path | io.BufferedIOBase,
    algorithm: str,
    given: Mapping[str, Any],
    *,
    fixed: Set[str],
    allow_pickle: bool,
) -> dict[str, Any]:
    """A model's attributes in a file, read without running code, or those that are `given`.

    The `fixed` ones may be given only where nothing but cloudpickle can read them; `allow_pickle`
    leaves such out, else they are an error.
    """
    data = _read_data(file)
    pickled = {k for k, value in data.items() if isinstance(value, dict) and _PICKLED in value}
    if (missing := pickled - given.keys()) and not allow_pickle:
        arguments = sorted("policy" if each == "policy_class" else each for each in missing)
        names = " and ".join(f"`{name}`" for name in arguments)
        raise ValueError(
            f"{names} must be given to `load` (as keywords): {file} holds objects that are read by "
            "running code. Pass allow_pickle=True if you trust whoever made the file."
        )
    try:
        read = {name: decode(value) for name, value in data.items() if name not in pickled}
    except (RecursionError, ValueError) as error:
        raise ValueError(f"`path` must be a saved {algorithm}, {file} is damaged.") from error
    check_left(given, read, fixed - pickled, algorithm)
    return {**read, **{name: value for name, value in given.items() if name in data}}


def check_left(
    given: Mapping[str, Any], saved: Mapping[str, Any], fixed: Set[str], algorithm: str
) -> None:
    """Raise ValueError if another value is given of a setting that what was saved was made with."""
    for name in sorted(fixed & given.keys()):
        if given[name] != saved.get(name):
            raise ValueError(
                f"`{name}` must be left as it was saved, {saved.get(name)}: make a new {algorithm}."
            )


def read_model(
    file: pathlib.Path | io.BufferedIOBase,
    algorithm: str,
    custom_objects: dict[str, Any] | None,
    print_system_info: bool = False,
) -> tuple[dict[str, Any], TensorDict]:
    """Read a model's attributes and the states of its parts, on the CPU; arguments as in SB3.

    Raises ValueError if the file is damaged, or its tensors would run code.
    """
    if print_system_info:
        print("== CURRENT SYSTEM INFO ==")
        get_system_info()
    wrong = f"`path` must be a saved {algorithm}, {file}"
    try:
        data, parameters, variables = load_from_zip_file(
            file,
            custom_objects=custom_objects,
            device="cpu",
            print_system_info=print_system_info,
        )
    except pickle.UnpicklingError as error:
        raise ValueError(f"{wrong} holds more than tensors and plain values.") from error
    except Exception as error:  # whatever torch and zipfile raise of what is damaged
        raise ValueError(f"{wrong} is damaged: {error!r}.") from error
    # SB3 would set variables of any name; our models have none.
    if data is None or variables is not None or not _is_sound(data):
        raise ValueError(f"{wrong} is damaged.")
    for name in (_ALGORITHM, "device"):  # `load` is told the device
        data.pop(name, None)
    return data, parameters


def _is_sound(data: Mapping[str, Any]) -> bool:
    """Whether a model can be made of these attributes, and none hides a method."""
    is_hidden = any(isroutine(getattr(BaseAlgorithm, name, None)) for name in data)
    known = [(data.get(name), kind) for name, kind in _KINDS.items()]
    known += [(data[name], kind) for name, kind in _PROGRESS.items() if name in data]
    return not is_hidden and all(isinstance(value, kind) for value, kind in known)


def check_is_checkpoint(
    source: str | os.PathLike[str] | io.BufferedIOBase, algorithm: str
) -> pathlib.Path | io.BufferedIOBase:
    """The file to read, or an error unless it holds a whole model of a class of this package."""
    if isinstance(source, io.BufferedIOBase):
        file: pathlib.Path | io.BufferedIOBase = source
    else:
        path = pathlib.Path(source)
        file = path = path if path.is_file() else checkpoint_path(source)
        if not path.is_file():
            raise FileNotFoundError(f"`path` must be a saved model, there is no file {path}.")
    found = _saved_algorithm(file)
    if found != algorithm:
        what = "not a whole file of this package" if found is None else f"one of {found}"
        raise ValueError(f"`path` must be a saved {algorithm}, {file} is {what}.")
    return file


def _saved_algorithm(file: pathlib.Path | io.BufferedIOBase) -> str | None:
    """Name of the class that the file holds, or None where it is damaged or foreign."""
    try:
        if not is_whole_zip(file):
            return None
        name = _read_data(file).get(_ALGORITHM)
    except Exception:  # whatever zipfile and json raise of what is damaged
        return None
    return name if isinstance(name, str) else None


def saved_names(file: pathlib.Path | io.BufferedIOBase) -> set[str]:
    """Names of the attributes in a file that `check_is_checkpoint` gave."""
    return set(_read_data(file))


def _read_data(file: pathlib.Path | io.BufferedIOBase) -> Any:
    """The file's JSON."""
    with zipfile.ZipFile(file) as archive:
        return json.loads(archive.read("data"))
