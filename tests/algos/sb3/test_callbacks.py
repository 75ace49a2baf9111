import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from logs import read_log
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.callbacks import ConvertCallback
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.logger import configure
from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

from curiosity_algos import CanonicalES
from curiosity_algos.sb3.bonus_wrapper import BonusVecEnvWrapper
from curiosity_algos.sb3.callbacks import (
    BonusCheckpointCallback,
    ExplorationCallback,
    FinalBehaviors,
)
from curiosity_gym import BehaviorWrapper


class Walk(gym.Env):
    """Each episode takes one step more than the one before; from the third on they succeed."""

    observation_space = spaces.Box(0, 10, (1,))
    action_space = spaces.Discrete(2)
    n_episodes = 0

    def reset(self, *, seed=None, options=None):
        self.n_episodes += 1
        self.x = 0
        return np.zeros(1, dtype=np.float32), {}

    def step(self, action):
        self.x += 1
        is_over = self.x == self.n_episodes
        info = {"is_success": self.n_episodes >= 3 and self.x >= 2}
        return np.full(1, self.x, dtype=np.float32), float(self.x), is_over, False, info


class Told(Walk):
    """Tells one behavior where episodes end, and another before that."""

    def __init__(self, end, before, behavior_space=None):
        self.behavior_space, self.end, self.before = behavior_space, end, before

    def step(self, action):
        *step, is_over, is_cut, info = super().step(action)
        behavior = self.end if is_over else self.before
        return *step, is_over, is_cut, info | {"behavior": behavior}


def make_walk(n_episodes=0):
    space, walk = spaces.Box(0, 10, (1,)), Walk()
    walk.n_episodes = n_episodes
    return BehaviorWrapper(walk, lambda env, observation, info: observation, space)


def train(env, n_steps, callback, logger=None):
    model = PPO("MlpPolicy", env, n_steps=n_steps, batch_size=n_steps, n_epochs=1, device="cpu")
    if logger is not None:
        model.set_logger(logger)
    model.learn(n_steps, callback=callback)
    return callback


def test_it_counts_where_episodes_end():
    callback = train(make_vec_env(make_walk), 15, ExplorationCallback())  # 1 + 2 + 3 + 4 + 5 steps
    assert callback.coverage.all == 5 / 50
    assert (callback.first_reward_timesteps, callback.first_success_timesteps) == (1, 6)
    assert callback.best_return == 15.0
    other = train(make_vec_env(make_walk), 2, ExplorationCallback())
    other.load_state_dict(callback.state_dict())
    assert other.coverage.all == 5 / 50
    assert (other.first_success_timesteps, other.best_return) == (6, 15.0)


def test_it_counts_those_episodes_that_have_ended():
    # Of 1, 2 and 3 steps; of 5 steps, in which it succeeds from the second on.
    before = iter([0, 4])
    venv = make_vec_env(lambda: make_walk(next(before)), n_envs=2)
    callback = train(venv, 6, ExplorationCallback())
    assert callback.coverage.all == 4 / 50
    assert (callback.first_reward_timesteps, callback.first_success_timesteps) == (2, 10)
    assert callback.best_return == 15.0


def test_a_bad_episode_is_no_reward():
    venv = make_vec_env(lambda: gym.wrappers.TransformReward(make_walk(), lambda reward: -reward))
    callback = train(venv, 3, ExplorationCallback())  # of 1 and 2 steps
    assert callback.best_return == -1.0
    assert (callback.first_reward_timesteps, callback.first_success_timesteps) == (None, None)


@pytest.mark.parametrize("number", [np.nan, np.inf])
def test_where_an_episode_ends_must_be_finite(number):
    finite, other, space = np.ones(1), np.full(1, number), spaces.Box(0, 10, (1,))
    # On its way it may be unknown.
    callback = train(make_vec_env(lambda: Told(finite, other, space)), 15, ExplorationCallback())
    assert callback.coverage.all == 1 / 50
    with pytest.raises(ValueError, match="`env` must give finite behaviors"):
        train(make_vec_env(lambda: Told(other, finite, space)), 15, ExplorationCallback())


def test_final_behaviors_are_those_of_the_last_steps():
    ends = train(make_vec_env(make_walk), 15, FinalBehaviors())
    assert ends.behaviors.tolist() == [[1], [2], [3], [4], [5]]
    ends = train(make_vec_env(Walk), 15, FinalBehaviors())  # which have none
    assert ends.behaviors.shape == (0, 0)
    ends, seen = FinalBehaviors(), []
    model = CanonicalES(make_walk, population_size=3, n_parents=1, policy_kwargs={"net_arch": [2]})
    see = ConvertCallback(lambda values, _: seen.append(values["rollouts"].behaviors))
    model.learn(8, callback=[ends, see])
    np.testing.assert_array_equal(ends.behaviors, np.concatenate(seen))


@pytest.mark.parametrize("behavior", [np.array([np.nan]), np.zeros(2)])
def test_a_final_behavior_unlike_the_first_is_named_at_once(behavior):
    class Odd(Walk):
        def step(self, action):
            *step, info = super().step(action)
            is_late = self.n_episodes > 2
            return *step, info | {"behavior": behavior if is_late else np.zeros(1)}

    with pytest.raises(ValueError, match=r"`env` must .*behavior"):
        train(make_vec_env(Odd), 15, FinalBehaviors())


def test_it_counts_the_cells_of_every_step():
    kwargs = {"layout": "us", "horizon": 10, "max_acceleration": 100.0}
    venv = make_vec_env("CuriosityMaze-v0", n_envs=2, env_kwargs=kwargs)
    venv = BonusVecEnvWrapper(venv, bonus="rnd", seed=0)
    oracles = [gym.make("CuriosityMaze-v0", **kwargs) for _ in range(2)]
    grid, cells, callback = oracles[0].unwrapped.coverage_grid, set(), ExplorationCallback()

    def step(local, _):
        for oracle, action, done in zip(
            oracles, local["clipped_actions"], local["dones"], strict=True
        ):
            cells.add(grid.cells(oracle.step(action)[-1]["behavior"][None]).item())
            if done:
                oracle.reset()
        return True

    for oracle in oracles:
        oracle.reset()
    model = PPO("MlpPolicy", venv, n_steps=25, batch_size=50, n_epochs=1, seed=0, device="cpu")
    model.learn(100, [callback, ConvertCallback(step)])
    assert callback.coverage_shares["visited"] == len(cells) / grid.reachable.sum()
    assert len(cells) > 2


def test_where_nothing_is_counted_a_behavior_may_be_anything():
    venv = make_vec_env(lambda: Told("walking", "running"))
    callback = train(venv, 15, ExplorationCallback())
    assert (callback.coverage.all, callback.best_return) == (None, 15.0)


def test_there_may_be_nothing_to_count():
    callback = train(make_vec_env("CartPole-v1"), 100, ExplorationCallback())
    assert callback.coverage.all is None
    assert callback.first_success_timesteps is None
    assert 0 < callback.first_reward_timesteps < 100
    assert callback.best_return > 0


def test_it_logs_what_a_wrapper_pays_and_learns(tmp_path):
    logger = configure(str(tmp_path), ["json"])
    venv = BonusVecEnvWrapper(make_vec_env("CartPole-v1"), bonus="rnd", train_interval=50, seed=0)
    train(VecMonitor(venv), 100, ExplorationCallback(), logger)
    logged = read_log(tmp_path)[-1]
    assert 0 < logged["intrinsic/mean"] < logged["intrinsic/max"] <= 10
    assert logged["rnd/loss"] == venv.metrics["rnd/loss"]


def test_what_an_off_policy_algorithm_is_paid_is_that_of_all_steps_since_the_last_log(tmp_path):
    venv = make_vec_env("Pendulum-v1")
    venv = BonusVecEnvWrapper(venv, bonus="rnd", train_interval=50, seed=0, device="cpu")
    model = SAC("MlpPolicy", venv, learning_starts=500, seed=0, device="cpu")
    model.set_logger(configure(str(tmp_path), ["json"]))
    paid = []

    def keep(local, _):
        paid.append(local["infos"][0]["reward_intrinsic"])
        return True

    model.learn(400, [ConvertCallback(keep), ExplorationCallback()], log_interval=1)
    rows = read_log(tmp_path)
    for row, part in zip(rows, (paid[:200], paid[200:]), strict=True):  # episodes of 200 steps
        assert row["intrinsic/mean"] == pytest.approx(np.mean(part))
        assert row["intrinsic/max"] == np.max(part) > row["intrinsic/mean"]


def test_the_log_of_an_episode_has_its_cell(tmp_path):
    walk = make_walk()
    walk.unwrapped.action_space = spaces.Box(-1, 1, (1,))
    schedule = {"train_freq": (1, "episode"), "learning_starts": 100, "buffer_size": 100}
    model = TD3("MlpPolicy", walk, **schedule, device="cpu")
    model.set_logger(configure(str(tmp_path), ["json"]))
    model.learn(15, ExplorationCallback(), log_interval=1)
    rows = read_log(tmp_path)
    assert [row["coverage/all"] for row in rows] == [n / 50 for n in (1, 2, 3, 4, 5)]


def wrapped():
    venv = make_vec_env("Pendulum-v1", n_envs=2)
    settings = {"train_interval": 50, "n_updates": 2, "batch_size": 8, "device": "cpu"}
    return BonusVecEnvWrapper(venv, bonus="rnd", **settings)


class TestCheckpoints:
    def test_each_model_has_its_wrapper(self, tmp_path, assert_same):
        venv = VecNormalize(wrapped())
        folder = tmp_path / "runs"
        callback = BonusCheckpointCallback(60, str(folder), save_vecnormalize=True)
        states, save = [], venv.venv.save
        venv.venv.save = lambda path: states.append(venv.venv.state_dict()) or save(path)
        train(venv, 80, callback)
        names = ["_120_steps.zip", "_bonus_120_steps.npz", "_vecnormalize_120_steps.pkl"]
        assert sorted(path.name for path in folder.iterdir()) == [f"rl_model{n}" for n in names]
        inner = make_vec_env("Pendulum-v1", n_envs=2)
        loaded = BonusVecEnvWrapper.load(folder / f"rl_model{names[1]}", inner)
        assert_same(loaded.state_dict(), states[0])

    def test_a_killed_run_leaves_no_model_without_its_wrapper(self, tmp_path):
        venv = wrapped()
        venv.save = lambda path: (_ for _ in ()).throw(OSError("no space"))
        with pytest.raises(OSError, match="no space"):
            train(venv, 80, BonusCheckpointCallback(20, str(tmp_path)))
        assert not list(tmp_path.iterdir())

    def test_without_a_wrapper_it_would_save_none(self, tmp_path):
        with pytest.raises(ValueError, match="`env` must be wrapped in a BonusVecEnvWrapper"):
            train(make_vec_env("Pendulum-v1"), 10, BonusCheckpointCallback(5, str(tmp_path)))


@pytest.mark.parametrize("kind", ["exploration", "checkpoint"])
def test_a_model_that_has_trained_is_warned_of_a_new_wrapper(kind, tmp_path):
    venv = wrapped()
    model = PPO("MlpPolicy", venv, n_steps=80, batch_size=80, n_epochs=1, device="cpu")
    model.learn(160).save(tmp_path / "model")
    venv.save(tmp_path / "bonus.npz")
    callback = {
        "exploration": ExplorationCallback(),
        "checkpoint": BonusCheckpointCallback(1000, str(tmp_path)),
    }[kind]
    settings = {"total_timesteps": 160, "callback": callback, "reset_num_timesteps": False}
    with pytest.warns(UserWarning, match="has trained, and its BonusVecEnvWrapper is new"):
        PPO.load(tmp_path / "model", wrapped(), device="cpu").learn(**settings)
    inner = make_vec_env("Pendulum-v1", n_envs=2)
    loaded = BonusVecEnvWrapper.load(tmp_path / "bonus.npz", inner, device="cpu")
    with warnings.catch_warnings(action="error"):
        PPO.load(tmp_path / "model", loaded, device="cpu").learn(**settings)
