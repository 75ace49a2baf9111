"""SettleCallback: which steps shrink, by how much, and that a model that is loaded goes on."""

import math

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from stable_baselines3 import A2C, DQN, PPO, SAC
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.env_util import make_vec_env

from curiosity_algos import SettleCallback

PPO_SETTINGS = {"n_steps": 64, "batch_size": 64, "n_epochs": 1, "seed": 0, "device": "cpu"}


class OneStep(gym.Env):
    """Episodes of a step, which succeed from the k-th on; or which only return as much."""

    observation_space = spaces.Box(-1.0, 1.0, (1,))

    def __init__(self, succeeds_from=0, *, reports=True, discrete=False):
        self.action_space = spaces.Discrete(2) if discrete else spaces.Box(-1.0, 1.0, (2,))
        self.succeeds_from, self.reports, self.n = succeeds_from, reports, 0

    def reset(self, seed=None, options=None):
        super().reset(seed=seed)
        return np.zeros(1, np.float32), {}

    def step(self, action):
        success = self.n >= self.succeeds_from
        self.n += 1
        infos = {"is_success": success} if self.reports else {}
        return np.zeros(1, np.float32), float(success and not self.reports), True, False, infos


class Sizes(BaseCallback):
    """The sizes of the steps that each rollout is learned from with."""

    def __init__(self):
        super().__init__()
        self.rows = []

    def _on_rollout_end(self):
        self.rows.append(sizes(self.model))

    def _on_step(self):
        return True


def sizes(model):
    clip = model.clip_range(1.0) if hasattr(model, "clip_range") else None
    return model.lr_schedule(1.0), clip


def venv(**kwargs):
    return make_vec_env(OneStep, 1, env_kwargs=kwargs)


def learn(model, timesteps, callback=None, **kwargs):
    callback = callback or SettleCallback(1000)
    seen = Sizes()
    model.learn(timesteps, [callback, seen], **kwargs)
    return np.array(seen.rows, dtype=float)


@pytest.mark.parametrize("reports", [True, False])
def test_steps_shrink_by_a_fixed_factor_once_a_hundred_episodes_tell(reports):
    model = PPO("MlpPolicy", venv(reports=reports), **PPO_SETTINGS)
    deviation = model.policy.log_std.detach().numpy().copy()
    rates, clips = learn(model, 64 * 5).T
    factors = np.exp(-0.064 * np.array([0, 0, 1, 2, 3]))  # the first 100 end in the second rollout
    np.testing.assert_allclose(rates, 3e-4 * factors, rtol=1e-12)
    np.testing.assert_allclose(clips, 0.05 + 0.15 * factors, rtol=1e-12)
    assert model.logger.name_to_value["train/learning_rate"] == rates[-1]
    assert model.policy.optimizer.param_groups[0]["lr"] == rates[-1]  # the last is for the next
    shrunk = model.policy.log_std.detach().numpy() - deviation
    np.testing.assert_allclose(shrunk, -0.256, atol=5e-3)


def test_steps_stay_where_fewer_succeed():
    for needs, shrinks in ((0.5, True), (0.95, False)):
        model = PPO("MlpPolicy", venv(succeeds_from=100), **PPO_SETTINGS)
        rates, _ = learn(model, 64 * 4, SettleCallback(1000, success=needs)).T
        assert (rates[-1] < 3e-4) == shrinks
    model = PPO("MlpPolicy", venv(succeeds_from=10**9), **PPO_SETTINGS)
    rates, clips = learn(model, 64 * 4).T
    assert set(rates) == {3e-4}
    assert set(clips) == {0.2}


def test_what_infos_do_not_name_has_failed():
    class Seldom(OneStep):
        def step(self, action):
            *outcome, info = super().step(action)
            return *outcome, info if self.n % 10 == 0 else {}

    model = PPO("MlpPolicy", Seldom(), **PPO_SETTINGS)
    model.learn(2_000, SettleCallback(1_000))
    assert model.learning_rate == 3e-4


def test_training_that_begins_anew_counts_anew():
    model = PPO("MlpPolicy", OneStep(), **PPO_SETTINGS)
    model.learn(128, SettleCallback(1_000))
    rate = model.learning_rate
    model.learn(64, SettleCallback(1_000))
    assert model.learning_rate == rate


def test_sizes_have_bounds_but_the_learning_rate():
    model = PPO("MlpPolicy", venv(), **PPO_SETTINGS)
    rates, clips = learn(model, 64 * 6, SettleCallback(10)).T
    assert rates[-1] < 3e-4 * math.exp(-6.4 * 4) * 1.01
    assert clips[-1] == pytest.approx(0.05, abs=1e-9)
    np.testing.assert_allclose(model.policy.log_std.detach(), -3.0, atol=1e-2)


def test_what_is_less_already_stays():
    settings = PPO_SETTINGS | {"learning_rate": 0.0, "policy_kwargs": {"log_std_init": -4.0}}
    model = PPO("MlpPolicy", venv(), **settings | {"clip_range": 0.02})
    _, clips = learn(model, 64 * 4).T
    np.testing.assert_array_equal(model.policy.log_std.detach(), -4.0)
    assert set(clips) == {0.02}


@pytest.mark.parametrize("algorithm", [A2C, PPO])
def test_a_rollout_is_learned_from_with_the_deviation_that_it_was_drawn_with(algorithm):
    settings = {"n_steps": 256, "seed": 0, "device": "cpu"}
    settings |= {"batch_size": 256, "n_epochs": 1} if algorithm is PPO else {}
    model = algorithm("MlpPolicy", venv(), **settings)
    drawn = []

    class Deviations(Sizes):
        def _on_rollout_start(self):
            drawn.append(self.model.policy.log_std.detach().numpy().copy())

        def _on_rollout_end(self):
            np.testing.assert_array_equal(self.model.policy.log_std.detach(), drawn[-1])

    model.learn(256 * 3, [SettleCallback(300), Deviations()])
    assert (drawn[1] < drawn[0] - 0.5).all()


def test_a_model_that_is_loaded_goes_on(tmp_path):
    once = PPO("MlpPolicy", venv(), **PPO_SETTINGS)
    expected = learn(once, 64 * 6)
    model = PPO("MlpPolicy", venv(), **PPO_SETTINGS)
    first = learn(model, 64 * 3)
    model.save(tmp_path / "model")
    loaded = PPO.load(tmp_path / "model", env=venv(), device="cpu")
    assert sizes(loaded) == sizes(model)
    rest = learn(loaded, 64 * 3, reset_num_timesteps=False)
    np.testing.assert_allclose(np.concatenate([first, rest]), expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("algorithm", "settings"),
    [
        (A2C, {}),
        (DQN, {"learning_starts": 10, "buffer_size": 1000}),
        (SAC, {"learning_starts": 10, "buffer_size": 1000, "gradient_steps": 1}),
    ],
)
def test_other_algorithms_have_a_learning_rate(algorithm, settings):
    env = venv(discrete=algorithm is DQN)
    model = algorithm("MlpPolicy", env, seed=0, device="cpu", **settings)
    before = model.learning_rate
    rates, _ = learn(model, 200).T
    assert rates[0] == before
    assert rates[-1] == pytest.approx(before * math.exp(-0.1), rel=0.02)
    optimizer = getattr(model, "actor", model.policy).optimizer
    assert optimizer.param_groups[0]["lr"] == rates[-1]


def test_what_is_no_number_is_refused():
    for name, settings in {
        "timesteps": {"timesteps": 0},
        "success": {"success": 1.5},
    }.items():
        with pytest.raises(ValueError, match=f"`{name}` must be"):
            SettleCallback(**settings)
    for name in ("learning_rate", "clip_range"):
        model = PPO("MlpPolicy", venv(), **PPO_SETTINGS | {name: lambda left: 0.1 * left})
        with pytest.raises(ValueError, match=f"`{name}` must be a number"):
            model.learn(64, SettleCallback())
