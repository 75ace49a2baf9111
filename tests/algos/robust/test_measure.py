"""The share of unseen starts from which a policy succeeds."""

import math
from functools import partial

import gymnasium as gym
import numpy as np
import pytest
import torch as th
from gymnasium import spaces
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers import TimeLimit, TransformAction
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize
from walk import Right, Walk

from curiosity_algos.robust import measure
from curiosity_algos.robust.demonstrations import demonstrate
from curiosity_algos.robust.measure import (
    N_COMPARED,
    N_STARTS,
    Starts,
    evaluate_starts,
    n_different,
)
from curiosity_algos.sb3.gymnasium_vec_env import native_batch
from curiosity_gym import BehaviorWrapper, RecordEpisode


@pytest.mark.parametrize(("k", "n"), [(0, 10), (93, 100), (7, 7)])
def test_the_interval_is_wilsons(k, n):
    starts = Starts(np.arange(n) < k, np.zeros(n))
    z, p = 1.959963984540054, k / n
    middle = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    assert starts.share == p
    assert starts.interval == pytest.approx((middle - half, middle + half), abs=1e-9)
    assert str(starts).startswith(f"{k} of {n} starts (95 % interval ")


def test_every_start_is_another_and_each_seed_its_own():
    reached, missed = evaluate_starts(Right(), Walk(), 20), evaluate_starts(Right(0.1), Walk(), 5)
    assert reached.success.all()
    assert not missed.success.any()
    slow = [evaluate_starts(Right(0.34), Walk(), 20, seed=seed).success for seed in (0, 1)]
    assert 0 < slow[0].mean() < 1
    np.testing.assert_array_equal(slow[0][1:], slow[1][:-1])


def test_mistakes_are_one_sentence():
    with pytest.raises(ValueError, match="`model` must have `predict`, got NoneType"):
        evaluate_starts(None, Walk())
    with pytest.raises(ValueError, match="`n`"):
        evaluate_starts(Right(), Walk(), 0)
    with pytest.raises(ValueError, match="`seed`"):
        evaluate_starts(Right(), Walk(), seed=-1)
    with pytest.raises(ValueError, match="`deterministic`"):
        evaluate_starts(Right(), Walk(), deterministic="no")
    for env in (DummyVecEnv([Walk]), None, list):
        with pytest.raises(ValueError, match="`env` must be an id, an environment or a function"):
            evaluate_starts(Right(), env)
    model = PPO("MlpPolicy", Walk(), device="cpu")
    with pytest.raises(ValueError, match="`env` must have the observation_space of the model"):
        evaluate_starts(model, gym.make("Pendulum-v1"))
    with pytest.raises(ValueError, match="`env` must have the action_space of the model"):
        evaluate_starts(model, partial(TransformAction, Walk(), abs, Box(-1, 1, (2,))))
    model.set_env(VecNormalize(DummyVecEnv([Walk])))
    with pytest.raises(ValueError, match="`model` must see observations as `env` gives them"):
        evaluate_starts(model, Walk())


@pytest.mark.parametrize("change", ["horizon", "limits"])
def test_an_environment_is_tested_as_it_is(change):
    maze = {"layout": "open-2x2-seed1", "start_radius": 60.0, "goal_radius": 150.0}
    if change == "horizon":
        env = gym.make("CuriosityMaze-v0", **maze)
        env.unwrapped.horizon = 2
    else:
        env = TimeLimit(gym.make("CuriosityMaze-v0", max_episode_steps=2, **maze), 800)
    assert native_batch(env, 8, AutoresetMode.NEXT_STEP) is None
    plain = gym.make("CuriosityMaze-v0", **maze)
    assert native_batch(RecordEpisode(plain), 8, AutoresetMode.NEXT_STEP) is not None


def test_texts_of_one_start_are_the_same():
    class Told(Walk):
        observation_space = spaces.Dict(x=Walk.observation_space, said=spaces.Text(9))

        def reset(self, *, seed=None, options=None):
            super().reset(seed=seed)
            self.x = 0.0
            return self._observation(), {}

        def _observation(self):
            return {"x": super()._observation(), "said": "go"}

    assert n_different(Told()) == 1


def test_two_starts_are_seen():
    class Coin(Walk):
        def reset(self, *, seed=None, options=None):
            super().reset(seed=seed)
            self.x = float(self.np_random.integers(2))
            return self._observation(), {}

    assert n_different(Coin()) == N_STARTS


def test_chance_may_come_late_in_an_episode():
    class Late(Walk):
        """Pushes back after as many steps as are compared."""

        def reset(self, *, seed=None, options=None):
            super().reset(seed=seed)
            self.x, self.push = 0.0, self.np_random.random()
            return self._observation(), {}

        def step(self, action):
            self.x -= self.push * (self.t == N_COMPARED)
            return super().step(action)

    env = Late()
    assert n_different(env) == 1
    slow = demonstrate(Right(0.35), Walk(), seed=2)
    assert len(slow) > N_COMPARED
    assert n_different(env, [slow]) == N_STARTS
    assert n_different(Walk(), [slow]) == N_STARTS


def test_seeds_may_be_numpys():
    assert evaluate_starts(Right(), Walk(), 2, seed=np.int64(3)).success.all()


def test_images_may_have_their_channels_first():
    class Seen(Walk):
        observation_space = Box(0, 255, (36, 48, 3), np.uint8)

        def _observation(self):
            return np.full((36, 48, 3), self.t, np.uint8)

    env = Seen()
    model = PPO("CnnPolicy", env, n_steps=8, device="cpu")
    assert model.observation_space.shape == (3, 36, 48)
    assert len(evaluate_starts(model, env, 1).success) == 1


def test_actions_may_be_numbers_that_are_looked_up():
    env = gym.make("FrozenLake-v1", is_slippery=False)
    model = PPO("MlpPolicy", env, n_steps=8, device="cpu")
    assert len(evaluate_starts(model, env, 1).success) == 1


def test_actions_may_be_drawn_as_in_training(monkeypatch):
    model, seeded = PPO("MlpPolicy", Walk(), seed=0, device="cpu"), []
    monkeypatch.setattr(th.cuda, "manual_seed_all", seeded.append)  # of who trains on a GPU
    before = th.get_rng_state()
    drawn = [evaluate_starts(model, Walk, 3, deterministic=False).returns for _ in range(2)]
    np.testing.assert_array_equal(*drawn)
    assert th.equal(th.get_rng_state(), before)
    assert not seeded

    class Drawn(Right):
        def predict(self, observation, deterministic=True):
            return super().predict(observation)[0] * (0.1 if deterministic else 1.0), None

    assert evaluate_starts(Drawn(), Walk, 3, deterministic=False).success.all()
    assert not evaluate_starts(Drawn(), Walk, 3).success.any()


class Shake:
    """Moves the cup hither and thither with full strength, as if at random."""

    def predict(self, observation, deterministic=True):
        return np.sign(np.sin(1e3 * observation[..., :2])).astype(np.float32), None


def test_starts_that_are_all_the_same_are_said_to_be(recwarn):
    short = {"horizon": 40}
    assert np.ptp(evaluate_starts(Right(0.0), Walk(), 3).returns) == 0.0  # of different starts
    evaluate_starts(Shake(), gym.make("CuriosityMaze-Hard-v0", start_radius=20.0, **short), 3)
    evaluate_starts(Shake(), gym.make("CuriosityMaze-Hard-v0", **short), 1)
    assert not recwarn
    with pytest.warns(UserWarning, match=r"`env` seems to have one start: the 3 episodes"):
        evaluate_starts(Shake(), gym.make("CuriosityMaze-Hard-v0", **short), 3)


def test_a_batch_counts_as_single_environments_do():
    env = gym.make("CuriosityControl-BallInCup-v0", random_start=True, horizon=150)
    twin = BehaviorWrapper(env, lambda env, observation, info: observation[:1], Box(-9, 9, (1,)))
    batch, one_by_one = evaluate_starts(Shake(), env, 12), evaluate_starts(Shake(), twin, 12)
    assert 0 < batch.share < 1
    np.testing.assert_array_equal(batch.success, one_by_one.success)
    np.testing.assert_allclose(batch.returns, one_by_one.returns)


class Ends:
    """Two episodes side by side: the first fails, and another begins that would succeed."""

    num_envs = 2

    def reset(self, **_):
        self.t = 0
        return np.zeros((2, 1)), {}

    def step(self, actions):
        self.t += 1
        success = np.array([self.t == 3, self.t == 4])
        ended = success | [self.t == 1, False]
        return np.zeros((2, 1)), 1.0 * success, ended, ended & False, {"is_success": success}


def test_of_a_batch_only_first_episodes_count():
    starts = measure._play_batch(Right(), Ends(), 0, True)
    np.testing.assert_array_equal(starts.success, [False, True])
    np.testing.assert_array_equal(starts.returns, [0.0, 1.0])


class Counting:
    """Walks to the goal once it remembers ten steps of the episode."""

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        steps = np.zeros(len(np.atleast_2d(observation))) if state is None else state[0]
        if episode_start is not None:
            steps = np.where(episode_start, 0.0, steps)
        return (steps >= 10).astype(np.float32), (steps + 1,)


def test_a_policy_remembers_its_episode():
    assert evaluate_starts(Counting(), Walk(), 5).success.all()


@pytest.mark.parametrize(
    ("make", "n"),
    [
        (partial(gym.make, "CuriosityMaze-Hard-v0"), 1),
        (partial(gym.make, "CuriosityMaze-Hard-v0", start_radius=20), N_STARTS),
        (Walk, N_STARTS),
        (partial(gym.make, "FrozenLake-v1"), N_STARTS),  # one start, on slippery ice
        (partial(gym.make, "FrozenLake-v1", is_slippery=False), 1),
    ],
)
def test_one_episode_is_enough_where_chance_has_no_part(make, n):
    env = make()
    assert n_different(env) == n
    env.close()
