"""Generators of torch and numpy: their seeds, and the states of the global ones."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from types import FunctionType, MethodType, ModuleType
from typing import Any

import gymnasium as gym
import numpy as np
import torch as th
from gymnasium import spaces
from stable_baselines3.common.vec_env import VecEnv

_NOT_OWN = (gym.Env, VecEnv, spaces.Space, ModuleType, FunctionType, MethodType, type)
"""Objects that a part may refer to, but whose generators are not its own."""
_LEARNS = threading.RLock()
_WITHOUT_PARTS = (np.ndarray, th.Tensor, str, bytes, int, float, type(None))


def integer_seed(seed: np.random.SeedSequence) -> int:
    """`seed` for libraries that take nothing but whole numbers."""
    return int(seed.generate_state(1)[0])


def torch_generator(seed: int | None) -> th.Generator:
    """A generator of its own for torch's draws; None: fresh entropy."""
    return th.Generator().manual_seed(integer_seed(np.random.SeedSequence(seed)))


def reseed(parts: Iterable[object], seed: np.random.SeedSequence) -> None:
    """Begin anew every generator that `parts` hold, but for those of environments and spaces."""
    generators = list(_generators(list(parts)))
    for generator, child in zip(generators, seed.spawn(len(generators)), strict=True):
        if isinstance(generator, th.Generator):
            generator.manual_seed(integer_seed(child))
        else:
            kind: Any = type(generator.bit_generator)
            generator.bit_generator.state = kind(child).state


AnyGenerator = np.random.Generator | th.Generator


def _generators(whole: Any) -> Iterator[AnyGenerator]:
    """Each generator within `whole` once, in the order of attributes."""
    seen: set[int] = set()
    waiting = [whole]  # no recursion: what refers to what it goes on from may be a long chain
    while waiting:
        thing = waiting.pop()
        if isinstance(thing, (*_NOT_OWN, *_WITHOUT_PARTS)) or id(thing) in seen:
            continue
        seen.add(id(thing))
        if isinstance(thing, AnyGenerator):
            yield thing
            continue
        state = object.__getstate__(thing)  # attributes, or they and slots
        dictionaries = state if isinstance(state, tuple) else (state,)
        parts = [part for attributes in dictionaries for part in (attributes or {}).values()]
        if isinstance(thing, list | tuple):
            parts += thing
        elif isinstance(thing, Mapping):
            parts += thing.values()
        waiting += reversed(parts)


def global_state(device: th.device) -> dict[str, Any]:
    """The states of numpy's and torch's global generators, and of a GPU's where `device` is one."""
    numbers = np.random.get_state(legacy=False)  # noqa: NPY002
    numbers["state"]["key"] = th.from_numpy(numbers["state"]["key"].astype(np.int64))
    state = {"numpy": numbers, "torch": th.get_rng_state()}
    if device.type == "cuda":
        state["cuda"] = th.cuda.get_rng_state(device)
    return state


def load_global_state(state: Mapping[str, Any], device: th.device) -> None:
    """Bring the global generators to what `global_state` gave."""
    numbers = state["numpy"]
    key = numbers["state"]["key"].cpu().numpy().astype(np.uint32)
    np.random.set_state(  # noqa: NPY002
        {**numbers, "state": {**numbers["state"], "key": key}}
    )
    th.set_rng_state(state["torch"].cpu())
    if device.type == "cuda" and "cuda" in state:
        th.cuda.set_rng_state(state["cuda"].cpu(), device)


@contextmanager
def sole_learner() -> Iterator[None]:
    """Keep models of other threads from learning until the block ends.

    A thread may enter again, so that callbacks can train, load and evaluate models.

    Raises:
        RuntimeError: If a model learns in another thread, with the same global generators.
    """
    if not _LEARNS.acquire(blocking=False):
        raise RuntimeError(
            "One model learns at a time in a process, and another thread's does: use processes, "
            "such as `curiosity sweep`."
        )
    try:
        yield
    finally:
        _LEARNS.release()
