from itertools import pairwise

import numpy as np
import pytest
import torch as th
from gymnasium import spaces
from observations import make_observations

from curiosity_algos.bonuses.checks import check_episodes
from curiosity_algos.bonuses.noveld import NovelD

SPACE = spaces.Box(-1, 1, (6,)), spaces.Discrete(3)
IMAGES = spaces.Box(0, 255, (36, 36, 3), np.uint8)
NOTHING = np.zeros(100, dtype=np.int64)


def make_noveld(*spaces, **changes):
    return NovelD(*(spaces or SPACE), **({"n_features": 4, "seed": 0, "device": "cpu"} | changes))


def test_a_first_visit_is_worth_the_gain():
    noveld, observations = make_noveld(alpha=1.5, n_bits=60), make_observations()
    errors = np.sqrt(noveld.errors(noveld.tensor(observations)).detach().numpy())
    expected = np.maximum(errors[1:] - 1.5 * errors[:-1], 0.0)
    assert (expected == 0.0).any()
    scores = noveld.score_trajectory(observations, NOTHING[:19])
    np.testing.assert_allclose(scores, expected, rtol=1e-5, atol=1e-7)
    lowest = make_noveld(alpha=1.5, beta=0.2, n_bits=60).score_trajectory(observations, NOTHING)
    np.testing.assert_allclose(lowest, np.maximum(expected, 0.2), rtol=1e-5)


@pytest.mark.parametrize("kind", ["numbers", "images"])
def test_a_second_visit_is_worth_nothing(kind):
    if kind == "numbers":
        noveld, places = make_noveld(beta=0.1), make_observations(4)
    else:
        noveld = make_noveld(IMAGES, SPACE[1], beta=0.1)
        places = np.zeros((4, *IMAGES.shape), dtype=np.uint8)
        places[np.arange(4), 0, 0, 0] = np.arange(4)  # which differ in a single byte
    order = [0, 1, 2, 1, 0, 3, 3, 2]
    scores = noveld.score_trajectory(places[order], NOTHING[:7])
    assert (scores > 0.0).tolist() == [True, True, False, False, True, False, False]


def codes(noveld, observations):
    return noveld.codes(observations, *noveld.standard()).tolist()


def test_what_is_not_normalized_has_places_too():
    noveld, observations = make_noveld(normalize=False), make_observations(100)
    noveld.observe(th.from_numpy(observations + 9.0))
    assert len(set(codes(noveld, observations))) > 50
    check_episodes(lambda *spaces: make_noveld(*spaces, normalize=False))


def test_a_place_stays_the_same_while_statistics_change():
    noveld, places = make_noveld(beta=0.1, n_bits=62), make_observations(6)
    rng, episodes = np.random.default_rng(1), noveld.episodes(2)
    noveld.observe(th.from_numpy(places))
    paid = []
    for i in range(200):
        begin, end = places[i % 6], places[(i + 1) % 6]
        paid.append(episodes.score(*(np.tile(x, (2, 1)) for x in (begin, [0], end))) > 0.0)
        noveld.observe(th.from_numpy(rng.normal(i, 1 + i, (4, 6)).astype(np.float32)))
    assert np.sum(paid, axis=0).tolist() == [5, 5]


def test_an_episode_that_does_not_end_is_standardized_once_there_is_a_standard():
    noveld, places = make_noveld(beta=0.1), 1e-3 * make_observations(20)
    episodes = noveld.episodes(2)
    walk = [np.tile(each, (2, 1)) for each in places]
    assert (episodes.score(walk[0], NOTHING[:2], walk[1]) == 0.0).all()  # all is one place
    noveld.observe(th.from_numpy(places))
    paid = [episodes.score(a, NOTHING[:2], b) > 0.0 for a, b in pairwise(walk)]
    assert np.sum(paid, axis=0).min() > 15
    again = [episodes.score(a, NOTHING[:2], b) > 0.0 for a, b in pairwise(walk)]
    assert not np.any(again)
