import numpy as np
import pytest
from gymnasium import spaces
from hypothesis import given, settings
from hypothesis import strategies as st
from padded_rollouts import rollouts_of

from curiosity_algos.motivations.novelty import NoveltyMotivation, behavior_size, behaviors_of


def make_rollouts(behaviors, final_observations=None):
    n = len(behaviors)
    finals = np.zeros((n, 3)) if final_observations is None else final_observations
    observations = np.repeat(np.array(finals, dtype=np.float32)[:, None], 2, axis=1)
    return rollouts_of(observations, np.ones(n, int), behaviors=np.array(behaviors))


def brute_force(seen, behaviors, k):
    """Mean distance to the k nearest, in plain Python; among themselves where nothing was seen."""
    scores = []
    for i, behavior in enumerate(behaviors):
        others = seen or [other for j, other in enumerate(behaviors) if j != i]
        distances = sorted(np.linalg.norm(np.subtract(behavior, other)) for other in others)[:k]
        scores.append(sum(distances) / len(distances) if distances else 0.0)
    return scores


@settings(deadline=None)
@given(st.data(), st.integers(1, 5), st.integers(1, 4), st.integers(1, 6))
def test_novelty_equals_a_brute_force(data, k, n_dimensions, n_generations):
    motivation, seen = NoveltyMotivation(n_dimensions, k=k, behavior="final"), []
    entry = st.integers(-3, 3).map(float)
    row = st.lists(entry, min_size=n_dimensions, max_size=n_dimensions)
    for _ in range(n_generations):
        behaviors = data.draw(st.lists(row, min_size=1, max_size=6))
        rollouts = make_rollouts(behaviors)
        np.testing.assert_allclose(
            motivation.score(rollouts), brute_force(seen, behaviors, k), rtol=1e-12, atol=1e-12
        )
        assert motivation.update(rollouts) == {"archive/size": len(seen) + len(behaviors)}
        seen += behaviors


def test_the_whole_state_may_be_compared():
    rollouts = make_rollouts([[0.0], [0.0]], [[0.0, 0.0, 0.0], [0.0, 0.0, 2.0]])
    assert NoveltyMotivation(3, k=1, behavior="state").score(rollouts).tolist() == [2.0, 2.0]
    assert NoveltyMotivation(1, k=1, behavior="final").score(rollouts).tolist() == [0.0, 0.0]
    assert behaviors_of(rollouts, "state").dtype == np.float64


def test_the_length_of_a_behavior():
    observations, behaviors = spaces.Box(-1, 1, (7,)), spaces.Box(-1, 1, (2,))
    assert behavior_size("final", observations, behaviors) == 2
    assert behavior_size("state", observations, behaviors) == 7
    assert behavior_size("state", observations, None) == 7
    with pytest.raises(ValueError, match='`behavior="final"` needs an env with a `behavior_space`'):
        behavior_size("final", observations, None)
    with pytest.raises(ValueError, match="`behavior` must be one of final, state"):
        behavior_size("last", observations, behaviors)
