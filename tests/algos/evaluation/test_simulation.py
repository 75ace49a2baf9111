from types import SimpleNamespace

import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv

from curiosity_algos import make_evaluator
from curiosity_algos.evaluation import simulation
from curiosity_algos.evaluation.base import KnownTask
from curiosity_algos.evaluation.evaluator import known_task
from curiosity_algos.evaluation.mlp import build_mlp
from curiosity_algos.evaluation.simulation import SimulationEvaluator
from curiosity_algos.evaluation.vector import VectorEvaluator
from curiosity_gym.control.simulation import Simulation
from curiosity_gym.core import SimulationError

pytestmark = pytest.mark.extra("control", "locomotion")

NAMES = {"BallInCup": 0.5, "Finger": 1.0, "Stacker": 0.3}
"""A task, and a deviation of policies of which some succeed within `HORIZON` steps."""
HORIZON = 400


def make(name, n_individuals=24, net_arch=(8,), **kwargs):
    """The env, and policies."""
    env = gym.make(f"CuriosityControl-{name}-v0", **({"horizon": HORIZON} | kwargs))
    mlp = build_mlp(env.observation_space, env.action_space, net_arch)
    rng = np.random.default_rng(0)
    parameters = rng.normal(0, NAMES[name], (n_individuals, mlp.n_parameters))
    return env, mlp, parameters.astype(np.float32)


def evaluate(env, mlp, parameters, n_threads=None, seed=None):
    return SimulationEvaluator(known_task(env), mlp, n_threads).evaluate(parameters, seed)


@pytest.mark.parametrize("name", NAMES)
def test_equals_a_loop_over_the_env(name, play, assert_equal_episodes):
    env, mlp, parameters = make(name)
    rollouts = evaluate(env, mlp, parameters)
    assert_equal_episodes(rollouts, play(env, mlp, parameters))
    assert len(np.unique(rollouts.behaviors, axis=0)) > len(parameters) / 2


class TestRandomStarts:
    @pytest.mark.parametrize("name", ["BallInCup", "Finger"])
    def test_are_those_of_the_envs_reset_with_the_seed(self, name, play, assert_equal_episodes):
        env, mlp, parameters = make(name, 5, horizon=100, random_start=True)
        for seed in (3, 4):
            rollouts = evaluate(env, mlp, parameters, seed=seed)
            assert_equal_episodes(rollouts, play(env, mlp, parameters, seed))

    def test_are_the_same_for_all_individuals_in_all_waves(self, monkeypatch, assert_same_rollouts):
        env, mlp, parameters = make("BallInCup", 7, horizon=40, random_start=True)
        whole = evaluate(env, mlp, parameters, seed=5)
        assert len(np.unique(whole.observations[:, 0], axis=0)) == 1
        monkeypatch.setattr(simulation, "MAX_SIMULATIONS", 3)
        for threads in (1, 2):
            assert_same_rollouts(whole, evaluate(env, mlp, parameters, threads, seed=5))

    def test_are_not_taken_for_fixed_ones(self):
        envs = DummyVecEnv(
            [lambda r=r: make("BallInCup", random_start=r)[0] for r in (True, False)]
        )
        assert isinstance(make_evaluator(envs), VectorEvaluator)
        alike = DummyVecEnv([lambda: make("BallInCup", random_start=True)[0]] * 2)
        assert isinstance(make_evaluator(alike), SimulationEvaluator)


def test_a_time_limit_ends_episodes_and_leaves_rewards(play, assert_equal_episodes):
    env, mlp, parameters = make("Stacker", 16, success_threshold=1e-45)
    limited = gym.wrappers.TimeLimit(env, 150)
    evaluator = make_evaluator(limited, {"net_arch": [8]})
    assert isinstance(evaluator, SimulationEvaluator)
    rollouts = evaluator.evaluate(parameters)
    assert_equal_episodes(rollouts, play(limited, mlp, parameters))
    assert rollouts.lengths.max() == 150
    assert rollouts.success.any()


def test_individuals_that_succeed_are_stepped_no_more(monkeypatch):
    env, mlp, parameters = make("Stacker", 16, success_threshold=1e-45)
    stepped = []
    step = Simulation.step

    def count(self, actions, ids=None):
        stepped.append(len(actions))
        return step(self, actions, ids)

    monkeypatch.setattr(Simulation, "step", count)
    rollouts = evaluate(env, mlp, parameters)
    assert 0 < rollouts.success.sum() < 16
    assert sum(stepped) == rollouts.timesteps < 16 * HORIZON
    np.testing.assert_array_equal(rollouts.returns > 0.0, rollouts.success)


class Passing:
    """Simulations that succeed in their second step alone, with which the first ends."""

    def __init__(self, task, n, n_threads):
        self.n = n
        self.observations = np.zeros((n, 1), dtype=np.float32)
        self.behaviors = np.zeros((n, 0))
        self.rewards = np.zeros(n)

    def reset(self, ids, rngs):
        self.t = 0

    def step(self, actions, ids):
        self.t += 1
        self.success = np.full(self.n, self.t == 2)
        return (ids == 0) & (self.t == 2)


def test_the_last_step_says_whether_an_episode_succeeded():
    task = SimpleNamespace(n_observations=1, n_actions=1, coverage_grid=None, draws=False)
    mlp = build_mlp(gym.spaces.Box(-1, 1, (1,)), gym.spaces.Box(-1, 1, (1,)), [])
    evaluator = SimulationEvaluator(KnownTask(task, Passing, None, None, 4), mlp)
    rollouts = evaluator.evaluate(np.zeros((4, 2)))
    assert rollouts.lengths.tolist() == [2, 4, 4, 4]
    assert rollouts.success.tolist() == [True, False, False, False]
    evaluator = SimulationEvaluator(KnownTask(task, Passing, None, None, 2), mlp)
    assert evaluator.evaluate(np.zeros((4, 2))).success.all()


def test_a_failed_simulation_ends_the_evaluation_and_not_the_next():
    env, mlp, parameters = make("BallInCup", 6, horizon=50)
    evaluator = SimulationEvaluator(known_task(env), mlp)
    expected = evaluator.evaluate(parameters)
    simulation = evaluator._simulation
    reset = simulation.reset

    def break_one(*given):
        reset(*given)
        simulation._batch.bind("qvel")[4, 0] = 1e12

    simulation.reset = break_one
    with pytest.raises(SimulationError, match="simulation 4"):
        evaluator.evaluate(parameters)
    simulation.reset = reset
    for n in (2, 6):
        rollouts = evaluator.evaluate(parameters[:n])
        np.testing.assert_array_equal(rollouts.behaviors, expected.behaviors[:n])


def test_an_evaluation_leaves_the_next_alone(assert_same_rollouts):
    env, mlp, parameters = make("Finger", 6, horizon=100)
    evaluator = SimulationEvaluator(known_task(env), mlp)
    few = evaluator.evaluate(parameters[:2])
    first = evaluator.evaluate(parameters)
    np.testing.assert_array_equal(first.behaviors[:2], few.behaviors)
    kept = first.observations.copy()
    evaluator.evaluate(-parameters)
    evaluator.evaluate(parameters[:2])
    np.testing.assert_array_equal(first.observations, kept)
    assert_same_rollouts(first, evaluator.evaluate(parameters.astype(np.float64), seed=9))


ROBOTS = ["Ant", "HalfCheetah", "Hopper", "Humanoid", "Swimmer", "Walker2d"]


@pytest.mark.filterwarnings("ignore:compiler attribute 'settotalmass':UserWarning")
class TestRobots:
    @pytest.mark.parametrize(
        "env_id", [*(f"{robot}-v5" for robot in ROBOTS), "CuriosityLocomotion-Ant-v0"]
    )
    def test_equal_gymnasiums_own_stepped_one_by_one(self, env_id, assert_same_rollouts):
        env, other = (gym.make(env_id, max_episode_steps=60) for _ in range(2))
        mlp = build_mlp(env.observation_space, env.action_space, [8])
        rng = np.random.default_rng(0)
        parameters = rng.normal(0, 1, (9, mlp.n_parameters)).astype(np.float32)
        expected = VectorEvaluator(other, mlp).evaluate(parameters, seed=7)
        for n_threads in (1, 2):
            evaluator = make_evaluator(env, {"net_arch": [8]}, n_threads)
            assert isinstance(evaluator, SimulationEvaluator)
            assert_same_rollouts(evaluator.evaluate(parameters, seed=7), expected)
        assert len(np.unique(expected.returns)) == len(parameters)

    @pytest.mark.parametrize(
        "make_env",
        [
            lambda: gym.make("Hopper-v5").unwrapped,  # endless
            lambda: gym.make("Hopper-v5", render_mode="human"),
            lambda: gym.wrappers.TransformReward(gym.make("Hopper-v5"), lambda reward: 2 * reward),
            lambda: gym.make("Pendulum-v1"),
        ],
    )
    def test_others_are_left_to_the_generic_one(self, make_env):
        assert isinstance(make_evaluator(make_env()), VectorEvaluator)

    def test_are_known_in_stable_baselines_and_gymnasiums_vectors(self):
        env_id = "CuriosityLocomotion-Hopper-v0"
        native = gym.make_vec(env_id, num_envs=2, vectorization_mode="vector_entry_point")
        copies = DummyVecEnv([lambda: Monitor(gym.make(env_id))] * 2)
        alone = DummyVecEnv([lambda: Monitor(gym.make("Hopper-v5"))])
        made = [make_vec_env(each, n_envs=3) for each in (env_id, "Hopper-v5")]  # "rgb_array"
        for env in (env_id, "Hopper-v5", native, copies, alone, *made):
            assert isinstance(make_evaluator(env), SimulationEvaluator)
        others = DummyVecEnv(
            [lambda b=b: gym.make(env_id, behavior=b) for b in ("position", "feet")]
        )
        assert isinstance(make_evaluator(others), VectorEvaluator)
