"""What is read of trajectories block by block is what is read of the whole."""

import gymnasium as gym
import numpy as np
import pytest

from curiosity_algos import AURORA, CuriosityES, make_evaluator
from curiosity_algos.evaluation.base import Evaluator
from tests.algos.conftest import make_easy_maze


def make_population(evaluator, n):
    rng = np.random.default_rng(0)
    return rng.normal(0, 1, (n, evaluator.n_parameters)).astype(np.float32)


class Counting(Evaluator):
    """An evaluator that remembers how many policies it was given at once."""

    def __init__(self, block_size=None):
        self._evaluator = make_evaluator(make_easy_maze(horizon=12))
        self.n_parameters = self._evaluator.n_parameters
        self.sizes = []
        if block_size is not None:
            self.block_size = block_size

    def evaluate(self, parameters, seed=None):
        self.sizes.append(len(parameters))
        return self._evaluator.evaluate(parameters, seed)


def lengths_of(n):
    """A `MakeSummarizers` of how long each trajectory is, and which individual's it is."""
    places = np.arange(n)
    return {"lengths": lambda rollouts, some: (rollouts.lengths, places[some])}


@pytest.mark.parametrize(("n", "sizes"), [(4, [4]), (9, [4, 4, 1])])
def test_more_than_a_block_are_cut(n, sizes, assert_same_rollouts):
    evaluator = Counting(block_size=4)
    rollouts = evaluator.play(make_population(evaluator, n), 0, lengths_of(n))
    assert evaluator.sizes == sizes
    assert (rollouts.observations is None) == (n > 4)
    lengths, places = rollouts.summary("lengths", lengths_of)
    np.testing.assert_array_equal(lengths, rollouts.lengths)
    np.testing.assert_array_equal(places, np.arange(n))
    whole = Counting().evaluate(make_population(evaluator, n), 0)
    assert_same_rollouts(rollouts, whole)


def test_whole_trajectories_are_played_in_one_block():
    evaluator = Counting(block_size=4)
    rollouts = evaluator.play(make_population(evaluator, 9), 0, None)
    assert evaluator.sizes == [9]
    assert rollouts.trajectories[0].shape[:2] == (9, 13)


def test_without_trajectories_there_is_no_new_summary():
    evaluator = Counting(block_size=4)
    rollouts = evaluator.play(make_population(evaluator, 9), 0, {})
    with pytest.raises(ValueError, match="hold no trajectories"):
        rollouts.summary("observations", lambda n: {"observations": lambda r, _: r.trajectories})


@pytest.mark.parametrize("n_envs", [3, 300])
def test_blocks_of_vector_environments_are_whole_batches(n_envs):
    venv = gym.make_vec("CartPole-v1", n_envs, vectorization_mode="sync")
    block_size = make_evaluator(venv).block_size
    assert block_size % n_envs == 0
    assert 128 <= block_size < 128 + n_envs


def test_they_change_no_bit_of_a_search(algorithm, make_model, make_easy_maze, assert_same_run):
    whole, cut = (make_model(algorithm, make_easy_maze()) for _ in range(2))
    cut.evaluator.block_size = 4
    for model in (whole, cut):
        model.learn(1500)
    assert whole.generation > 3
    assert_same_run(whole, cut)


@pytest.mark.parametrize("algorithm", [CuriosityES, AURORA])
def test_callbacks_see_trajectories_of_one_block_alone(algorithm, make_model, make_easy_maze):
    seen = []
    model = make_model(algorithm, make_easy_maze())

    def look(found, _):
        seen.append(found["rollouts"].observations is not None)

    model.learn(1, callback=look)
    model.evaluator.block_size = 4
    # The first generation of AURORA's trajectories tells how long they are.
    model.learn(1, callback=look)
    assert seen == [True, False]
