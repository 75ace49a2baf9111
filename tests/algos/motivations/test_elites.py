import numpy as np
import pytest
from gymnasium import spaces
from padded_rollouts import LENGTHS, N_OBSERVATIONS, make_rollouts

from curiosity_algos.bonuses.icm import ICM
from curiosity_algos.motivations.elites import EliteCuriosity

N_KEPT = 16
OBSERVATIONS = spaces.Box(-1, 1, (N_OBSERVATIONS,))
ACTIONS = {"box": spaces.Box(-1, 1, (2,)), "discrete": spaces.Discrete(3)}
KINDS = pytest.mark.parametrize("kind", ACTIONS)


def make_curiosity(kind="box", n_kept=N_KEPT, seed=0):
    bonus = ICM(OBSERVATIONS, ACTIONS[kind], hidden=32, seed=0, device="cpu")
    return EliteCuriosity(bonus, n_kept, np.random.SeedSequence(seed))


def as_stored(fields):
    """Fields as an archive holds them: of an action always a row of numbers."""
    n, n_kept = fields["observations"].shape[:2]
    return fields | {"actions": fields["actions"].reshape(n, n_kept, -1)}


@KINDS
def test_fields_are_transitions_of_each_episode(kind):
    rollouts = make_rollouts(kind == "discrete")
    fields = as_stored(make_curiosity(kind, n_kept=60).fields(rollouts))
    assert fields["observations"].shape == fields["next_observations"].shape == (5, 60, 3)
    assert fields["actions"].dtype == rollouts.actions.dtype
    np.testing.assert_array_equal(fields["length"], LENGTHS)
    for i, length in enumerate(LENGTHS):
        times = [
            np.flatnonzero((rollouts.observations[i] == observation).all(axis=1)).item()
            for observation in fields["observations"][i]
        ]
        assert set(times) == set(range(length))
        following = rollouts.observations[i, np.array(times) + 1]
        np.testing.assert_array_equal(fields["next_observations"][i], following)
        played = rollouts.actions[i].reshape(len(rollouts.actions[i]), -1)[times]
        np.testing.assert_array_equal(fields["actions"][i], played)


@KINDS
def test_a_score_is_the_length_times_the_mean_of_what_is_kept(kind):
    curiosity = make_curiosity(kind)
    elites = as_stored(curiosity.fields(make_rollouts(kind == "discrete")))
    expected = []
    for i, length in enumerate(LENGTHS):
        total = 0.0
        for t in range(N_KEPT):
            action = elites["actions"][i, t : t + 1]
            one = [elites[name][i, t : t + 1] for name in ("observations", "next_observations")]
            total += float(curiosity.bonus.score(one[0], action, one[1])[0])
        expected.append(length * total / N_KEPT)
    scores = curiosity.score(elites)
    assert scores.dtype == np.float64
    np.testing.assert_allclose(scores, expected, rtol=1e-5)


def test_draws_resume():
    one, other = make_curiosity(), make_curiosity(seed=1)
    one.fields(make_rollouts())
    assert not np.array_equal(*(each.fields(make_rollouts())["actions"] for each in (one, other)))
    other.load_state_dict(one.state_dict())
    np.testing.assert_equal(one.fields(make_rollouts()), other.fields(make_rollouts()))
