import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces

from curiosity_algos.archives.sparse_grid import SparseGridArchive
from curiosity_algos.archives.verify import Verification, verify
from curiosity_algos.evaluation import evaluator as evaluator_module
from curiosity_algos.evaluation.evaluator import make_evaluator
from curiosity_gym import BehaviorWrapper

SEEDS = (3, 14, 15)
UNIT = spaces.Box(0.0, 1.0, (1,))


def last_position(env, observation, info):
    return observation[:2]


def make_cart_pole():
    """Every reset draws; the behavior is where the cart ends, and how fast."""
    env = gym.make("CartPole-v1", max_episode_steps=40)
    return BehaviorWrapper(env, last_position, spaces.Box(-3.0, 3.0, (2,)))


def make_pendulum():
    """Every reset draws, and actions are continuous."""
    env = gym.make("Pendulum-v1", max_episode_steps=15)
    return BehaviorWrapper(env, last_position, spaces.Box(-1.0, 1.0, (2,)))


def make_archive(evaluator, *, ranges=((-4, 4), (-4, 4)), **changes):
    return SparseGridArchive(
        solution_dim=evaluator.n_parameters,
        dims=[200] * len(ranges),
        ranges=ranges,
        solution_dtype=np.float32,
        seed=0,
        **changes,
    )


def random_policies(evaluator, n, number=0):
    rng = np.random.default_rng(number)
    return rng.normal(0.0, 0.5, (n, evaluator.n_parameters)).astype(np.float32)


def fill_maze(env, n=40, net_arch=None):
    """Elites of a maze by where their episodes end."""
    kwargs = None if net_arch is None else {"net_arch": net_arch}
    evaluator = make_evaluator(env, kwargs, n_threads=1)
    policies = random_policies(evaluator, n)
    rollouts = evaluator.evaluate(policies)
    bounds = np.stack([rollouts.behaviors.min(axis=0), rollouts.behaviors.max(axis=0)], axis=1)
    archive = make_archive(evaluator, ranges=bounds.tolist(), net_arch=net_arch)
    archive.add(policies, rollouts.returns, rollouts.behaviors)
    return archive


def fill_drawn(env, *, keep_seeds=True, n=10):
    """Elites of an environment whose resets draw, with the seeds of their episodes."""
    evaluator = make_evaluator(env, n_threads=1)
    fields = {"seed": ((), np.int64)} if keep_seeds else {}
    archive = make_archive(evaluator, extra_fields=fields)
    for seed in SEEDS:
        policies = random_policies(evaluator, n, seed)
        rollouts = evaluator.evaluate(policies, seed)
        seeds = {"seed": np.full(n, seed)} if keep_seeds else {}
        archive.add(policies, rollouts.returns, rollouts.behaviors, **seeds)
    return archive


def corrupt(archive, name, positions, change):
    """A copy of the archive in which `change` was done to a field of some elites."""
    state = archive.state_dict()
    values = state["elites"][name]
    for position in positions:
        values[position] = change(values[position])
    archive.load_state_dict(state)
    return archive


class TestMaze:
    @pytest.fixture
    def env(self, make_maze):
        return make_maze()

    @pytest.mark.parametrize("n", [1, 64, 65, 120])
    def test_any_number_of_elites(self, env, n, monkeypatch):
        """Whether they fill what is played at once, or not."""
        evaluator = make_evaluator(env)
        policies = random_policies(evaluator, n)
        rollouts = evaluator.evaluate(policies)
        archive = make_archive(
            evaluator,
            ranges=[(0, n)],
            extra_fields={"behavior": (rollouts.behaviors.shape[1], np.float64)},
        )
        places = np.arange(n)[:, None] + 0.5
        archive.add(policies, rollouts.returns, places, behavior=rollouts.behaviors)
        assert len(archive) == n
        assert verify(archive, env).share == 1.0
        # Who plays at the same time does not matter.
        monkeypatch.setattr(evaluator_module, "BATCH", 1)
        broken = corrupt(archive, "objective", [n - 1], lambda value: value - 1)
        assert verify(broken, env).failed.tolist() == [n - 1]

    @pytest.mark.parametrize(
        ("name", "change"),
        [
            ("objective", lambda value: np.nextafter(float(value), 9.0)),
            ("measures", lambda value: value * (1 + 2**-52)),
            ("solution", lambda value: -value),
        ],
    )
    def test_those_that_do_not_are_named(self, env, name, change):
        archive = corrupt(fill_maze(env), name, [3, 17], change)
        result = verify(archive, env)
        assert result.failed.tolist() == [3, 17]
        assert result.share == 1 - 2 / len(archive)

    def test_ids_and_vectors_of_environments(self, env):
        archive = fill_maze(env)
        many = gym.make_vec("CuriosityMaze-Hard-v0", num_envs=3, horizon=50)
        assert verify(archive, many).share == 1.0
        short = verify(archive, "CuriosityMaze-Hard-v0")
        assert short.share < 1.0

    def test_an_empty_archive(self, env):
        evaluator = make_evaluator(env)
        result = verify(make_archive(evaluator), env)
        assert isinstance(result, Verification)
        assert result.share == 1.0
        assert result.failed.shape == result.objective.shape == (0,)
        assert result.behaviors.shape == (0, 2)

    def test_policies_for_something_else(self, env, make_easy_maze):
        wrong = r"`env` asks for policies of 1746 parameters, the archive's have \d+"
        with pytest.raises(ValueError, match=wrong):
            verify(fill_drawn(make_cart_pole()), env)
        archive = fill_maze(env, net_arch=[4])
        archive.net_arch = None
        with pytest.raises(ValueError, match=wrong):
            verify(archive, env)
        with pytest.raises(ValueError, match=wrong):
            verify(make_archive(make_evaluator(make_cart_pole())), env)


class TestBehaviors:
    def fill(self, env, behavior_of):
        """Elites placed by their episode's return and length, with a behavior beside."""
        evaluator = make_evaluator(env)
        policies = random_policies(evaluator, 30)
        rollouts = evaluator.evaluate(policies, 5)
        measures = np.stack([rollouts.lengths, policies[:, 0]], axis=1)
        archive = make_archive(
            evaluator,
            ranges=[(0, 41), (-2, 2)],
            extra_fields={"behavior": ((2,), np.float64), "seed": ((), np.int32)},
        )
        behavior = behavior_of(rollouts.behaviors)
        archive.add(policies, rollouts.returns, measures, behavior=behavior, seed=np.full(30, 5))
        return archive

    def test_a_kept_behavior_is_compared(self):
        env = make_cart_pole()
        archive = self.fill(env, lambda behaviors: behaviors)
        result = verify(archive, env)
        assert result.share == 1.0
        np.testing.assert_array_equal(result.behaviors, archive.data("behavior"))
        broken = corrupt(archive, "behavior", [2, 4], lambda value: value + 1e-12)
        assert verify(broken, env).failed.tolist() == [2, 4]

    @pytest.mark.parametrize("wrap", [False, True])
    def test_behaviors_of_another_length(self, wrap):
        """A single number would else be compared with both of the elites'."""
        env = make_cart_pole()
        archive = self.fill(env, lambda behaviors: behaviors)
        other = gym.make("CartPole-v1")
        if wrap:
            other = BehaviorWrapper(other, lambda env, observation, info: [0.5], UNIT)
        with pytest.raises(
            ValueError, match=r"`env` gives behaviors of shape \(\d,\), the archive's .* \(2,\)"
        ):
            verify(archive, other)


class TestSeeds:
    @pytest.mark.parametrize("make_env", [make_cart_pole, make_pendulum])
    def test_episodes_begin_as_they_did(self, make_env):
        archive = fill_drawn(make_env())
        assert set(archive.data("seed")) == set(SEEDS)
        result = verify(archive, make_env())
        assert result.share == 1.0
        np.testing.assert_array_equal(result.behaviors, archive.data("measures"))

    def test_a_wrong_seed_is_noticed(self):
        archive = fill_drawn(make_pendulum())
        seeds = archive.data("seed")
        positions = [int(np.flatnonzero(seeds == seed)[0]) for seed in SEEDS[:2]]
        broken = corrupt(archive, "seed", positions, lambda seed: seed + 1)
        assert verify(broken, make_pendulum()).failed.tolist() == sorted(positions)
