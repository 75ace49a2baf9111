import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from curiosity_algos import make_evaluator
from curiosity_algos.evaluation.maze import MazeEvaluator
from curiosity_algos.evaluation.vector import VectorEvaluator


def make(env, n_individuals, seed=0, net_arch=(8,), n_threads=None):
    """An evaluator of a maze, and vigorous policies that meet walls."""
    evaluator = make_evaluator(env, {"net_arch": net_arch}, n_threads)
    assert isinstance(evaluator, MazeEvaluator)
    rng = np.random.default_rng(seed)
    return evaluator, rng.normal(0, 1, (n_individuals, evaluator.n_parameters)).astype(np.float32)


@pytest.mark.parametrize(("name", "net_arch"), [("Snake", (8,)), ("Labyrinth", (9, 6, 7))])
def test_equals_a_loop_over_the_env(name, net_arch, play, assert_equal_episodes):
    env = gym.make(f"CuriosityMaze-{name}-v0", horizon=250)
    evaluator, parameters = make(env, 4, net_arch=net_arch)
    rollouts = evaluator.evaluate(parameters)
    assert_equal_episodes(rollouts, play(env, evaluator.mlp, parameters))
    assert len(np.unique(rollouts.behaviors, axis=0)) > 2


def test_a_horizon_that_was_changed_is_that_of_the_reward(
    make_easy_maze, play, assert_equal_episodes
):
    env = make_easy_maze()
    env.unwrapped.horizon *= 2
    evaluator, parameters = make(env, 40, net_arch=())
    rollouts = evaluator.evaluate(parameters)
    assert rollouts.success.any()
    assert_equal_episodes(rollouts, play(env, evaluator.mlp, parameters))


def test_all_begin_where_the_seed_draws(play, assert_equal_episodes, assert_same_rollouts):
    env = gym.make("CuriosityMaze-Hard-v0", horizon=60, start_radius=20.0)
    evaluator, parameters = make(env, 4)
    starts = []
    for seed in (5, 6):
        rollouts = evaluator.evaluate(parameters, seed)
        assert_equal_episodes(rollouts, play(env, evaluator.mlp, parameters, seed))
        for mode in AutoresetMode:
            kwargs = {"horizon": 60, "start_radius": 20.0, "autoreset_mode": mode}
            generic = VectorEvaluator(gym.make_vec(env.spec.id, 3, **kwargs), evaluator.mlp)
            assert_same_rollouts(rollouts, generic.evaluate(parameters, seed))
        starts.append(rollouts.observations[:, 0, :2])
    assert (starts[0] == starts[0][0]).all()
    assert (starts[0] != starts[1]).all()


@pytest.mark.parametrize("n_individuals", [1, 23])
def test_threads_change_no_bit(make_easy_maze, n_individuals, assert_same_rollouts):
    env = make_easy_maze()
    made = [make(env, n_individuals, n_threads=n) for n in (1, 2, 4, None)]
    one, *others = (evaluator.evaluate(parameters) for evaluator, parameters in made)
    for other in others:
        assert_same_rollouts(one, other)


def test_an_evaluation_leaves_the_next_alone(make_easy_maze, assert_same_rollouts):
    evaluator, parameters = make(make_easy_maze(), 5)
    first = evaluator.evaluate(parameters)
    kept = first.observations.copy()
    evaluator.evaluate(-parameters)
    np.testing.assert_array_equal(first.observations, kept)
    assert_same_rollouts(first, evaluator.evaluate(parameters.astype(np.float64), seed=9))


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        (np.zeros((2, 5)), r"of shape \(P, 1746\)"),
        (np.zeros((0, 1746)), r"of shape \(P, 1746\)"),
        (np.full((2, 1746), np.nan), "finite"),
        (np.full((2, 1746), 1e300), "finite"),
    ],
    ids=str,
)
@pytest.mark.filterwarnings("ignore:overflow")
def test_parameters_are_checked(parameters, message):
    with pytest.raises(ValueError, match=f"`parameters` must be {message}"):
        make_evaluator("CuriosityMaze-Hard-v0").evaluate(parameters)


def test_parameters_that_overflow_give_finite_actions():
    evaluator = make_evaluator(gym.make("CuriosityMaze-Hard-v0", horizon=50))
    rollouts = evaluator.evaluate(np.full((3, evaluator.n_parameters), 1e38))
    assert np.isfinite(rollouts.behaviors).all()
    assert (np.abs(rollouts.actions[:, :50]) <= 1.0).all()
