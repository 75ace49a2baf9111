from functools import partial

import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from suite import make_actions

from curiosity_gym.control.control_env import ControlEnv, ControlVectorEnv
from curiosity_gym.core import SimulationError

pytestmark = pytest.mark.extra("control")

N_ENVS = 4
MODES = list(AutoresetMode)
KEYWORDS = {"task": "stacker", "success_threshold": 1e-45, "horizon": 40}
"""Kicking the box is enough to succeed: episodes end at the goal and at the horizon."""


def make_native(**changes):
    return ControlVectorEnv(**({"num_envs": N_ENVS} | KEYWORDS | changes))


def make_sync(mode, **changes):
    return SyncVectorEnv(
        [partial(ControlEnv, **(KEYWORDS | changes))] * N_ENVS, autoreset_mode=mode
    )


@pytest.fixture(name="actions")
def actions_fixture():
    """Actions (150, N_ENVS, 5)."""
    return np.stack([make_actions("bang-bang", 150, 5, seed) for seed in (5, 1, 10, 4)], axis=1)


@pytest.mark.parametrize("random_start", [False, True])
@pytest.mark.parametrize("mode", MODES)
def test_equals_gymnasiums_sync_vector_env(random_start, mode, actions, run, assert_identical):
    changes = {"random_start": random_start}
    ours = run(make_native(autoreset_mode=mode, n_threads=2, **changes), actions)
    theirs = run(make_sync(mode, **changes), actions)
    for our, their in zip(ours, theirs, strict=True):
        assert_identical(our, their)
    ends = np.array([result[2:4] for result in ours if len(result) == 5]).sum(axis=(0, 2))
    assert ends.min() > 0


@pytest.mark.parametrize(
    ("seed", "mask"),
    [
        (7, None),
        ([7, 3, 7, 20], [True, False, False, True]),
        ([5, None, 5, None], [True, False, False, True]),
    ],
)
def test_random_starts_are_those_of_single_envs_with_the_same_seeds(
    name, seed, mask, assert_identical
):
    changes = {"task": name, "success_threshold": None, "random_start": True}
    native, sync = make_native(**changes), make_sync("NextStep", **changes)
    results = []
    for envs in (native, sync):
        envs.reset(seed=1)
        options = {} if mask is None else {"reset_mask": np.array(mask)}
        results.append([envs.reset(seed=seed, options=options), envs.reset()])
    for ours, theirs in zip(*results, strict=True):
        np.testing.assert_array_equal(ours[0], theirs[0])
    assert len(np.unique(results[0][1][0], axis=0)) >= 3


class TestStep:
    def test_overwrites_observations_without_copies(self, actions):
        envs, twins = make_native(copy=False), make_native()
        observations = envs.reset()[0]
        twins.reset()
        for action in actions[:60]:
            assert envs.step(action)[0] is observations
            np.testing.assert_array_equal(observations, twins.step(action)[0])

    def test_raises_where_the_physics_fail_and_needs_a_reset_then(self, actions, assert_identical):
        envs, twins = make_native(), make_native()
        envs.reset()
        envs.simulation._batch.bind("qvel")[3, 0] = 1e12
        with pytest.raises(SimulationError, match="simulation 3"):
            envs.step(actions[0])
        with pytest.raises(ResetNeeded):
            envs.step(actions[0])
        # The others have moved in a step that nobody saw: they need a reset too.
        envs.reset(options={"reset_mask": np.arange(N_ENVS) == 3})
        with pytest.raises(ResetNeeded):
            envs.step(actions[0])
        assert_identical(envs.reset(), twins.reset())
        assert_identical(envs.step(actions[0]), twins.step(actions[0]))
