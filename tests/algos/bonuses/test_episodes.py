from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from gymnasium import spaces
from observations import make_observations

from curiosity_algos import BonusReplayBuffer, CuriosityMAPElites
from curiosity_algos.bonuses.checks import check_episodes
from curiosity_algos.bonuses.make import BONUSES

SPACES = spaces.Box(-1, 1, (6,)), spaces.Box(-1, 1, (2,))
NAMES = ["e3b", "etd", "ngu", "noveld"]
EVERY = pytest.mark.parametrize("name", NAMES)


def maker(name):
    return partial(BONUSES[name], n_features=4, seed=0, device="cpu")


@EVERY
def test_each_episode_has_its_own_memory(name):
    check_episodes(maker(name))


@EVERY
def test_a_memory_that_never_forgets_is_found(name, monkeypatch):
    memory = type(maker(name)(*SPACES).episodes(1))
    monkeypatch.setattr(memory, "end", lambda self, dones: None)
    with pytest.raises(AssertionError, match="must be the same"):
        check_episodes(maker(name))


@EVERY
def test_the_end_of_one_leaves_the_others(name):
    places = make_observations(8)
    steps = places[:6].reshape(3, 2, 6)  # of two episodes
    actions = np.zeros((2, 2), dtype=np.float32)
    bonus = maker(name)(*SPACES)
    both, left = bonus.episodes(2), bonus.episodes(2)
    for before, after in pairwise(steps):
        for each in (both, left):
            each.score(before, actions, after)
    both.end(np.array([True, False]))
    # The other comes back to where it was, and the first begins with what was new to it.
    again = np.stack([places[6], steps[0, 1]])
    scores = [each.score(steps[2], actions, again)[1] for each in (both, left)]
    assert scores[0] == scores[1]


@EVERY
def test_a_transition_alone_has_no_bonus(name):
    before, after = make_observations(2)[:, None]
    with pytest.raises(ValueError, match=f"`bonus` must be asked for whole episodes: {name}"):
        maker(name)(*SPACES).score(before, np.zeros((1, 2), dtype=np.float32), after)


@EVERY
def test_where_nothing_knows_episodes_they_are_refused(name):
    with pytest.raises(ValueError, match=f"single transitions in a replay buffer, {name} asks"):
        BonusReplayBuffer(10, *SPACES, bonus=name, device="cpu")
    with pytest.raises(ValueError, match=f"single transitions in an archive of elites, {name}"):
        CuriosityMAPElites("CuriosityMaze-US-v0", bonus=name)
