import gymnasium as gym
import numpy as np
import pytest
from gymnasium import wrappers
from gymnasium.vector import AsyncVectorEnv
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecFrameStack, VecMonitor, VecNormalize

from curiosity_algos import make_evaluator
from curiosity_algos.evaluation.maze import MazeEvaluator
from curiosity_algos.evaluation.vector import VectorEvaluator
from curiosity_gym.maze.maze_env import MazeEnv

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


class HalfLimit(wrappers.TimeLimit):
    def step(self, action):
        return super().step(0.5 * action)


class Repeat(gym.Wrapper):
    """Each action for two steps; nothing in it says how it was made."""

    def step(self, action):
        result = self.env.step(action)
        return result if result[2] or result[3] else self.env.step(action)


CHANGES = {
    "TransformReward": lambda env: wrappers.TransformReward(env, lambda reward: reward - 1.0),
    "TransformObservation": lambda env: wrappers.TransformObservation(
        env, lambda observation: -observation, env.observation_space
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
    "one": lambda env: Monitor(wrappers.TimeLimit(env, 30)),
    "none that counts": lambda env: wrappers.TimeLimit(env, 1000),
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
    assert 0 < rollouts.success.sum() < 40


WRAPPED = [
    lambda: VecMonitor(VecNormalize(make_vec_env("CartPole-v1", 1))),
    lambda: VecFrameStack(make_vec_env("CartPole-v1", 1), 2),
    lambda: wrappers.vector.ClipReward(gym.make_vec("Pendulum-v1", 2, "sync"), 0.0, 1.0),
]


@pytest.mark.parametrize("make", WRAPPED)
def test_wrapped_batches_of_envs_are_refused(make):
    with pytest.raises(ValueError, match=r"`env` is wrapped in (VecNormalize|VecFrame|ClipReward)"):
        make_evaluator(make())


NORMALIZED = {
    "observations": lambda: wrappers.NormalizeObservation(gym.make("CartPole-v1")),
    "rewards": lambda: wrappers.TimeLimit(wrappers.NormalizeReward(gym.make("CartPole-v1")), 9),
}
ENVS = {
    "env": lambda make: make(),
    "function": lambda make: make,
    "AsyncVectorEnv": lambda make: AsyncVectorEnv([make] * 2),
    "DummyVecEnv": lambda make: DummyVecEnv([make] * 2),
}


@pytest.mark.parametrize(
    ("what", "kind"), [*(("observations", kind) for kind in ENVS), ("rewards", "env")]
)
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


@pytest.mark.parametrize(
    ("env", "given", "message"),
    [
        (3, {}, "`env` must be an environment id"),
        (lambda: 3, {}, "`env` must be an environment id"),
        (HARD, {"n_threads": 0}, "`n_threads` must be"),
        (HARD, {"policy_kwargs": {"activation_fn": "tanh"}}, "may hold `net_arch` alone"),
        (HARD, {"policy_kwargs": {"net_arch": {"pi": [4]}}}, "`net_arch` must be a list"),
        (HARD, {"policy_kwargs": {"net_arch": [0]}}, "`net_arch` must be a whole number"),
    ],
)
def test_errors_name_the_argument(env, given, message):
    with pytest.raises(ValueError, match=message):
        make_evaluator(env, **given)
