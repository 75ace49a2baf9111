import gymnasium as gym
import numpy as np
import pytest
from ribs.archives import GridArchive
from ribs.emitters import EvolutionStrategyEmitter
from ribs.schedulers import Scheduler

from curiosity_algos import CMAME
from curiosity_algos.algorithms.cma_me import STRATEGIES
from curiosity_gym import BehaviorWrapper

OPTIMUM = 2.0


class Linear(gym.Env):
    """A policy without hidden layers has 100 parameters here."""

    observation_space = gym.spaces.Box(-1.0, 1.0, (9,))
    action_space = gym.spaces.Box(-1.0, 1.0, (10,))


def behave(env, observation, info):
    return observation[:2]


def sphere(solutions):
    """The sphere function of pyribs' example: objectives, and two projections as measures."""
    objectives = -np.sum((solutions.astype(np.float64) - OPTIMUM) ** 2, axis=1)
    halves = np.split(solutions.astype(np.float64), 2, axis=1)
    return objectives, np.stack([half.sum(axis=1) for half in halves], axis=1)


NIGHTLY = pytest.mark.nightly  # each strategy is compiled, for half a minute


def make_cma_me(**changes):
    env = BehaviorWrapper(Linear(), behave, gym.spaces.Box(-150.0, 150.0, (2,)))
    settings = {"policy_kwargs": {"net_arch": []}, "n_cells": 20, "seed": 0, "sigma": 0.5}
    return CMAME(env, **(settings | changes))


def climb(scheduler, n_generations, **fields):
    for _ in range(n_generations):
        scheduler.tell(*sphere(scheduler.ask()), **fields)


@pytest.mark.parametrize(
    "es", [pytest.param(es, marks=NIGHTLY if es == "lm_ma_es" else ()) for es in STRATEGIES]
)
def test_its_emitter_improves_the_sphere_in_100_dimensions(es):
    model = make_cma_me(es=es)
    assert model.policy.mlp.n_parameters == 100
    fields = {"seed": np.zeros(56, dtype=np.int64)}
    scheduler = Scheduler(model.archive, [model._emitters.emitters[0]])
    climb(scheduler, 1, **fields)
    first = model.archive.stats
    climb(scheduler, 34, **fields)
    assert model.archive.stats.obj_max > 0.8 * first.obj_max  # objectives are below 0
    assert len(model.archive) > 2 * first.num_elites
    assert model._emitters.emitters[0].restarts >= 3
    strategy = type(model._emitters.emitters[0]._opt)
    assert strategy._transform_and_check_sol.stats.cache_path  # compiled once for all processes


def test_it_is_pyribs_cma_me_on_a_dense_grid():
    model = make_cma_me()
    dense = GridArchive(
        solution_dim=100,
        dims=[20, 20],
        ranges=[(-150.0, 150.0)] * 2,
        seed=1,
        solution_dtype=np.float32,
        objective_dtype=np.float64,
        measures_dtype=np.float64,
    )
    kwargs = {"x0": model._emitters.emitters[0].x0, "sigma0": 0.5, "batch_size": 56, "seed": 2}
    kwargs |= {"ranker": "2imp", "restart_rule": 10}
    schedulers = [
        Scheduler(archive, [EvolutionStrategyEmitter(archive, **kwargs)])
        for archive in (dense, model.archive)
    ]
    model.archive._rng = np.random.default_rng(1)
    climb(schedulers[0], 35)
    climb(schedulers[1], 35, seed=np.zeros(56, dtype=np.int64))
    for name in ("solution", "objective", "measures", "index"):
        np.testing.assert_array_equal(model.archive.data(name), dense.data(name))
    assert model.archive.stats == dense.stats


def test_the_logged_step_size_is_the_emitters(make_model, make_maze):
    model = make_model(CMAME, make_maze(), restart_interval=100)
    sizes = []
    for _ in range(4):
        rollouts = model.evaluator.evaluate(model._ask(), 0)
        sizes.append(model._tell(rollouts)["search/sigma"])
        assert sizes[-1] == model._emitters.emitters[0]._opt.sigma
    assert len(set(sizes)) > 1


def test_it_starts_anew_from_an_elite_every_few_generations(make_model, make_easy_maze):
    model = make_model(CMAME, make_easy_maze(), restart_interval=2, population_size=10)
    for n_restarts in range(1, 4):
        model.learn(1, reset_num_timesteps=False)
        model.learn(1, reset_num_timesteps=False)
        emitter = model._emitters.emitters[0]
        assert emitter.restarts == n_restarts
        elites = model.archive.data("solution")
        assert (elites == emitter._opt.mean).all(axis=1).any()
