import gymnasium as gym
import numpy as np
import pytest
from ribs.archives import GridArchive
from ribs.emitters import GaussianEmitter
from ribs.schedulers import Scheduler

from curiosity_algos import MAPElites
from curiosity_gym import BehaviorWrapper


def first_two(env, observation, info):
    return observation[:2]


def test_it_is_pyribs_map_elites_on_a_dense_grid(make_model, make_easy_maze):
    model = make_model(MAPElites, make_easy_maze(), n_cells=7)
    space = model._behavior_space
    x0, seed = model._emitters.emitters[0].x0, 3
    dense = GridArchive(
        solution_dim=x0.size,
        dims=[7] * 4,
        ranges=list(zip(space.low, space.high, strict=True)),
        seed=1,
        solution_dtype=np.float32,
        objective_dtype=np.float64,
        measures_dtype=np.float64,
    )
    scheduler = Scheduler(
        dense, [GaussianEmitter(dense, sigma=model.sigma, x0=x0, batch_size=6, seed=seed)]
    )
    model.archive._rng = np.random.default_rng(1)
    model._emitters.emitters[0]._rng = np.random.default_rng(seed)
    for _ in range(12):
        rollouts = model.evaluator.evaluate(scheduler.ask(), 0)
        scheduler.tell(rollouts.returns, rollouts.behaviors)
        model.learn(1, reset_num_timesteps=False)
    for name in ("solution", "objective", "measures", "index"):
        np.testing.assert_array_equal(model.archive.data(name), dense.data(name))
    assert model.archive.stats == dense.stats
    assert model.best_return > 0


def test_the_papers_grid_costs_no_memory_for_its_cells(make_maze):
    model = MAPElites(make_maze(), seed=0).learn(1)
    assert model.archive.cells == 50**4
    assert model.archive.data("solution").shape == (len(model.archive), 1746)
    assert 1 < len(model.archive) <= 56


@pytest.mark.parametrize("bounds", [None, (-np.inf, np.inf)])
def test_the_env_must_have_bounded_behaviors(make_model, bounds):
    env = gym.make("CartPole-v1")
    if bounds is not None:
        env = BehaviorWrapper(env, first_two, gym.spaces.Box(*bounds, (2,)))
    with pytest.raises(ValueError, match="`env` must have a bounded `behavior_space`"):
        make_model(MAPElites, env)


@pytest.mark.parametrize("n_cells", [(5, 6, 2, 1), np.array([5, 6, 2, 1])], ids=type)
def test_each_dimension_has_its_cells(
    make_model, make_easy_maze, tmp_path, assert_same_run, n_cells
):
    model = make_model(MAPElites, make_easy_maze(), n_cells=n_cells).learn(600)
    np.testing.assert_array_equal(model.archive.dims, [5, 6, 2, 1])
    model.save(tmp_path / "model")
    loaded = MAPElites.load(tmp_path / "model", env=make_easy_maze())
    assert loaded.n_cells == [5, 6, 2, 1]
    assert_same_run(model.learn(600), loaded.learn(600))


NO_CELLS = ("50", [5, 6, 0, 1], [5, 6, 2.5, 1], None, [[5] * 4], 7.0, 0)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (([], [5], [5, 6, 2, 1, 3], (5, 6, 2)), "must be .* one for each dimension .* 4, got"),
        (NO_CELLS, "must be a whole number of at least 1,"),
        ((10**5,), r"must make less than 2\*\*63 cells"),
    ],
)
def test_other_cells_are_refused(wrong, message, make_model, make_maze):
    for n_cells in wrong:
        with pytest.raises(ValueError, match=f"^`n_cells` {message}"):
            make_model(MAPElites, make_maze(), n_cells=n_cells)
