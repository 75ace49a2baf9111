import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces, wrappers
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import (
    DummyVecEnv,
    SubprocVecEnv,
    VecFrameStack,
    VecMonitor,
    VecNormalize,
)

from curiosity_algos import CanonicalES, CuriosityES, make_evaluator
from curiosity_algos.evaluation.base import Evaluator
from curiosity_algos.evaluation.environments import GymnasiumView
from curiosity_algos.evaluation.maze import MazeEvaluator
from curiosity_algos.evaluation.mlp import act
from curiosity_algos.evaluation.rollouts import Rollouts
from curiosity_algos.evaluation.vector import VectorEvaluator
from curiosity_gym.maze.maze_env import MazeEnv
from curiosity_gym.maze.vector_env import MazeVectorEnv

HARD = "CuriosityMaze-Hard-v0"
SMALL = {"net_arch": [4]}

PLAIN = {
    "id": lambda: HARD,
    "env": lambda: gym.make(HARD),
    "bare": lambda: MazeEnv("hard"),
    "function": lambda: lambda: MazeEnv("hard"),
    "monitor": lambda: Monitor(gym.make(HARD)),
    "make_vec": lambda: gym.make_vec(HARD, num_envs=2),
    "make_vec_env": lambda: make_vec_env(HARD, n_envs=2),
    "vec_monitor": lambda: VecMonitor(DummyVecEnv([lambda: gym.make(HARD)])),
}


class TwiceRewarded(MazeEnv):
    def step(self, action):
        observation, reward, *rest = super().step(action)
        return observation, 2.0 * reward + 1.0, *rest


class HalfSteered(MazeVectorEnv):
    def step(self, actions):
        return super().step(0.5 * actions)


class HalfLimit(wrappers.TimeLimit):
    def step(self, action):
        return super().step(0.5 * action)


class Repeat(gym.Wrapper):
    """Each action for two steps; nothing in it says how it was made."""

    def step(self, action):
        result = self.env.step(action)
        return result if result[2] or result[3] else self.env.step(action)


CHANGES = {
    "ClipReward": lambda env: wrappers.ClipReward(env, -0.1, 0.1),
    "TransformReward": lambda env: wrappers.TransformReward(env, lambda reward: reward - 1.0),
    "TransformObservation": lambda env: wrappers.TransformObservation(
        env, lambda observation: -observation, env.observation_space
    ),
    "TransformAction": lambda env: wrappers.TransformAction(
        env, lambda action: -action, env.action_space
    ),
    "a limit's subclass": lambda env: HalfLimit(env, 10),
    "RescaleAction": lambda env: wrappers.RescaleAction(env, np.float32(-0.5), np.float32(0.5)),
    "Repeat": Repeat,
    "subclass": lambda env: TwiceRewarded(env.unwrapped.layout, horizon=64),
}


@pytest.mark.parametrize("kind", PLAIN)
def test_mazes_run_compiled(kind):
    evaluator = make_evaluator(PLAIN[kind](), SMALL)
    assert isinstance(evaluator, MazeEvaluator)
    assert evaluator.n_parameters == 37 * 4 + 5 * 2
    np.testing.assert_array_equal(evaluator.known.task.start, MazeEnv("hard").maze.start)


@pytest.mark.parametrize(
    ("change", "outside"),
    [*((change, lambda env: env) for change in CHANGES), ("subclass", Monitor)],
)
def test_changed_mazes_keep_their_change(
    change, outside, make_easy_maze, play, assert_equal_episodes
):
    env = outside(CHANGES[change](make_easy_maze()))
    evaluator = make_evaluator(env, SMALL)
    assert isinstance(evaluator, VectorEvaluator)
    rng = np.random.default_rng(0)
    parameters = rng.normal(0, 1, (4, evaluator.n_parameters)).astype(np.float32)
    rollouts = evaluator.evaluate(parameters, 0)
    oracle = CHANGES[change](make_easy_maze())
    assert_equal_episodes(rollouts, play(oracle, evaluator.mlp, parameters, 0))


LIMITS = {
    "one": lambda env: wrappers.TimeLimit(env, 30),
    "none that counts": lambda env: wrappers.TimeLimit(env, 1000),
    "monitored": lambda env: Monitor(wrappers.TimeLimit(env, 30)),
    "dummy": lambda env: DummyVecEnv([lambda: wrappers.TimeLimit(env, 30)]),
    "native vector": lambda env: gym.make_vec(
        "CuriosityMaze-v0",
        num_envs=2,
        vectorization_mode="vector_entry_point",
        layout=env.unwrapped.layout,
        horizon=64,
        max_episode_steps=30,
    ),
}


@pytest.mark.parametrize("kind", LIMITS)
def test_mazes_within_a_time_limit_run_compiled(kind, make_easy_maze, play, assert_equal_episodes):
    evaluator = make_evaluator(LIMITS[kind](make_easy_maze()), {"net_arch": []})
    assert isinstance(evaluator, MazeEvaluator)
    rng = np.random.default_rng(0)
    parameters = rng.normal(0, 1, (40, evaluator.n_parameters)).astype(np.float32)
    rollouts = evaluator.evaluate(parameters, 0)
    limit = 64 if kind == "none that counts" else 30
    oracle = wrappers.TimeLimit(make_easy_maze(), limit)
    assert_equal_episodes(rollouts, play(oracle, evaluator.mlp, parameters, 0))
    assert rollouts.lengths.max() == rollouts.actions.shape[1] == limit
    assert rollouts.success.any()


def test_mazes_of_different_limits_are_not_taken_for_one():
    makers = [lambda n=n: wrappers.TimeLimit(gym.make(HARD), n) for n in (5, 7)]
    evaluator = make_evaluator(DummyVecEnv(makers), SMALL)
    rollouts = evaluator.evaluate(np.zeros((2, evaluator.n_parameters)))
    np.testing.assert_array_equal(rollouts.lengths, [5, 7])


def test_changed_vector_mazes_keep_their_change():
    env = HalfSteered("hard", num_envs=2, horizon=20)
    evaluator = make_evaluator(env, SMALL)
    rng = np.random.default_rng(0)
    parameters = rng.normal(0, 0.1, (2, evaluator.n_parameters)).astype(np.float32)
    plain = make_evaluator(MazeEnv("hard", horizon=20), SMALL).evaluate(parameters)
    assert not np.array_equal(evaluator.evaluate(parameters).behaviors, plain.behaviors)


@pytest.mark.parametrize("env", ["CartPole-v1", "Pendulum-v1"])
def test_other_envs_run_in_batches(env):
    evaluator = make_evaluator(env, SMALL)
    rollouts = evaluator.evaluate(np.zeros((3, evaluator.n_parameters), dtype=np.float32), 0)
    assert (rollouts.lengths == (200 if env == "Pendulum-v1" else rollouts.lengths[0])).all()
    assert rollouts.behaviors.shape == (3, 0)


def test_a_vector_env_of_single_mazes_is_taken_as_it_is():
    env = SyncVectorEnv([lambda: wrappers.TimeLimit(gym.make(HARD), 5)] * 2)
    evaluator = make_evaluator(env, SMALL)
    rollouts = evaluator.evaluate(np.zeros((3, evaluator.n_parameters), dtype=np.float32))
    np.testing.assert_array_equal(rollouts.lengths, [5, 5, 5])


@pytest.mark.parametrize("wrapper", [VecNormalize, lambda env: VecFrameStack(env, 2)])
def test_wrapped_vec_envs_are_refused(wrapper):
    env = wrapper(DummyVecEnv([lambda: gym.make("CartPole-v1")]))
    with pytest.raises(ValueError, match=r"`env` is wrapped in Vec(Normalize|FrameStack)"):
        make_evaluator(env)


NORMALIZED = {
    "observations": lambda: wrappers.NormalizeObservation(gym.make("CartPole-v1")),
    "rewards": lambda: wrappers.TimeLimit(wrappers.NormalizeReward(gym.make("CartPole-v1")), 9),
}
ENVS = {
    "env": lambda make: make(),
    "function": lambda make: make,
    "SyncVectorEnv": lambda make: SyncVectorEnv([make] * 2),
    "AsyncVectorEnv": lambda make: AsyncVectorEnv([make] * 2),
    "DummyVecEnv": lambda make: DummyVecEnv([make] * 2),
    "SubprocVecEnv": lambda make: SubprocVecEnv([make] * 2, start_method="fork"),
}


@pytest.mark.parametrize("kind", ENVS)
@pytest.mark.parametrize("what", NORMALIZED)
def test_running_statistics_are_refused(what, kind):
    env = ENVS[kind](NORMALIZED[what])
    try:
        with pytest.raises(ValueError, match=r"`env` must be in no .*pass `normalize_observations"):
            make_evaluator(env)
    finally:
        getattr(env, "close", lambda: None)()


def test_statistics_that_stay_are_as_good_as_none():
    env = NORMALIZED["observations"]()
    env.update_running_mean = False
    assert make_evaluator(wrappers.TimeLimit(env, 9), SMALL).evaluate(np.zeros((2, 30))).timesteps


@pytest.mark.parametrize("env", [3, gym.make, lambda: 3])
def test_what_is_no_environment_is_refused(env):
    with pytest.raises(ValueError, match="`env` must be an environment id"):
        make_evaluator(env)


@pytest.mark.parametrize("n_threads", [0, 1.5])
def test_threads_are_at_least_one(n_threads):
    with pytest.raises(ValueError, match="`n_threads` must be"):
        make_evaluator(HARD, n_threads=n_threads)


@pytest.mark.parametrize(
    ("policy_kwargs", "message"),
    [
        ({"activation_fn": "tanh"}, r"`policy_kwargs` may hold `net_arch` alone"),
        ({"net_arch": {"pi": [4], "qf": [4]}}, r"`net_arch` must be a list"),
        ({"net_arch": [0]}, r"`net_arch` must be a whole number of at least 1"),
    ],
)
def test_policy_kwargs_are_checked(policy_kwargs, message):
    with pytest.raises(ValueError, match=message):
        make_evaluator(HARD, policy_kwargs)


def test_a_wrapped_vector_env_is_refused():
    envs = gym.make_vec("Pendulum-v1", num_envs=2, vectorization_mode="sync")
    wrapped = gym.wrappers.vector.TransformReward(envs, lambda rewards: rewards + 1.0)
    with pytest.raises(ValueError, match="`env` is wrapped in TransformReward"):
        make_evaluator(wrapped)


def test_different_mazes_in_one_vec_env_are_not_taken_for_one():
    names = ("Hard", "Snake")
    makers = [lambda n=name: gym.make(f"CuriosityMaze-{n}-v0", horizon=5) for name in names]
    assert isinstance(make_evaluator(DummyVecEnv([makers[0]] * 2)), MazeEvaluator)
    rollouts = make_evaluator(DummyVecEnv(makers)).evaluate(np.zeros((2, 1746)))
    starts = [maker().reset()[0] for maker in makers]
    np.testing.assert_array_equal(rollouts.observations[:, 0], starts)


def test_the_single_env_of_a_vector_env_has_its_keywords():
    envs = gym.make_vec(
        "CuriosityMaze-Hard-v0",
        num_envs=2,
        vectorization_mode="vector_entry_point",
        horizon=7,
        max_episode_steps=6,
        n_beams=5,
    )
    env = GymnasiumView(envs).envs[0]
    assert (env.unwrapped.horizon, env.observation_space.shape) == (7, (9,))
    env.reset()
    ends = [env.step(np.zeros(2, dtype=np.float32))[3] for _ in range(6)]
    assert ends == [False] * 5 + [True]


class Target(gym.Env):
    """One step, rewarded by how near the action is to .5."""

    observation_space = spaces.Box(-1.0, 1.0, (1,))
    action_space = spaces.Box(-1.0, 1.0, (1,))

    def reset(self, *, seed=None, options=None):
        return np.ones(1, dtype=np.float32), {}

    def step(self, action):
        return np.zeros(1, dtype=np.float32), -abs(float(action[0]) - 0.5), True, False, {}


class TargetEvaluator(Evaluator):
    """All individuals' steps at once."""

    def __init__(self, mlp):
        self.mlp = mlp
        self.n_parameters = mlp.n_parameters

    def evaluate(self, parameters, seed=None):
        n = len(parameters)
        actions = act(self.mlp, parameters, np.ones((n, 1)))
        return Rollouts(
            returns=-np.abs(actions[:, 0].astype(np.float64) - 0.5),
            lengths=np.ones(n, dtype=np.int64),
            success=np.zeros(n, dtype=np.bool_),
            terminated=np.zeros(n, dtype=np.bool_),
            behaviors=np.empty((n, 0)),
            final_observations=np.zeros((n, 1), dtype=np.float32),
        )


def test_an_algorithm_learns_the_same_with_an_evaluator_of_ones_own():
    settings = {"population_size": 6, "n_parents": 3, "seed": 0}
    plain = CanonicalES(Target(), **settings).learn(60)
    own = TargetEvaluator(plain.policy.mlp)
    model = CanonicalES(Target(), evaluator=own, **settings).learn(60)
    assert model.best_return == plain.best_return < 0.0
    np.testing.assert_array_equal(model.policy.vector, plain.policy.vector)
    curious = CuriosityES(Target(), evaluator=own, device="cpu", **settings)
    with pytest.raises(ValueError, match="no trajectories: `evaluator` must give them"):
        curious.learn(60)
