"""Equality in every bit, a plain loop over vector environments, and both ways to copy something."""

import copy
import pickle

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode


def assert_identical(ours, theirs):
    """The same types, dtypes, shapes and bits, through tuples and dicts."""
    assert type(ours) is type(theirs)
    if isinstance(ours, dict):
        assert ours.keys() == theirs.keys()
        for key in ours:
            assert_identical(ours[key], theirs[key])
    elif isinstance(ours, tuple):
        for our, their in zip(ours, theirs, strict=True):
            assert_identical(our, their)
    elif isinstance(ours, np.ndarray):
        assert (ours.dtype, ours.shape) == (theirs.dtype, theirs.shape)
        if ours.dtype == object:
            for our, their in zip(ours, theirs, strict=True):
                assert_identical(our, their)
        else:
            assert ours.tobytes() == theirs.tobytes()
    else:
        assert ours == theirs


def run(envs, actions):
    """Everything that reset and the steps return; with autoreset disabled, resets the ended."""
    results = [envs.reset(seed=3)]
    for action in actions:
        results.append(envs.step(action))
        ended = results[-1][2] | results[-1][3]
        if envs.metadata["autoreset_mode"] == AutoresetMode.DISABLED and ended.any():
            results.append(envs.reset(options={"reset_mask": ended.copy()}))
    return results


@pytest.fixture(
    params=[copy.deepcopy, lambda each: pickle.loads(pickle.dumps(each))], ids=["copy", "pickle"]
)
def duplicate(request):
    """Makes a copy of an object."""
    return request.param


assert_identical_fixture = pytest.fixture(name="assert_identical")(lambda: assert_identical)
run_fixture = pytest.fixture(name="run")(lambda: run)
