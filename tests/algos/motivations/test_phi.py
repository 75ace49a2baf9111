import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from logs import read_log
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure

from curiosity_algos import NSES, CuriosityES
from curiosity_algos.loops.evolution_strategy import standardize
from curiosity_algos.motivations.phi import (
    HIGHEST,
    PATIENCE,
    STEP,
    Phi,
    check_phi,
)

STRATEGIES = pytest.mark.parametrize("algorithm", [CuriosityES, NSES])


def adapted(*generations):
    """The weight after each generation, which had a better return or had not."""
    phi, values = Phi("adaptive"), []
    for best_return in returns_of(generations):
        phi.adapt(best_return)
        values.append(phi.value)
    return values


def returns_of(generations):
    """Best returns, which are better than all before or are not."""
    return [float(i) if improved else -np.inf for i, improved in enumerate(generations)]


class TestAdaptive:
    def test_the_settings_that_the_numbers_here_are_for(self):
        assert (HIGHEST, STEP, PATIENCE) == (0.8, 0.2, 3)

    def test_patience_lowers_it_by_a_step(self):
        assert adapted(*[False] * 7) == [0.8, 0.8, 0.6, 0.6, 0.6, 0.4, 0.4]

    def test_a_better_return_raises_it_by_a_step(self):
        assert adapted(*[False] * 6, True, True) == [0.8, 0.8, 0.6, 0.6, 0.6, 0.4, 0.6, 0.8]

    def test_a_better_return_begins_the_waiting_anew(self):
        assert adapted(False, False, True, False, False) == [0.8] * 5
        assert adapted(False, False, True, False, False, False)[-1] == 0.6

    def test_it_stays_within_its_bounds(self):
        assert adapted(True) == [0.8]
        assert adapted(*[False] * 12)[-1] == 0.0
        assert adapted(*[False] * 30)[-1] == 0.0
        assert adapted(*[False] * 15, True)[-1] == 0.2

    @given(st.lists(st.booleans(), max_size=60))
    def test_it_moves_by_single_steps_up_only_when_better(self, generations):
        values = [0.8, *adapted(*generations)]
        assert set(values) <= {0.0, 0.2, 0.4, 0.6, 0.8}
        moves = np.diff(values)
        assert (np.abs(moves) <= STEP + 1e-9).all()
        for improved, move in zip(generations, moves, strict=True):
            assert move >= 0.0 if improved else move <= 0.0

    @given(st.lists(st.booleans(), max_size=30), st.lists(st.booleans(), max_size=30))
    def test_it_resumes(self, before, after):
        phi, resumed = Phi("adaptive"), Phi("adaptive")
        returns = returns_of([*before, *after])
        for best_return in returns[: len(before)]:
            phi.adapt(best_return)
        resumed.load_state_dict(json.loads(json.dumps(phi.state_dict())))
        for best_return in returns[len(before) :]:
            phi.adapt(best_return)
            resumed.adapt(best_return)
            assert resumed.state_dict() == phi.state_dict()

    @pytest.mark.parametrize("value", [1.1, float("nan")])
    def test_a_damaged_weight_changes_nothing(self, value):
        phi = Phi("adaptive")
        with pytest.raises(ValueError, match="phi` must be "):
            phi.load_state_dict({"phi": value, "waited": 1, "best": 0.0})
        assert phi.state_dict() == Phi("adaptive").state_dict()


def test_a_damaged_best_return_changes_nothing():
    phi = Phi("adaptive")
    with pytest.raises(ValueError, match="`best` must be a number"):
        phi.load_state_dict({"phi": 0.2, "waited": 1, "best": float("nan")})
    assert phi.state_dict() == Phi("adaptive").state_dict()


def test_a_fixed_one_stays():
    phi = Phi(0.7)
    for best_return in [1.0, *[0.0] * 9]:
        phi.adapt(best_return)
    assert phi.value == 0.7


@pytest.mark.parametrize("phi", [0, 1, 0.8, np.float32(0.5), "adaptive"])
def test_what_phi_may_be(phi):
    check_phi(phi)


@pytest.mark.parametrize("phi", ["auto", 1.1, float("nan"), np.zeros(2)])
def test_errors_say_what_phi_may_be(phi):
    with pytest.raises(ValueError, match=r'^`phi` must be from 0 to 1, or "adaptive", got'):
        check_phi(phi)


@STRATEGIES
def test_every_generation_is_compared_with_the_best_before(
    algorithm, make_model, make_easy_maze, tmp_path
):
    model = make_model(algorithm, make_easy_maze(), phi="adaptive")
    model.set_logger(configure(str(tmp_path), ["json"]))
    model.learn(6000)
    rows = read_log(tmp_path)
    best = np.maximum.accumulate([-np.inf, *(row["rollout/ep_rew_max"] for row in rows)])
    assert [row["search/phi"] for row in rows] == adapted(*(np.diff(best) > 0.0))
    assert {row["search/phi"] for row in rows} > {0.8, 0.6}


def test_a_generation_is_ranked_by_the_weight_that_it_leads_to(
    make_model, make_easy_maze, assert_same
):
    model, twin = (make_model(NSES, make_easy_maze(), phi="adaptive") for _ in range(2))
    phi, best, lowest = Phi("adaptive"), -np.inf, HIGHEST
    for _ in range(20):
        rollouts = twin.evaluator.evaluate(twin._search.ask(), twin._episodes.draw())
        phi.adapt(rollouts.returns.max())
        lowest = min(lowest, phi.value)
        best = max(best, rollouts.returns.max())
        novelty = standardize(twin._motivation.score(rollouts))
        twin._search.tell(phi.value * standardize(rollouts.returns) + (1 - phi.value) * novelty)
        twin._motivation.update(rollouts)
        model.learn(1, reset_num_timesteps=False)
        assert_same(model._search.state_dict(), twin._search.state_dict())
    assert best > 0.0
    assert lowest < HIGHEST


@STRATEGIES
def test_while_it_is_at_its_highest_it_is_the_fixed_one(
    algorithm, make_model, make_easy_maze, assert_same
):
    models = [make_model(algorithm, make_easy_maze(), phi=phi) for phi in (HIGHEST, "adaptive")]
    for model in models:
        for _ in range(PATIENCE):  # the first generation is better than none
            model.learn(1, reset_num_timesteps=False)
    assert_same(models[0]._search.state_dict(), models[1]._search.state_dict())


@pytest.mark.parametrize(("saved", "given"), [("adaptive", 0.3), (0.3, "adaptive")])
def test_load_takes_another(make_model, make_easy_maze, tmp_path, saved, given):
    make_model(NSES, make_easy_maze(), phi=saved).learn(3500).save(tmp_path / "model")
    loaded = NSES.load(tmp_path / "model", env=make_easy_maze(), phi=given)
    assert loaded._fitness.phi.value == {"adaptive": HIGHEST}.get(given, given)


def test_another_environment_has_another_best_return(make_model, make_easy_maze, make_maze):
    model = make_model(NSES, make_easy_maze(), phi="adaptive").learn(6000)
    before = model._fitness.phi.value
    assert model.best_return > 0.0
    model.set_env(make_maze())
    model.learn(1, reset_num_timesteps=False)
    assert model._fitness.phi.value > before


class UntilReward(BaseCallback):
    """Ends a run with its first return above 0."""

    def _on_step(self):
        return self.model.best_return <= 0.0


def test_it_reaches_the_flag_of_the_mountain_car():
    model = CuriosityES("MountainCarContinuous-v0", seed=100, device="cpu")
    model.learn(1.5e6, callback=UntilReward())
    assert model.best_return > 0.0
