import functools
import itertools

import numpy as np
import pytest

from curiosity_algos.bonuses import checks
from curiosity_algos.bonuses.base import Bonus
from curiosity_algos.bonuses.checks import check_bonus, learn_tiny_mdp, tiny_mdp
from curiosity_algos.bonuses.icm import ICM
from curiosity_algos.bonuses.make import BONUSES


class FrozenAtZero(ICM):
    """Whose encoder sees nothing."""

    def __init__(self, *spaces, **settings):
        super().__init__(*spaces, **settings)
        for parameter in self.encoder.parameters():
            parameter.requires_grad_(False)
            parameter.zero_()


class Scripted(Bonus):
    """A bonus that is 1 everywhere, and two other numbers once it is trained."""

    name = "scripted"

    def __init__(self, seen, unseen):
        self.trained, self.is_trained = itertools.cycle([seen, unseen]), False

    def score(self, observations, actions, next_observations):
        return np.full(30, next(self.trained) if self.is_trained else 1.0)

    def update(self, *batch):
        self.is_trained = True
        return {}


def maker(bonus, **settings):
    return functools.partial(bonus, seed=0, device="cpu", **settings)


class TestTinyMdp:
    def test_it_can_be_written_down(self):
        before, actions, after = tiny_mdp()
        states, numbers = np.unique(before, axis=0, return_inverse=True)
        assert len(states) == 20
        pairs = set(zip(numbers.tolist(), actions.tolist(), strict=True))
        assert len(pairs) == 60
        seen = {state.tobytes() for state in before[:30]}
        assert {state.tobytes() for state in after[:30]} <= seen
        assert not {state.tobytes() for state in np.concatenate([before[30:], after[30:]])} & seen

    @pytest.mark.parametrize(
        # Left out is who forgets all but the episode, who pays in any, and what may be negative.
        "bonus",
        [
            "apt",
            "rnd",
            *(
                pytest.param(bonus, marks=pytest.mark.nightly)
                for bonus in sorted(set(BONUSES) - {"apt", "rnd", "e3b", "etd", "ngu", "ramp"})
            ),
        ],
    )
    def test_our_bonuses_fall_where_they_were_trained_alone(self, bonus):
        learned = check_bonus(maker(BONUSES[bonus]), 0)
        assert learned.seen[-1] < 0.03 * learned.unseen[-1]
        assert learned.seen[0] == pytest.approx(learned.unseen[0], rel=0.6)
        assert learned.n_updates[[0, -1]].tolist() == [0, 3000]

    def test_what_does_not_learn_is_found_out(self, monkeypatch):
        # Of what learns a fifth of the updates is enough.
        monkeypatch.setattr(
            checks, "learn_tiny_mdp", functools.partial(learn_tiny_mdp, n_updates=600)
        )
        check_bonus(maker(ICM))
        with pytest.raises(AssertionError, match="must fall where it is trained"):
            check_bonus(maker(ICM, learning_rate=1e-12))
        with pytest.raises(AssertionError, match="must stay higher elsewhere"):
            check_bonus(maker(FrozenAtZero))  # whose encoder sees nothing

    @pytest.mark.parametrize(
        ("seen", "unseen", "message"),
        [
            (0.5, 1.0, "must fall"),
            (0.01, 0.05, "must stay higher elsewhere"),
            (1e-5, 1e-3, "must stay high elsewhere"),
            (-5.0, 1.0, "must not be negative"),
        ],
    )
    def test_what_a_bonus_must_come_to(self, seen, unseen, message):
        with pytest.raises(AssertionError, match=f"The bonus {message}"):
            check_bonus(lambda *spaces: Scripted(seen, unseen))
