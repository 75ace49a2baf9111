"""A setting that a callback changes is in force from the next generation on, or is refused."""

import inspect

import numpy as np
import pandas as pd
import pytest
import torch as th
from gymnasium.spaces import Box, Discrete
from ribs.emitters import GaussianEmitter
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure

from curiosity_algos import AURORA, CMAME, NSES, NSLC, RND, CuriosityES, CuriosityMAPElites
from tests.algos.conftest import SETTINGS

NO_SETTINGS = {"env", "policy", "evaluator", "verbose", "tensorboard_log"}
SETTLED = {
    *("seed", "device", "n_threads", "policy_kwargs", "normalize_observations", "search"),
    *("archive", "emitters", "bonus", "bonus_kwargs", "buffer_size", "behavior", "n_cells", "es"),
    *("latent_size", "trajectory_share", "n_kept", "stats_window_size"),
    *("explorer", "is_copied"),
}
CHANGES = {
    **{"step": "paper", "mirrored_sampling": True, "phi": 0.3, "no_reward": "random"},
    **{"n_parents": 1, "n_states": 3, "archive_size": 4, "training_interval": 3},
    **{"batch_size": 3, "n_updates": 20, "n_epochs": 9, "extrinsic": False},
}
"""Other values of settings; of other numbers half is taken."""
WHEN = 2
"""The generation after which one is changed."""


def settings_of(algorithm):
    settled = SETTLED | ({"population_size"} if algorithm is CMAME else set())
    names = inspect.signature(algorithm).parameters.keys() - NO_SETTINGS
    return names & settled, names - settled


class Change(BaseCallback):
    """Saves the model at some time, and then changes a setting of it."""

    def __init__(self, path, name, value):
        super().__init__()
        self.path, self.name, self.value = path, name, value
        self.n_ended = 0

    def _on_step(self):
        self.n_ended += bool(np.all(self.locals["dones"]))
        if self.n_ended == WHEN and not self.path.exists():
            self.model.save(self.path)
            setattr(self.model, self.name, self.value)
        return True


def outcome(model):
    """The policies that the model would play next, and what its bonus has learned."""
    parameters = model.trained_bonus.parameters() if hasattr(model, "trained_bonus") else ()
    return np.concatenate([model._ask().ravel(), *(w.detach().ravel() for w in parameters)])


@pytest.mark.parametrize(
    ("algorithm", "name"),
    [
        pytest.param(algorithm, name, id=f"{algorithm.__name__}-{name}")
        for algorithm in SETTINGS
        for name in sorted(settings_of(algorithm)[1])
    ],
)
def test_a_change_is_in_force(
    algorithm, name, make_model, make_easy_maze, make_maze, assert_same_run, tmp_path
):
    # Where all have a reward, nothing stands in for it; a sum alone has a discount.
    make_env = make_maze if name == "no_reward" else make_easy_maze
    begun = {"n_states": None} if (algorithm, name) == (CuriosityES, "gamma") else {}
    model = make_model(algorithm, make_env(), **begun)
    value = (
        CHANGES[name] if name in CHANGES else type(getattr(model, name))(getattr(model, name) / 2)
    )
    changed = Change(tmp_path / "model.zip", name, value)
    n_timesteps = 64 * 36
    model.learn(n_timesteps, callback=changed)
    assert getattr(model, name) == value
    given, as_it_was = (
        algorithm.load(changed.path, make_env(), **kwargs) for kwargs in ({name: value}, {})
    )
    for each in (given, as_it_was):
        each.learn(n_timesteps - each.num_timesteps, reset_num_timesteps=False)
    assert_same_run(model, given)
    assert not np.array_equal(outcome(model), outcome(as_it_was))


def test_the_log_says_what_is_in_force(make_model, make_easy_maze, tmp_path):
    model = make_model(CuriosityES, make_easy_maze())
    begun, changed = model.sigma, Change(tmp_path / "model.zip", "sigma", 0.01)
    model.set_logger(configure(str(tmp_path), ["csv"]))
    model.learn(64 * 36, callback=changed, log_interval=1)
    logged = pd.read_csv(tmp_path / "progress.csv")["search/sigma"]
    assert (logged.iloc[0], logged.iloc[-1]) == (begun, 0.01)


@pytest.mark.parametrize(
    ("algorithm", "changes"),
    [
        (AURORA, {"latent_size": 2}),
        (AURORA, {"trajectory_share": 0.1}),
        (CuriosityES, {"bonus": "icm"}),
        (CuriosityES, {"bonus_kwargs": {"horizon": 3}}),
        (CuriosityES, {"bonus_kwargs": {"normalize": False}}),
        (CuriosityES, {"buffer_size": 7}),
        (CuriosityMAPElites, {"n_kept": 2}),
        (CuriosityMAPElites, {"bonus_kwargs": {"beta": 0.9}}),
    ],
)
def test_what_a_model_is_made_with_has_an_effect(algorithm, changes, make_model, make_easy_maze):
    made = (make_model(algorithm, make_easy_maze(), seed=2, **each) for each in ({}, changes))
    assert not np.array_equal(*(model.learn(3000)._ask() for model in made))


def test_what_parts_were_made_with_stays(algorithm, make_model, make_easy_maze):
    model = make_model(algorithm, make_easy_maze())
    before = dict(vars(model))
    for name in settings_of(algorithm)[0]:
        with pytest.raises(ValueError, match=f"^`{name}` must stay as it was set: .*make a new "):
            setattr(model, name, 3)
    assert vars(model) == before


@pytest.mark.parametrize(
    ("algorithm", "part", "names"),
    [
        (NSES, "search", ["population_size", "n_parents", "sigma", "learning_rate", "step"]),
        (NSLC, "archive", ["k", "archive_size"]),
        (NSLC, "emitters", ["population_size", "sigma", "n_parents"]),
        (CMAME, "emitters", ["sigma", "restart_interval"]),
    ],
)
def test_what_has_no_effect_on_a_part_of_ones_own_stays(
    algorithm, part, names, make_model, make_easy_maze
):
    def emitters(archive, x0, seed):
        return [GaussianEmitter(archive, sigma=0.1, x0=x0, batch_size=6, seed=seed)]

    made = make_model(algorithm, make_easy_maze())
    own = {"search": getattr(made, "_search", None), "emitters": emitters}
    own["archive"] = getattr(made, "archive", None)
    model = make_model(algorithm, make_easy_maze(), **{part: own[part]})
    for name in names:
        with pytest.raises(ValueError, match=f"^`{name}` must stay as it was set"):
            setattr(model, name, 1)


@pytest.mark.parametrize(
    ("algorithm", "name", "wrong"),
    [
        (NSES, "sigma", 0.0),
        (NSES, "n_parents", 7),
        (CuriosityES, "gamma", 0.5),
        (CuriosityES, "n_updates", 0),
    ],
)
def test_what_it_may_be_is_said_before_it_is_in_force(
    algorithm, name, wrong, make_model, make_easy_maze, assert_same_run
):
    model, twin = (make_model(algorithm, make_easy_maze()).learn(400) for _ in range(2))
    right = getattr(model, name)

    def go_on_with(value):
        setattr(model, name, value)
        model.learn(400, reset_num_timesteps=False)

    with pytest.raises(ValueError, match=f"^`{name}` must be "):
        go_on_with(wrong)
    setattr(model, name, right)
    assert_same_run(model, twin)


def test_a_bonus_of_ones_own_counts_as_it_likes():
    class Counts(RND):
        def __init__(self, *spaces):
            super().__init__(*spaces, device="cpu")
            self.n_seen = 0
            self._begin()

        def observe(self, observations):
            self.n_seen += len(observations)

    bonus = Counts(Box(-1, 1, (2,)), Discrete(2))
    bonus.observe(th.zeros(3, 2))
    assert bonus.n_seen == 3
    with pytest.raises(ValueError, match=r"^`learning_rate` must stay as it was set"):
        bonus.learning_rate = 0.1
