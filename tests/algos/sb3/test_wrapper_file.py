import copy
from functools import reduce
from operator import getitem

import gymnasium as gym
import numpy as np
import pytest
import torch as th
from gymnasium import spaces
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv

from curiosity_algos.bonuses.apt import APT
from curiosity_algos.bonuses.icm import ICM
from curiosity_algos.checkpoints.plain_files import read_plain, write_plain
from curiosity_algos.sb3 import wrapper_file
from curiosity_algos.sb3.bonus_wrapper import BonusVecEnvWrapper
from curiosity_algos.sb3.wrapper_file import FORMAT


class Count(gym.Env):
    """Observes how many steps were taken, of 4, and can be brought to any of them."""

    observation_space = spaces.Box(0, 4, (1,))
    action_space = spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        self.n = 0
        return np.zeros(1, dtype=np.float32), {}

    def step(self, action):
        self.n += 1
        return np.full(1, self.n, dtype=np.float32), 0.0, self.n == 4, False, {}

    def state_dict(self):
        return {"n": self.n}

    def load_state_dict(self, state):
        self.n = int(state["n"])


def make_venv():
    return DummyVecEnv([lambda: Monitor(Count())] * 2)


def play(venv, n_steps=5):
    for i in range(n_steps):
        venv.step(np.array([i % 2, 1]))


def save(path, **changes):
    """A file of a wrapper in mid-episode, and what it holds."""
    small = {"train_interval": 4, "n_updates": 1, "batch_size": 4, "buffer_size": 20, "seed": 0}
    bonus = {"bonus": "icm", "bonus_kwargs": {"hidden": 2, "n_features": 2}}
    wrapper = BonusVecEnvWrapper(make_venv(), device="cpu", **(small | bonus | changes))
    wrapper.reset()
    play(wrapper)
    wrapper.save(path)
    return read_plain(path, FORMAT, what="wrapper")


def places(value, path=()):
    """Where nested content holds something, of numbered things the first.

    What the environments themselves hold is theirs, an array's description is not this file's, and
    an optimizer's moments are alike.
    """
    for key, each in value.items() if isinstance(value, dict) else enumerate(value):
        if key == "format" or (isinstance(key, int) and key > 0):
            continue
        yield (*path, key)
        if isinstance(each, dict | list) and key not in ("environments", ":array:"):
            yield from places(each, (*path, key))


def changed(content, place, value):
    """A copy with another value in a place, or with none where it is `del`."""
    content = copy.deepcopy(content)
    *parents, last = place
    within = content
    for key in parents:
        within = within[key]
    if isinstance(value, str) and value == "del":
        del within[last]
    else:
        within[last] = value(within[last]) if callable(value) else value
    return content


def not_a_number(value):
    """The same with NaN, in a tensor or instead of a number."""
    return th.full_like(value, th.nan) if th.is_tensor(value) else float("nan")


def loads(path):
    """Whether a file makes a wrapper that then works; else one sentence says what is wrong."""
    try:
        wrapper = BonusVecEnvWrapper.load(path, make_venv(), device="cpu")
    except ValueError as error:
        sentences = "`path` must be a saved BonusVecEnvW", "`venv` must have", "`bonus` must be giv"
        if not str(error).startswith(sentences):
            raise
        return False
    play(wrapper)
    return True


@pytest.fixture
def hold(monkeypatch):
    """Lets every file hold this: there are too many of them here to write each."""

    def hold(content):
        monkeypatch.setattr(wrapper_file, "read_plain", lambda *_, **__: content)

    return hold


BONUSES = pytest.mark.parametrize("bonus", ["icm", "e3b", "ngu", "noveld"])


@BONUSES
def test_what_is_missing_is_found(tmp_path, hold, bonus):
    path = tmp_path / "wrapper.pt"
    whole = save(path, bonus=bonus)
    assert loads(path)
    for place in places(whole):
        hold(changed(whole, place, "del"))
        is_free = place[1:2] == ("metrics",) and len(place) == 3
        assert loads(path) is is_free, place


@pytest.mark.parametrize("value", [None, "text", {}, th.full((3, 5), 0.5), not_a_number], ids=type)
@BONUSES
def test_what_is_foreign_is_found(tmp_path, hold, value, bonus):
    path = tmp_path / "wrapper.pt"
    whole = save(path, bonus=bonus)
    for place in places(whole):
        # A metric may be anything, an untrained wrapper has no moments.
        if place[1:2] == ("metrics",) or place == ("environments",) or place[-1] == "optimizer":
            continue
        # As of a bonus without memory, or of a buffer of the usual size.
        if value is None and (reduce(getitem, place, whole) is None or place[-1] == "buffer_size"):
            continue
        try:
            content = changed(whole, place, value)
        except RuntimeError:  # integers have no NaN
            continue
        hold(content)
        assert not loads(path), place


def test_a_setting_of_another_range_is_found(tmp_path):
    path = tmp_path / "wrapper.pt"
    whole = save(path)
    for name, value in {
        "weight": -1.0,
        "gamma": 1.0,
        "n_updates": 0,
        "buffer_size": 10**15,
    }.items():
        write_plain(path, changed(whole, ("settings", name), value), FORMAT)
        assert not loads(path)


def test_a_counter_that_a_wrapper_cannot_have_is_found(tmp_path):
    path = tmp_path / "wrapper.pt"
    whole = save(path)
    wide = whole["state"]["observations"].double()
    for name, value in {"n_untrained": -1, "observations": wide, "metrics": {"a": "b"}}.items():
        write_plain(path, changed(whole, ("state", name), value), FORMAT)
        assert not loads(path)


def test_a_discrete_action_there_is_not_is_found(tmp_path):
    path = tmp_path / "wrapper.pt"
    whole = save(path)
    for action in (-1.0, 2.0, 0.5):
        actions = th.full_like(whole["state"]["buffer"]["actions"], action)
        write_plain(path, changed(whole, ("state", "buffer", "actions"), actions), FORMAT)
        assert not loads(path)


def test_a_given_bonus_is_as_it_was_where_it_does_not_fit(tmp_path, assert_same):
    path = tmp_path / "wrapper.pt"
    made = [
        ICM(Count.observation_space, Count.action_space, n_features=n, seed=0, device="cpu")
        for n in (3, 4, 3)
    ]
    save(path, bonus=made[0], bonus_kwargs=None)
    before = copy.deepcopy(made[1].state_dict())
    with pytest.raises(ValueError, match=r"^`bonus` must be made as the one that was saved"):
        BonusVecEnvWrapper.load(path, make_venv(), bonus=made[1])
    assert_same(made[1].state_dict(), before)
    loaded = BonusVecEnvWrapper.load(path, make_venv(), bonus=made[2])
    assert_same(loaded.bonus.state_dict(), made[0].state_dict())


def test_a_given_bonus_has_the_horizon_of_the_one_that_was_saved(tmp_path):
    path = tmp_path / "wrapper.pt"
    save(path, bonus=ICM(Count.observation_space, Count.action_space), bonus_kwargs=None)
    apt = APT(Count.observation_space, Count.action_space)
    with pytest.raises(ValueError, match=r"^`bonus` must have a `horizon` of 1, as the one that"):
        BonusVecEnvWrapper.load(path, make_venv(), bonus=apt)
