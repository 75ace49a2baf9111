import gymnasium as gym
import numpy as np
import pytest
from ribs.schedulers import Scheduler

from curiosity_algos import CMAME
from curiosity_algos.algorithms.cma_me import STRATEGIES
from curiosity_gym import BehaviorWrapper

OPTIMUM = 2.0


class Linear(gym.Env):
    """A policy without hidden layers has 100 parameters here."""

    observation_space = gym.spaces.Box(-1.0, 1.0, (9,))
    action_space = gym.spaces.Box(-1.0, 1.0, (10,))


def sphere(solutions):
    """The sphere function of pyribs' example: objectives, and two projections as measures."""
    objectives = -np.sum((solutions.astype(np.float64) - OPTIMUM) ** 2, axis=1)
    halves = np.split(solutions.astype(np.float64), 2, axis=1)
    return objectives, np.stack([half.sum(axis=1) for half in halves], axis=1)


@pytest.mark.parametrize("es", STRATEGIES)
def test_its_emitter_improves_the_sphere_in_100_dimensions(es):
    behaviors = gym.spaces.Box(-150.0, 150.0, (2,))
    env = BehaviorWrapper(Linear(), lambda env, observation, info: observation[:2], behaviors)
    settings = {"policy_kwargs": {"net_arch": []}, "n_cells": 20, "seed": 0, "sigma": 0.5}
    model = CMAME(env, es=es, **settings)
    assert model.policy.mlp.n_parameters == 100
    scheduler, stats = Scheduler(model.archive, [model._emitters.emitters[0]]), []
    for _ in range(35):
        scheduler.tell(*sphere(scheduler.ask()), seed=np.zeros(56, dtype=np.int64))
        stats.append(model.archive.stats)
    first = stats[0]
    assert model.archive.stats.obj_max > 0.8 * first.obj_max  # objectives are below 0
    assert len(model.archive) > 2 * first.num_elites
    assert model._emitters.emitters[0].restarts >= 3
    strategy = type(model._emitters.emitters[0]._opt)
    assert strategy._transform_and_check_sol.stats.cache_path  # compiled once for all processes


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
