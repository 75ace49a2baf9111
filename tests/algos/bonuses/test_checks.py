import functools
import itertools

import numpy as np
import pytest
import torch as th
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnvWrapper

from curiosity_algos.bonuses import checks
from curiosity_algos.bonuses.base import Bonus
from curiosity_algos.bonuses.checks import (
    check_bonus,
    check_wrapper,
    learn_tiny_mdp,
    tiny_mdp,
)
from curiosity_algos.bonuses.icm import ICM
from curiosity_algos.bonuses.make import BONUSES
from curiosity_algos.sb3.bonus_wrapper import BonusVecEnvWrapper


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


class PairsWithTheReset(BonusVecEnvWrapper):
    """Takes the observation after a reset for an episode's last."""

    def _last_observations(self, observations, dones, infos):
        return observations


class AfterTheAdvantage(BaseCallback):
    """Adds the bonus to what a rollout has come to, too late for the steps before."""

    def _on_rollout_start(self):
        self.bonuses = []

    def _on_step(self):
        self.bonuses.append([info["reward_intrinsic"] for info in self.locals["infos"]])
        return True

    def _on_rollout_end(self):
        buffer = self.model.rollout_buffer
        buffer.advantages += np.array(self.bonuses, dtype=np.float32)
        buffer.returns += np.array(self.bonuses, dtype=np.float32)


class WithoutReward(VecEnvWrapper):
    """Leaves the bonus in the infos alone."""

    def reset(self):
        return self.venv.reset()

    def step_wait(self):
        observations, rewards, dones, infos = self.venv.step_wait()
        return observations, 0 * rewards, dones, infos


def maker(bonus, **settings):
    return functools.partial(bonus, seed=0, device="cpu", **settings)


def wrap(venv, bonus, wrapper=BonusVecEnvWrapper, **changes):
    return wrapper(venv, bonus=bonus, device="cpu", **changes)


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
        sorted(set(BONUSES) - {"e3b", "ngu", "ramp"}),
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


class TestWrappers:
    def test_ours_is_right(self):
        before = th.get_rng_state()
        check_wrapper(wrap)
        assert th.equal(th.get_rng_state(), before)

    def test_one_that_pays_nothing_is_told_so(self):
        with pytest.raises(AssertionError, match="or none within 4096 transitions"):
            check_wrapper(functools.partial(wrap, train_interval=10_000))

    def test_the_observation_after_the_reset_is_found_out(self):
        with pytest.raises(AssertionError, match="true last observation"):
            check_wrapper(functools.partial(wrap, wrapper=PairsWithTheReset))

    def test_a_bonus_after_the_advantage_is_found_out(self):
        with pytest.raises(AssertionError, match="before advantages are computed"):
            check_wrapper(lambda *given: WithoutReward(wrap(*given)), AfterTheAdvantage())
