from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import torch as th
from gymnasium.wrappers import TimeLimit
from recorder import Count
from stable_baselines3 import PPO
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.vec_env import DummyVecEnv

from benchmarks import two_heads
from curiosity_algos import BonusVecEnvWrapper

N_STEPS, N_ENVS = 12, 3
LOCK = two_heads.Lock
SPACES = LOCK.observation_space, LOCK.action_space
DISCOUNTS = {"gae_lambda": 0.9, "gamma": 0.8}


def filled(cls, rewards, values, last, starts, ended):
    """A buffer of a rollout, with returns and advantages."""
    buffer = cls(N_STEPS, *SPACES, "cpu", **DISCOUNTS, n_envs=N_ENVS)
    buffer.venv, buffer.extrinsic_weight = SimpleNamespace(), 5.0
    nothing = np.zeros((N_ENVS, 11)), np.zeros((N_ENVS, 1))
    for t in range(N_STEPS):
        buffer.venv.ended = ended[t]
        of_step = rewards[t], starts[t], th.from_numpy(values[t]), th.zeros(N_ENVS)
        buffer.add(*nothing, *of_step)
    buffer.compute_returns_and_advantage(th.from_numpy(last), starts[-1])
    return buffer


def test_returns_and_advantages_are_those_of_a_buffer_for_each_reward():
    rng = np.random.default_rng(0)
    rewards, values = rng.normal(size=(2, N_STEPS, N_ENVS, 2)).astype(np.float32)
    last = rng.normal(size=(N_ENVS, 2)).astype(np.float32)
    dones = rng.random((N_STEPS + 1, N_ENVS, 2)) < 0.2
    two = filled(two_heads.TwoReturns, rewards, values, last, dones[..., 0], dones[1:])
    alone = [
        filled(RolloutBuffer, *(each[..., i] for each in (rewards, values, last, dones)), dones)
        for i in range(2)
    ]
    for i, one in enumerate(alone):
        np.testing.assert_allclose(two.returns[..., i], one.returns, rtol=1e-5, atol=1e-6)
    weighted = 5.0 * alone[0].advantages + alone[1].advantages
    np.testing.assert_allclose(two.advantages, weighted, rtol=1e-4, atol=1e-5)
    batch = next(two.get(7))
    assert batch.returns.shape == batch.old_values.shape == (14,)
    assert batch.advantages.shape == (7,)


def test_the_bonus_goes_on_after_an_end_of_the_task():
    venv = BonusVecEnvWrapper(DummyVecEnv([LOCK] * 2), seed=0, device="cpu")
    both = two_heads.BothRewards(venv)
    both.reset()
    right = LOCK()._right[0]
    _, rewards, dones, _ = both.step(np.array([right, (right + 1) % 4]))
    assert rewards.shape == (2, 2)
    assert dones.tolist() == [False, True]
    assert both.ended.tolist() == [[False, False], [True, False]]


def test_what_is_expected_stands_for_the_rest_of_a_truncated_episode():
    venv = BonusVecEnvWrapper(DummyVecEnv([lambda: TimeLimit(Count(), 1)]), device="cpu")
    model = two_heads.two_heads(venv, 0.1, n_steps=64)
    with th.no_grad():
        model.policy.value_net.bias[:] = th.tensor([10.0, 20.0])
        model.policy.value_net.weight[:] = 0.0
    both = model.rollout_buffer.venv
    both.reset()
    _, rewards, dones, infos = both.step(np.zeros((1, 1)))
    assert dones.all()
    np.testing.assert_allclose(rewards, [[0.99 * 10.0, 0.99 * 20.0]])
    assert both.ended.tolist() == [[True, True]]
    assert "terminal_observation" not in infos[0]  # SB3's PPO would add the value once more


def test_both_values_learn():
    venv = BonusVecEnvWrapper(DummyVecEnv([LOCK] * 4), train_interval=64, device="cpu")
    model = two_heads.two_heads(venv, 0.1, n_steps=64)
    before = model.policy.value_net.weight.detach().clone()
    assert not before[0].any()
    assert before[1].any()
    model.learn(1024)
    changed = (model.policy.value_net.weight != before).any(dim=1)
    assert changed[1]
    assert model.vf_coef == 2 * PPO("MlpPolicy", venv).vf_coef  # of the mean over both


def test_two_heads_weigh_advantages_in_place_of_the_bonus():
    venv = BonusVecEnvWrapper(DummyVecEnv([LOCK]), weight=0.1, seed=0, device="cpu")
    model = two_heads.two_heads(venv, 0.1, n_steps=64)
    assert venv.weight == 1.0
    assert model.rollout_buffer.extrinsic_weight == 10.0
    assert model.rollout_buffer.venv.model is model


def test_a_lock_opens_by_its_turns_alone():
    lock = LOCK()
    for wrong in range(2):
        observation, _ = lock.reset()
        for n_turned, turn in enumerate(lock._right):
            assert observation.argmax() == n_turned
            is_last = n_turned == lock.N_WHEELS - 1
            action = (turn + (wrong and is_last)) % lock.N_TURNS
            observation, reward, terminated, _, _ = lock.step(action)
            assert terminated is is_last
        assert reward == 1.0 - wrong


def test_runs_are_added_to_a_file(tmp_path, monkeypatch):
    short = replace(two_heads.TASKS["a lock"], timesteps=1024)
    monkeypatch.setattr(two_heads, "TASKS", {"a lock": short})
    two_heads.main("a lock", seeds="0", out=tmp_path)
    monkeypatch.delattr(two_heads, "train")  # what is there is not trained again
    two_heads.main("a lock", seeds="0", out=tmp_path)
    written = pd.read_csv(tmp_path / "two_heads.csv")
    assert written["learner"].tolist() == list(two_heads.LEARNERS)
    assert written["timesteps"].tolist() == [1024, 1024]


@pytest.mark.parametrize(("first", "said"), [(2000.0, "2.0"), (None, "never")])
def test_the_table_says_when_each_seed_arrived(first, said):
    row = {"task": "a lock", "learner": "one head", "seed": 0, "timesteps": 9000, "drawn": 7}
    values = pd.DataFrame([row | {"first_success_timesteps": first, "reliable_timesteps": None}])
    line = two_heads.table(values).splitlines()[-1]
    assert line == f"| a lock | one head | {said} | never | 7 |"
