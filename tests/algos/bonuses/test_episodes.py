import numpy as np
import pytest
from gymnasium import spaces

from curiosity_algos import E3B, ICM, BonusReplayBuffer, CuriosityMAPElites, NovelD
from curiosity_algos.bonuses.episodes import EpisodicBonus, score_in_order

SPACES = spaces.Box(-1, 1, (6,)), spaces.Box(-1, 1, (2,))


def make(bonus):
    return bonus(*SPACES, seed=0, device="cpu")


def test_which_bonuses_remember_episodes():
    assert isinstance(make(E3B), EpisodicBonus)
    assert isinstance(make(NovelD), EpisodicBonus)
    assert not isinstance(make(ICM), EpisodicBonus)


@pytest.mark.parametrize("bonus", [E3B, NovelD, ICM])
def test_transitions_in_a_row_are_an_episode(bonus):
    bonus, rng = make(bonus), np.random.default_rng(0)
    observations = rng.normal(0, 1, (3, 9, 6)).astype(np.float32)
    actions = rng.uniform(-1, 1, (3, 8, 2)).astype(np.float32)
    scores = score_in_order(bonus, observations[:, :-1], actions, observations[:, 1:])
    expected = [bonus.score_trajectory(*each) for each in zip(observations, actions, strict=True)]
    np.testing.assert_allclose(scores, expected, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("name", ["e3b", "noveld"])
def test_where_nothing_knows_episodes_they_are_refused(name):
    with pytest.raises(ValueError, match=f"single transitions in a replay buffer, {name} asks"):
        BonusReplayBuffer(10, *SPACES, bonus=name, device="cpu")
    with pytest.raises(ValueError, match=f"single transitions in an archive of elites, {name}"):
        CuriosityMAPElites("CuriosityMaze-US-v0", bonus=name)
