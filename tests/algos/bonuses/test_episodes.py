import pytest
from gymnasium import spaces

from curiosity_algos import E3B, ICM, NGU, BonusReplayBuffer, CuriosityMAPElites, NovelD
from curiosity_algos.bonuses.episodes import EpisodicBonus

SPACES = spaces.Box(-1, 1, (6,)), spaces.Box(-1, 1, (2,))


def make(bonus):
    return bonus(*SPACES, seed=0, device="cpu")


def test_which_bonuses_remember_episodes():
    assert isinstance(make(E3B), EpisodicBonus)
    assert isinstance(make(NGU), EpisodicBonus)
    assert isinstance(make(NovelD), EpisodicBonus)
    assert not isinstance(make(ICM), EpisodicBonus)


@pytest.mark.parametrize("name", ["e3b", "ngu", "noveld"])
def test_where_nothing_knows_episodes_they_are_refused(name):
    with pytest.raises(ValueError, match=f"single transitions in a replay buffer, {name} asks"):
        BonusReplayBuffer(10, *SPACES, bonus=name, device="cpu")
    with pytest.raises(ValueError, match=f"single transitions in an archive of elites, {name}"):
        CuriosityMAPElites("CuriosityMaze-US-v0", bonus=name)
