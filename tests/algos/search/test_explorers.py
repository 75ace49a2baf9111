"""How explorations act."""

import numpy as np
import pytest
from gymnasium import spaces
from padded_rollouts import rollouts_of

from curiosity_algos.evaluation.open_loop import OpenLoopPolicy
from curiosity_algos.search.explorers import EXPLORERS, Explorers, LinearPolicies, held_outputs

BOX = spaces.Box(-np.inf, np.inf, (3,))


def make(names=EXPLORERS, action_space=None, seed=0):
    acted = spaces.Box(np.float32([-1.0, 0.0]), np.float32([1.0, 4.0]))
    policy = OpenLoopPolicy(BOX, acted if action_space is None else action_space)
    return Explorers(names, policy, seed=np.random.SeedSequence(seed))


def rollouts(n):
    observations = np.random.default_rng(0).normal(5.0, 2.0, (n, 21, 3)).astype(np.float32)
    return rollouts_of(observations, np.full(n, 20))


def test_held_actions_change_in_a_tenth_of_the_steps():
    outputs = held_outputs(np.random.default_rng(0), 200, 100, 2, is_discrete=False)
    assert np.abs(outputs).max() <= 1.0
    changes = (outputs[:, 1:] != outputs[:, :-1]).all(axis=2)
    assert changes.mean() == pytest.approx(0.1, abs=0.01)
    np.testing.assert_array_equal(
        changes, (outputs[:, 1:] != outputs[:, :-1]).any(axis=2)
    )  # all entries at once


def test_discrete_actions_are_held_for_one_to_ten_steps_on_average():
    outputs = held_outputs(np.random.default_rng(0), 500, 2000, 2, is_discrete=True)
    changes = (outputs[:, 1:] != outputs[:, :-1]).any(axis=2).mean(axis=1)
    expected = [0.1, 0.1**0.75, 0.1**0.5, 0.1**0.25, 1.0]
    np.testing.assert_allclose(
        np.quantile(changes, [0.0, 0.25, 0.5, 0.75, 1.0]), expected, atol=0.04
    )


def test_linear_policies_are_those_of_standardized_observations():
    policies, rng = LinearPolicies(3, 2), np.random.default_rng(0)
    seen = rng.normal(4.0, 3.0, (5000, 3))
    policies.observe(seen)
    rows, observations = policies.draw(rng, 6), seen[:6]
    scaled = (observations - seen.mean(0)) / seen.std(0)
    for row, x, output in zip(rows, scaled, policies.act(rows, observations), strict=True):
        weights = row.reshape(2, 4)
        expected = np.tanh(weights[:, :3] @ x / np.sqrt(3) + 0.3 * weights[:, 3])
        np.testing.assert_allclose(output, expected, rtol=1e-3, atol=1e-4)


def test_one_observation_hides_no_others():
    policies, rng = LinearPolicies(3, 2), np.random.default_rng(0)
    policies.observe(rng.normal(size=(5000, 3)))
    rows, seen = policies.draw(rng, 50), rng.normal(size=(50, 3))
    before = policies.act(rows, seen)
    policies.observe(np.full((1, 3), 1e6))
    assert np.abs(policies.act(rows, seen) - before).mean() < 0.5 * np.abs(before).mean()


@pytest.mark.parametrize("n_constant", [3, 5000])
def test_what_was_constant_is_not_bounded_as_it_begins_to_change(n_constant):
    policies, rng = LinearPolicies(1, 1), np.random.default_rng(0)
    policies.observe(np.zeros((n_constant, 1)))
    for _ in range(100):
        policies.observe(rng.normal(scale=1000.0, size=(100, 1)))
    deviation = 1000.0 * np.sqrt(10_000 / (10_000 + n_constant))
    assert np.sqrt(policies.state_dict()["var"]) == pytest.approx(deviation, rel=0.1)


def test_children_are_near_their_parents_or_new():
    policies, rng = LinearPolicies(3, 2), np.random.default_rng(0)
    parents = policies.draw(rng, 2000)
    moved = np.linalg.norm(policies.vary(rng, parents, 0.01) - parents, axis=1)
    assert (moved > 0.5).mean() == pytest.approx(0.1, abs=0.03)


def test_who_comes_further_explores_more_often():
    explorers, parents = make(), np.zeros((400, 8), np.float32)
    assert explorers.shares == {"held": 0.5, "linear": 0.5}
    for _ in range(20):
        plan = explorers.plan(parents, 5, 0.3)
        explorers.learn(plan, np.where(plan.is_held, 1.0, 2.0), rollouts(400))
    assert explorers.shares["held"] == pytest.approx(0.1, abs=0.01)
    assert explorers.plan(parents, 5, 0.3).is_held.mean() == pytest.approx(0.1, abs=0.05)


def test_who_holds_actions_hands_the_policy_on():
    explorers = make()
    parents = np.random.default_rng(0).normal(size=(50, 8)).astype(np.float32)
    plan = explorers.plan(parents, 5, 0.3)
    is_same = (plan.policies == parents).all(axis=1)
    np.testing.assert_array_equal(is_same, plan.is_held)
    observations = np.zeros((50, 3), np.float32)
    acted = explorers.act(plan, np.arange(50), 2, observations)
    held = plan.held[:, 2] * [1.0, 2.0] + [0.0, 2.0]
    np.testing.assert_allclose(acted[plan.is_held], held[plan.is_held], rtol=1e-6)
    assert not np.allclose(acted[~plan.is_held], held[~plan.is_held])


@pytest.mark.parametrize(
    "space", [spaces.Discrete(3, start=2), spaces.MultiBinary(2), spaces.MultiDiscrete([2, 3])]
)
def test_actions_are_of_any_space(space):
    explorers = make(action_space=space)
    taken = explorers.walk(200)
    assert all(space.contains(np.asarray(action, space.dtype)) for action in taken)
    assert len({str(action) for action in taken}) >= 3
