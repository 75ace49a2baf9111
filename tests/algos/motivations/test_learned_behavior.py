import numpy as np
import pytest
from gymnasium import spaces

from curiosity_algos import Rollouts
from curiosity_algos.motivations.learned_behavior import LearnedBehavior

BOX = spaces.Box(-np.inf, np.inf, (3,))


def make_rollouts(rng, n=20, n_steps=100):
    """Walks along a line that go one way, whose other two entries are noise."""
    observations = rng.normal(size=(n, n_steps + 1, 3)).astype(np.float32)
    speeds = rng.uniform(0.5, 1.5, (n, 1))
    observations[..., 0] = speeds * np.arange(n_steps + 1) - 50.0
    return Rollouts(
        returns=np.zeros(n),
        lengths=np.full(n, n_steps),
        success=np.zeros(n, dtype=bool),
        behaviors=np.zeros((n, 0)),
        final_observations=observations[:, -1],
        observations=observations,
        actions=np.zeros((n, n_steps, 1), dtype=np.float32),
    )


def make(seed=0):
    return LearnedBehavior(
        BOX,
        spaces.Box(-1.0, 1.0, (1,)),
        seed=np.random.SeedSequence(seed),
        device="cpu",
        n_threads=1,
    )


def test_what_is_far_in_time_is_far_and_noise_is_not():
    behavior, rng = make(), np.random.default_rng(0)
    for _ in range(20):
        losses = behavior.update(make_rollouts(rng))
    assert losses.keys() == {"apt/loss"}
    places = np.zeros((3, 3))
    places[:, 0] = -40.0, 0.0, 40.0
    here, middle, there = behavior.measures(places)
    noise = behavior.measures(np.add(places[:1], [0.0, 1.0, -1.0]))[0]
    assert here.shape == (8,)
    near, far = np.linalg.norm(here - middle), np.linalg.norm(here - there)
    assert far > 1.1 * near  # 1.30, and 1.05 to 1.75 with other seeds
    assert near > 20.0 * np.linalg.norm(here - noise)


def test_a_state_taken_over_goes_on(assert_same):
    one, twin, rng = make(0), make(1), np.random.default_rng(0)
    one.update(make_rollouts(rng))
    twin.load_state_dict(one.state_dict())
    more = make_rollouts(rng)
    assert one.update(more) == twin.update(more)
    assert_same(one.state_dict(), twin.state_dict())


def test_observations_that_are_not_finite_are_refused():
    with pytest.raises(ValueError, match="finite"):
        make().measures(np.full((1, 3), np.nan))
